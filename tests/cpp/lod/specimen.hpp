// A right DAG of several levels, and ways to damage it.
#pragma once

#include <gtest/gtest.h>

#include "lod/synthetic_dag.hpp"

namespace umbel::lod::testing {

struct Specimen {
  Mesh mesh;
  Dag dag;

  explicit Specimen(const Mesh& of = shapes::blob(4, 5))
      : mesh(of), dag(build(mesh.view(), small_config())) {}

  /// A group in the middle: made of generated clusters, and generating some.
  uint32_t middle_group() const {
    for (const Cluster& cluster : dag.tables.clusters)
      if (cluster.generating_group != kNone &&
          dag.tables.groups[cluster.generating_group].level == 1)
        return cluster.generating_group;
    ADD_FAILURE() << "the specimen has too few levels";
    return 0;
  }
  uint32_t coarse_cluster() const { return dag.tables.groups[middle_group()].clusters.offset; }

  void drop_last_triangle(uint32_t cluster) {
    const uint32_t at = 3 * (dag.triangle_offsets[cluster + 1] - 1);
    dag.cluster_triangles.erase(dag.cluster_triangles.begin() + at,
                                dag.cluster_triangles.begin() + at + 3);
    for (size_t c = cluster + 1; c < dag.triangle_offsets.size(); ++c) --dag.triangle_offsets[c];
    --dag.tables.clusters[cluster].triangle_count;
  }

  void turn_over(uint32_t cluster) {
    const size_t at = size_t{3} * dag.triangle_offsets[cluster];
    std::swap(dag.cluster_triangles[at], dag.cluster_triangles[at + 1]);
  }

  /// Its own copy of a vertex, so that no other cluster's moves.
  void move_vertex(uint32_t cluster, float by) {
    Vec3 moved = dag.vertices.positions[dag.cluster_vertices[dag.vertex_offsets[cluster]]];
    moved.x += by;
    dag.cluster_vertices[dag.vertex_offsets[cluster]] =
        static_cast<uint32_t>(dag.vertices.positions.size());
    dag.vertices.positions.push_back(moved);
  }

  /// A closed pair of triangles, which keeps every border: only over-sharing tells.
  void add_pair(uint32_t c) {
    dag.config.max_triangles = 34;  // so that no limit is in the way
    const size_t first = size_t{3} * dag.triangle_offsets[c];
    const uint8_t x = dag.cluster_triangles[first], y = dag.cluster_triangles[first + 1],
                  z = dag.cluster_triangles[first + 2];
    const uint8_t pair[] = {x, y, z, y, x, z};
    dag.cluster_triangles.insert(dag.cluster_triangles.begin() + first, pair, pair + 6);
    for (size_t i = c + 1; i < dag.triangle_offsets.size(); ++i) dag.triangle_offsets[i] += 2;
    dag.tables.clusters[c].triangle_count += 2;
  }

  void rebuild_hierarchy() { dag.tables.nodes = build_hierarchy(dag.tables); }
};

}  // namespace umbel::lod::testing
