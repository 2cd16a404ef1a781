// What the builds of the uniform structures have in common.
#pragma once

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "base/shared_progress.hpp"
#include "bvh/tree/config.hpp"
#include "query/leaf_lists.hpp"
#include "query/ray_kernels.hpp"
#include "uniform/structure_data.hpp"

namespace umbel {

struct GridData;
struct OctreeData;
struct IntervalData;

/// Chooses what answers the queries.
void prepare(GridData& data, Simd simd);
void prepare(OctreeData& data, Simd simd);
void prepare(IntervalData& data, Simd simd);

uniform::Statistics measure(const GridData& data, const bvh::CostModel& cost);
uniform::Statistics measure(const OctreeData& data, const bvh::CostModel& cost);
uniform::Statistics measure(const IntervalData& data, const bvh::CostModel& cost);

/// The statistics that need no look at the nodes.
template <typename Node>
uniform::Statistics sizes_of(const LeafStore& store, const BigVector<Node>& nodes) {
  uniform::Statistics s{};
  s.nodes = static_cast<uint32_t>(nodes.size());
  s.references = store.reference_count;
  s.bytes = nodes.size() * sizeof(Node) + store.leaf_bytes();
  return s;
}

/// Of two sets of ray queries that of the instructions asked for; `avx2` is null where there is
/// none.
inline void set_queries(LeafStore& store, Simd simd, const RayKernels* portable,
                        const RayKernels* avx2, const ShapeKernels* shapes) {
  store.rays = choose_simd(simd) == Simd::kPortable ? portable : avx2;
  if (store.reference_count == 0) store.rays = &kNoRays;
  store.shapes = shapes;
  prepare_scale(store);
}

template <typename Data>
std::unique_ptr<LeafStore> store_without_triangles() {
  auto data = std::make_unique<Data>();
  data->without_triangles = &store_without_triangles<Data>;
  prepare(*data, Simd::kAuto);
  return data;
}

constexpr const char* kBuildStage = "building";

/// Progress of the threads that make the nodes, `work` in all.
inline SharedProgress node_progress(Progress& progress, uint64_t work) {
  return {progress, kBuildStage, 0, 0.9, work, SharedProgress::OnCancel::kThrow};
}

/// What build(geometry, config, masks, data, progress) makes of the mesh's positions and triangles
/// alone, on options.threads.
template <typename Data, typename Config, typename Build>
std::unique_ptr<LeafStore> build_over(const MeshView& mesh, const Config& config,
                                      std::span<const uint32_t> masks, const BuildOptions& options,
                                      const Build& build) {
  choose_simd(config.simd);
  bvh::check_cost(config.cost);
  check_masks(masks, mesh.triangles.size());
  Progress progress(options);
  progress.report(0, kBuildStage);
  auto data = std::make_unique<Data>();
  data->without_triangles = &store_without_triangles<Data>;
  with_threads(options.threads, [&] {
    MeshView geometry;
    geometry.positions = mesh.positions;
    geometry.triangles = mesh.triangles;
    build(geometry, config, masks, *data, progress);
  });
  progress.report(1, kBuildStage);
  prepare(*data, config.simd);
  data->statistics = measure(*data, config.cost);
  return data;
}

}  // namespace umbel
