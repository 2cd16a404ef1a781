// DAGs made without simplification, so that the asset's tests depend on nothing but its folder:
// a shape cut into runs of triangles, groups of consecutive clusters, and one root group whose
// clusters repeat the finest level.
#pragma once

#include <limits>
#include <map>

#include "base/math.hpp"
#include "umbel/lod.hpp"

namespace umbel::testing {

struct DagShape {
  uint32_t triangles_in_cluster = 32;
  uint32_t clusters_in_group = 4;
};

inline void append_cluster(lod::Dag& dag, const Mesh& mesh, size_t begin, size_t end,
                           uint32_t group, uint32_t generating_group) {
  std::map<uint32_t, uint8_t> local;
  lod::Cluster cluster{group, generating_group, 0, 0, static_cast<uint32_t>(end - begin), {}};
  for (size_t t = begin; t < end; ++t)
    for (uint32_t v : mesh.triangles[t]) {
      const auto [at, is_new] = local.insert({v, static_cast<uint8_t>(local.size())});
      if (is_new) dag.cluster_vertices.push_back(v);
      dag.cluster_triangles.push_back(at->second);
      extend(cluster.box, mesh.positions[v]);
    }
  cluster.vertex_count = static_cast<uint32_t>(local.size());
  dag.vertex_offsets.push_back(static_cast<uint32_t>(dag.cluster_vertices.size()));
  dag.triangle_offsets.push_back(static_cast<uint32_t>(dag.cluster_triangles.size() / 3));
  dag.tables.clusters.push_back(cluster);
}

inline void append_leaf(lod::Dag& dag, uint32_t group) {
  const lod::Group& g = dag.tables.groups[group];
  dag.tables.nodes.push_back({g.sphere, g.error, group, {0, 0}});
}

inline lod::Dag synthetic_dag(const Mesh& mesh, const DagShape& shape = {}) {
  lod::Dag dag;
  dag.vertices = mesh;
  dag.vertices.triangles.clear();
  dag.vertices.materials.clear();
  dag.vertex_offsets = dag.triangle_offsets = {0};
  dag.source_digest = triangle_set_digest(mesh.view());
  dag.report.input_triangles = mesh.triangles.size();
  dag.report.input_vertices = mesh.positions.size();
  if (mesh.triangles.empty()) return dag;

  const size_t count = mesh.triangles.size(), run = shape.triangles_in_cluster;
  const auto clusters = static_cast<uint32_t>((count + run - 1) / run);
  const uint32_t groups = (clusters + shape.clusters_in_group - 1) / shape.clusters_in_group;
  const Aabb box = bounds(mesh.view());
  const Sphere sphere{center(box), length(box.max - box.min)};
  lod::Tables& tables = dag.tables;
  tables.levels = {{0, groups}, {groups, 1}};
  for (uint32_t g = 0; g < groups; ++g) {
    const uint32_t first = g * shape.clusters_in_group;
    const Range range{first, std::min(shape.clusters_in_group, clusters - first)};
    tables.groups.push_back({range, 0, lod::SimplifyMethod::kRegular, sphere, 0.01f});
  }
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  tables.groups.push_back({{clusters, clusters}, 1, lod::SimplifyMethod::kRoot, sphere, kInfinity});
  for (uint32_t copy = 0; copy < 2; ++copy)
    for (uint32_t c = 0; c < clusters; ++c) {
      const uint32_t group = c / shape.clusters_in_group;
      append_cluster(dag, mesh, c * run, std::min(c * run + run, count), copy == 0 ? group : groups,
                     copy == 0 ? kNone : group);
    }
  tables.nodes.push_back({sphere, kInfinity, kNone, {1, 2}});
  append_leaf(dag, groups);
  tables.nodes.push_back({sphere, 0.01f, kNone, {3, groups}});
  for (uint32_t g = 0; g < groups; ++g) append_leaf(dag, g);
  return dag;
}

/// A mesh with values in every stream, different for every vertex.
inline Mesh with_attributes(Mesh mesh) {
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3 p = mesh.positions[i];
    const float f = static_cast<float>(i);
    mesh.normals.push_back(p);
    mesh.tangents.push_back({p.z, p.x, p.y, i % 2 ? 1.0f : -1.0f});
    mesh.uvs.push_back({f, 1 / (1 + f)});
    mesh.colors.push_back({0.25f, f, p.x, 1});
  }
  return mesh;
}

}  // namespace umbel::testing
