// Levels of detail by meshoptimizer's clusterlod.h, for `umbel bench lod`.
#include <nanobind/stl/vector.h>

#include "bind.hpp"
#include "peers.hpp"
#include "timed.hpp"
#include "umbel/lod.hpp"

#ifdef UMBEL_HAS_CLUSTERLOD
#include "meshoptimizer.h"
#ifndef __clang_analyzer__  // it is not ours to analyse
#define CLUSTERLOD_IMPLEMENTATION
#endif
#include "clusterlod.h"
#endif

namespace umbel::python {
namespace {

#ifdef UMBEL_HAS_CLUSTERLOD

/// What clusterlod.h hands out, as far as cuts need it.
struct PeerDag {
  lod::Tables tables;
  std::vector<size_t> offsets{0};
  std::vector<uint32_t> indices;

  int add(const clodGroup& group, const clodCluster* clusters, size_t count) {
    const auto g = static_cast<uint32_t>(tables.groups.size());
    lod::Group entry{};
    entry.clusters = {static_cast<uint32_t>(tables.clusters.size()), static_cast<uint32_t>(count)};
    entry.error = group.simplified.error == std::numeric_limits<float>::max()
                      ? std::numeric_limits<float>::infinity()
                      : group.simplified.error;
    tables.groups.push_back(entry);
    for (size_t i = 0; i < count; ++i) {
      lod::Cluster c{};
      c.group = g;
      c.generating_group =
          clusters[i].refined < 0 ? kNone : static_cast<uint32_t>(clusters[i].refined);
      c.triangle_count = static_cast<uint32_t>(clusters[i].index_count / 3);
      tables.clusters.push_back(c);
      indices.insert(indices.end(), clusters[i].indices,
                     clusters[i].indices + clusters[i].index_count);
      offsets.push_back(indices.size());
    }
    return static_cast<int>(g);
  }
};

PeerDag build_peer(const MeshView& view, std::span<const float> attributes,
                   std::span<const float> weights, bool ray_tracing) {
  clodMesh mesh = {};
  mesh.indices = view.triangles.empty() ? nullptr : view.triangles[0].data();
  mesh.index_count = view.triangles.size() * 3;
  mesh.vertex_count = view.positions.size();
  mesh.vertex_positions = view.positions.empty() ? nullptr : &view.positions[0].x;
  mesh.vertex_positions_stride = sizeof(Vec3);
  mesh.vertex_attributes = attributes.data();
  mesh.vertex_attributes_stride = weights.size() * sizeof(float);
  mesh.attribute_weights = weights.data();
  mesh.attribute_count = weights.size();
  PeerDag dag;
  clodBuild(ray_tracing ? clodDefaultConfigRT(128) : clodDefaultConfig(128), mesh,
            [&](clodGroup group, const clodCluster* clusters, size_t count) {
              return dag.add(group, clusters, count);
            });
  return dag;
}

using Cuts = nb::typed<nb::tuple, nb::typed<nb::list, Array<uint32_t>>, double>;

Cuts clusterlod_cuts(
    const MeshArrays& mesh,
    const nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>& attributes,
    const Flat<float>& weights, const std::vector<uint64_t>& budgets, bool ray_tracing) {
  PeerDag dag;
  double seconds = 0;
  run(nb::none(), 1, [&](const BuildOptions& options) {
    validate(mesh.view(), options);
    const double start = thread_seconds();
    dag = build_peer(mesh.view(), {attributes.data(), attributes.size()},
                     {weights.data(), weights.size()}, ray_tracing);
    seconds = thread_seconds() - start;
    return 0;
  });
  nb::list cuts;
  for (const uint64_t budget : budgets) {
    const float error = lod::error_for_triangles(dag.tables, budget);
    std::vector<Triangle> triangles;
    for (const uint32_t c : lod::select(dag.tables, lod::view_error(error)))
      for (size_t i = dag.offsets[c]; i < dag.offsets[c + 1]; i += 3)
        triangles.push_back({dag.indices[i], dag.indices[i + 1], dag.indices[i + 2]});
    cuts.append(take<uint32_t>(std::move(triangles)));
  }
  return nb::make_tuple(cuts, seconds);
}

#endif

}  // namespace

void bind_clusterlod(nb::module_& module) {
#ifdef UMBEL_HAS_CLUSTERLOD
  module.def("clusterlod_cuts", &clusterlod_cuts, "mesh"_a, "attributes"_a, "weights"_a,
             "budgets"_a, "ray_tracing"_a = false,
             "Triangles of the cut with at most so many, for each budget, and seconds.");
  module.attr("has_clusterlod") = true;
#else
  module.attr("has_clusterlod") = false;
#endif
}

}  // namespace umbel::python
