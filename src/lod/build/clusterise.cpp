#include "lod/build/clusterise.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <mutex>
#include <utility>

#include "base/math.hpp"
#include "lod/dag/bounds.hpp"

namespace umbel::lod {
namespace {

// Sorts by material, keeping the order within one, and gives the range of each.
void sort_by_material(std::span<const uint32_t> vertex_materials, bool mix,
                      std::span<Triangle> triangles, std::vector<Range>& segments) {
  segments.clear();
  if (mix || vertex_materials.empty()) return;
  const auto material = [&](const Triangle& t) { return vertex_materials[t[0]]; };
  std::stable_sort(triangles.begin(), triangles.end(),
                   [&](const Triangle& a, const Triangle& b) { return material(a) < material(b); });
  for (uint32_t begin = 0; begin < triangles.size();) {
    uint32_t end = begin;
    while (end < triangles.size() && material(triangles[end]) == material(triangles[begin])) ++end;
    segments.push_back({begin, end - begin});
    begin = end;
  }
}

MeshView view_of(std::span<const Vec3> positions, std::span<const Triangle> triangles) {
  MeshView view;
  view.positions = positions;
  view.triangles = triangles;
  return view;
}

// Of most of the triangles; the lowest of those that are as many.
uint32_t common_material(std::span<const uint32_t> vertex_materials,
                         std::span<const Triangle> triangles, std::span<const uint32_t> items) {
  if (vertex_materials.empty()) return 0;
  std::array<uint32_t, 256> materials{};
  for (size_t i = 0; i < items.size(); ++i) materials[i] = vertex_materials[triangles[items[i]][0]];
  const auto end = materials.begin() + items.size();
  std::sort(materials.begin(), end);
  uint32_t common = materials[0];
  for (auto at = materials.begin(); at != end;) {
    const auto next = std::upper_bound(at, end, *at);
    if (next - at > std::count(materials.begin(), end, common)) common = *at;
    at = next;
  }
  return common;
}

struct FirstClusters {
  ClusterSet clusters;
  std::vector<Sphere> spheres;
};

// One cluster of the whole mesh with vertices of its own, numbered by first use.
void append_cluster(const Source& source, std::span<const Triangle> triangles,
                    std::span<const uint32_t> items, FirstClusters& out) {
  // A table of its own, on the stack: at most 256 vertices. No branch can predict which are new, so
  // nothing branches on it.
  constexpr uint32_t kSlots = 1024;
  uint32_t keys[kSlots];
  uint8_t values[kSlots];
  std::fill(keys, keys + kSlots, kNone);
  uint32_t vertices[257];
  uint8_t corners[3 * 256];
  uint32_t vertex_count = 0, corner_count = 0;
  constexpr size_t kAhead = 8;  // items in memory's order are rare
  for (size_t i = 0; i < items.size(); ++i) {
    __builtin_prefetch(&triangles[items[std::min(i + kAhead, items.size() - 1)]]);
    for (uint32_t v : triangles[items[i]]) {
      __builtin_prefetch(&source.mesh.positions[v]);
      uint32_t slot = (v * 0x9e3779b1u) >> 22;
      while (keys[slot] != v && keys[slot] != kNone) slot = (slot + 1) % kSlots;
      const bool is_new = keys[slot] != v;
      keys[slot] = v;
      values[slot] = is_new ? static_cast<uint8_t>(vertex_count) : values[slot];
      vertices[vertex_count] = v;
      vertex_count += is_new;
      corners[corner_count++] = values[slot];
    }
  }
  Aabb box;
  Vec3 points[257];
  for (uint32_t i = 0; i < vertex_count; ++i)
    extend(box, points[i] = source.mesh.positions[vertices[i]]);
  out.clusters.append({vertices, vertex_count}, {corners, corner_count}, kNone,
                      common_material(source.vertex_materials, triangles, items), box);
  out.spheres.push_back(bounding_sphere({points, vertex_count}));
}

// The same of a sub-mesh, whose vertices are few enough for a table.
void append_cluster(const SubMesh& sub_mesh, std::span<const uint32_t> items,
                    uint32_t generating_group, ClusterVertices& numbers, ClusterSet& out) {
  uint32_t vertices[257];
  uint8_t corners[3 * 256];
  uint32_t vertex_count = 0, corner_count = 0;
  numbers.begin(sub_mesh.vertices.size());
  for (const uint32_t item : items)
    for (const uint32_t v : sub_mesh.triangles[item]) {
      bool is_new = false;
      corners[corner_count++] = numbers.number(v, vertex_count, is_new);
      vertices[vertex_count] = v;
      vertex_count += is_new;
    }
  Aabb box;
  for (uint32_t i = 0; i < vertex_count; ++i) {
    extend(box, sub_mesh.positions[vertices[i]]);
    vertices[i] = sub_mesh.vertices[vertices[i]];
  }
  out.append({vertices, vertex_count}, {corners, corner_count}, generating_group,
             common_material(sub_mesh.materials, sub_mesh.triangles, items), box);
}

}  // namespace

ClusterConfig cluster_config(const Config& config) {
  ClusterConfig result = cluster_preset("quality", config.max_triangles);
  result.min_items =
      config.min_triangles > 0 ? config.min_triangles : std::max(1u, config.max_triangles / 4);
  result.max_vertices = config.max_vertices;
  result.underfill_cost = config.underfill_cost;
  result.vertex_underfill_cost = config.vertex_underfill_cost;
  result.overlap_cost = config.overlap_cost;
  return result;
}

void ClusterVertices::begin(size_t most) {
  constexpr uint32_t kStamps = 1u << 24;
  if (numbers_.size() < most) numbers_.resize(most, 0);
  if (++stamp_ < kStamps) return;
  std::fill(numbers_.begin(), numbers_.end(), 0u);
  stamp_ = 1;
}

void Clusteriser::append(SubMesh& sub_mesh, uint32_t generating_group, ClusterSet& out) {
  if (sub_mesh.triangles.empty()) return;
  sort_by_material(sub_mesh.materials, mix_, sub_mesh.triangles, segments_);
  bisector_.build(view_of(sub_mesh.positions, sub_mesh.triangles), segments_, config_, clusters_);
  for (const Range& range : clusters_.ranges)
    append_cluster(sub_mesh, std::span(clusters_.items).subspan(range.offset, range.count),
                   generating_group, numbers_, out);
}

void clusterise_source(const Source& source, const Config& config, ClusterSet& out,
                       std::vector<Sphere>& spheres) {
  std::vector<Triangle> sorted;
  std::vector<Range> segments;
  if (!source.vertex_materials.empty() && !config.mix_materials) {
    sorted = source.mesh.triangles;
    sort_by_material(source.vertex_materials, false, sorted, segments);
  }
  const std::span<const Triangle> triangles = sorted.empty() ? source.mesh.triangles : sorted;
  std::mutex mutex;
  std::map<uint32_t, FirstClusters> parts;  // by where they begin
  const auto visit = [&](uint32_t offset, std::span<const uint32_t> items,
                         std::span<const uint8_t> first) {
    FirstClusters part;
    for (size_t begin = 0, end = 0; begin < items.size(); begin = end) {
      for (end = begin + 1; end < items.size() && !first[end];) ++end;
      append_cluster(source, triangles, items.subspan(begin, end - begin), part);
    }
    const std::scoped_lock lock(mutex);
    parts.emplace(offset, std::move(part));
  };
  cluster::cluster_triangles(view_of(source.mesh.positions, triangles), segments,
                             cluster_config(config), 0.0f, {}, visit);
  std::vector<ClusterRef> all;
  for (const auto& [offset, part] : parts) {
    for (uint32_t i = 0; i < part.clusters.size(); ++i) all.push_back({&part.clusters, i});
    spheres.insert(spheres.end(), part.spheres.begin(), part.spheres.end());
  }
  out = gather_clusters(all);
}

}  // namespace umbel::lod
