#include "lod/cut_clusters.hpp"

#include <algorithm>

#include "base/math.hpp"
#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

Aabb triangle_box(const Mesh& mesh, const Triangle& t) {
  Aabb box;
  for (uint32_t v : t) extend(box, mesh.positions[v]);
  return box;
}

// Sorts by material, keeping the order within one, and gives the range of each.
void sort_by_material(const Source& source, std::span<Triangle> triangles,
                      std::vector<Range>& segments) {
  segments.clear();
  if (source.vertex_materials.empty()) return;
  const auto material = [&](const Triangle& t) { return source.vertex_materials[t[0]]; };
  std::stable_sort(triangles.begin(), triangles.end(),
                   [&](const Triangle& a, const Triangle& b) { return material(a) < material(b); });
  for (uint32_t begin = 0; begin < triangles.size();) {
    uint32_t end = begin;
    while (end < triangles.size() && material(triangles[end]) == material(triangles[begin])) ++end;
    segments.push_back({begin, end - begin});
    begin = end;
  }
}

ClusterInput cluster_input(std::span<const Triangle> triangles, std::span<const Aabb> boxes,
                           std::span<const Range> segments) {
  ClusterInput input;
  input.boxes = boxes;
  input.item_vertices = {triangles.empty() ? nullptr : triangles.data()->data(),
                         3 * triangles.size()};
  input.vertices_per_item = 3;
  input.segments = segments;
  return input;
}

// One cluster with vertices of its own, numbered by first use.
void append_cluster(const Source& source, std::span<const Triangle> triangles,
                    std::span<const Aabb> boxes, std::span<const uint32_t> items,
                    uint32_t generating_group, ClusterSet& out) {
  // Open addressing over at most 256 vertices.
  constexpr uint32_t kSlots = 512;
  uint32_t keys[kSlots];
  uint8_t values[kSlots];
  std::fill(keys, keys + kSlots, kNone);
  uint32_t vertices[256];
  uint8_t corners[3 * 256];
  uint32_t vertex_count = 0, corner_count = 0;
  Aabb box;
  for (uint32_t item : items) {
    extend(box, boxes[item]);
    for (uint32_t v : triangles[item]) {
      uint32_t slot = (v * 0x9e3779b1u) >> 23;
      while (keys[slot] != kNone && keys[slot] != v) slot = (slot + 1) % kSlots;
      if (keys[slot] == kNone) {
        keys[slot] = v;
        values[slot] = static_cast<uint8_t>(vertex_count);
        vertices[vertex_count++] = v;
      }
      corners[corner_count++] = values[slot];
    }
  }
  out.append({vertices, vertex_count}, {corners, corner_count}, generating_group,
             source.material(vertices[0]), box);
}

}  // namespace

ClusterConfig cluster_config(const Config& config) {
  ClusterConfig result = cluster_preset("quality", config.max_triangles);
  result.min_items = std::max(1u, config.max_triangles / 4);
  result.max_vertices = config.max_vertices;
  return result;
}

void ClusterCutter::cut(const Source& source, std::span<Triangle> triangles,
                        uint32_t generating_group, ClusterSet& out) {
  if (triangles.empty()) return;
  sort_by_material(source, triangles, segments_);
  boxes_.clear();
  for (const Triangle& t : triangles) boxes_.push_back(triangle_box(source.mesh, t));
  bisector_.build(cluster_input(triangles, boxes_, segments_), config_, clusters_);
  for (const Range& range : clusters_.ranges)
    append_cluster(source, triangles, boxes_,
                   std::span(clusters_.items).subspan(range.offset, range.count), generating_group,
                   out);
}

void cut_mesh(const Source& source, const Config& config, const BuildOptions& options,
              ClusterSet& out) {
  std::vector<Triangle> triangles = source.mesh.triangles;
  std::vector<Range> segments;
  sort_by_material(source, triangles, segments);
  std::vector<Aabb> boxes(triangles.size());
  parallel_for(triangles.size(), 4096,
               [&](size_t i) { boxes[i] = triangle_box(source.mesh, triangles[i]); });
  const Clusters clusters =
      build_clusters(cluster_input(triangles, boxes, segments), cluster_config(config), options);
  // Chunks by position, joined in order.
  constexpr size_t kChunk = 512;
  std::vector<ClusterSet> chunks((clusters.ranges.size() + kChunk - 1) / kChunk);
  parallel_chunks(clusters.ranges.size(), kChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Range range = clusters.ranges[i];
      append_cluster(source, triangles, boxes,
                     std::span(clusters.items).subspan(range.offset, range.count), kNone,
                     chunks[begin / kChunk]);
    }
  });
  std::vector<ClusterRef> all;
  for (const ClusterSet& chunk : chunks)
    for (uint32_t i = 0; i < chunk.size(); ++i) all.push_back({&chunk, i});
  out = gather_clusters(all);
}

}  // namespace umbel::lod
