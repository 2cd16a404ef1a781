#include "lod/build/dag_writer.hpp"

#include <algorithm>
#include <utility>

#include "base/big_vector.hpp"
#include "base/parallel.hpp"

namespace umbel::lod {

void DagWriter::reserve(const ClusterSet& finest) {
  // Levels keep somewhat more than the ratio, and more vertices a triangle.
  const double levels = 1.2 / (1.0 - double{dag_.config.ratio});
  const auto with_levels = [&](size_t count) { return static_cast<size_t>(levels * count); };
  reserve_big(dag_.cluster_vertices, with_levels(finest.vertices.size()));
  reserve_big(dag_.cluster_triangles, with_levels(finest.corners.size()));
  reserve_big(dag_.vertex_offsets, with_levels(finest.size()));
  reserve_big(dag_.triangle_offsets, with_levels(finest.size()));
  reserve_big(dag_.tables.clusters, with_levels(finest.size()));
}

void DagWriter::add_group(const NewGroup& added) {
  Tables& tables = dag_.tables;
  Group group;
  group.clusters = {static_cast<uint32_t>(tables.clusters.size() + members_.size()),
                    static_cast<uint32_t>(added.members.size())};
  group.level = added.level;
  group.method = added.method;
  group.sphere = added.sphere;
  group.error = added.error;
  members_.insert(members_.end(), added.members.begin(), added.members.end());
  tables.groups.push_back(group);
  dag_.limiting_factors.push_back(added.limiting_factor);
  count_group(added.method, added.limiting_factor, dag_.report);
}

void DagWriter::finish_level(const ClusterSet& pending) {
  const uint32_t end = static_cast<uint32_t>(dag_.tables.groups.size());
  if (end == first_group_) return;
  write_clusters(pending);
  for (uint32_t g = first_group_; g < end; ++g) {
    const Range range = dag_.tables.groups[g].clusters;
    for (uint32_t c = range.offset; c < range.offset + range.count; ++c)
      dag_.tables.clusters[c].group = g;
  }
  dag_.tables.levels.push_back({first_group_, end - first_group_});
  first_group_ = end;
}

void DagWriter::write_clusters(const ClusterSet& pending) {
  std::vector<Cluster>& clusters = dag_.tables.clusters;
  const size_t first = clusters.size();
  clusters.resize(first + members_.size());
  for (uint32_t c : members_) {
    dag_.vertex_offsets.push_back(dag_.vertex_offsets.back() +
                                  static_cast<uint32_t>(pending.cluster_vertices(c).size()));
    dag_.triangle_offsets.push_back(dag_.triangle_offsets.back() + pending.triangle_offsets[c + 1] -
                                    pending.triangle_offsets[c]);
  }
  dag_.cluster_vertices.resize(dag_.vertex_offsets.back());
  dag_.cluster_triangles.resize(3 * size_t{dag_.triangle_offsets.back()});
  parallel_for(members_.size(), 128, [&](size_t i) {
    const uint32_t c = members_[i];
    const auto vertices = pending.cluster_vertices(c);
    const auto corners = pending.cluster_corners(c);
    clusters[first + i] = {kNone,
                           pending.generating_group[c],
                           pending.material[c],
                           static_cast<uint32_t>(vertices.size()),
                           static_cast<uint32_t>(corners.size() / 3),
                           pending.boxes[c]};
    std::ranges::copy(vertices, dag_.cluster_vertices.begin() + dag_.vertex_offsets[first + i]);
    std::ranges::copy(
        corners, dag_.cluster_triangles.begin() + 3 * size_t{dag_.triangle_offsets[first + i]});
  });
  members_.clear();
}

void count_group(SimplifyMethod method, LimitingFactor factor, Report& report) {
  const auto row = static_cast<size_t>(method);
  ++report.groups_by_method[row];
  ++report.groups_by_limiting_factor[row][static_cast<size_t>(factor)];
}

void keep_vertex_materials(std::span<const uint32_t> materials, Mesh& mesh) {
  const size_t width = extra_width(mesh.extras), count = mesh.positions.size();
  std::vector<float> values((width + 1) * count);
  for (size_t v = 0; v < count; ++v) {
    std::copy_n(mesh.extra_values.begin() + width * v, width, values.begin() + (width + 1) * v);
    values[(width + 1) * v + width] = static_cast<float>(materials[v]);
  }
  mesh.extra_values = std::move(values);
  mesh.extras.push_back({ExtraKind::kMaterial, 0});
}

}  // namespace umbel::lod
