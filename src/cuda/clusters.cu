// The functions of umbel/cuda_clusters.hpp: the algorithms of cluster/frame on an executor.

#include "cluster/frame/area_growth.hpp"
#include "cluster/frame/build_frame.hpp"
#include "cluster/frame/rebuild_worst.hpp"
#include "cuda/device_mesh.hpp"
#include "cuda/run.hpp"
#include "umbel/cuda_clusters.hpp"

namespace umbel::cuda {
namespace {

cluster::FrameClusters view(const DeviceClusters& c) {
  return {c.items, reinterpret_cast<Triangle*>(c.indices), c.offsets, c.boxes, c.count};
}
cluster::AreaShares view(const DeviceAreaGrowth& d) { return {d.now, d.at_build, d.total}; }

}  // namespace

void build_frame_clusters(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                          const FrameClusterConfig& config, const DeviceClusters& out,
                          Stream stream) {
  const auto checked = cluster::CheckedFrameConfig::of(config, mesh.triangles);
  const cluster::FrameMesh input{positions_of(mesh),
                                 reinterpret_cast<const Triangle*>(mesh.indices), mesh.items,
                                 mesh.triangles};
  run(scratch, scratch_bytes, stream, mesh.positions,
      [&](auto& exec) { cluster::build_frame(exec, input, checked, view(out)); });
}

void measure_frame_clusters(void* scratch, size_t& scratch_bytes, uint32_t triangles,
                            const FrameClusterConfig& config, const DeviceClusters& clusters,
                            const DeviceAreaGrowth& growth, bool is_new, Stream stream) {
  const uint32_t most = cluster::CheckedFrameConfig::of(config, triangles).most_clusters(triangles);
  run(scratch, scratch_bytes, stream, clusters.offsets, [&](auto& exec) {
    cluster::measure_area_growth(exec, view(clusters), most, view(growth), is_new);
  });
}

void refit_frame_clusters(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                          const FrameClusterConfig& config, const DeviceClusters& clusters,
                          const DeviceAreaGrowth& growth, Stream stream) {
  const uint32_t most =
      cluster::CheckedFrameConfig::of(config, mesh.triangles).most_clusters(mesh.triangles);
  const cluster::FrameMesh ordered{positions_of(mesh),
                                   reinterpret_cast<const Triangle*>(clusters.indices), nullptr,
                                   mesh.triangles};
  run(scratch, scratch_bytes, stream, mesh.positions, [&](auto& exec) {
    exec.for_each_team(most, cluster::RefitCluster{ordered, view(clusters)});
    cluster::measure_area_growth(exec, view(clusters), most, view(growth), false);
  });
}

void rebuild_worst_frame_clusters(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                                  const FrameClusterConfig& config, uint32_t budget,
                                  const DeviceClusters& clusters, const DeviceAreaGrowth& growth,
                                  const DeviceClusters& out, const DeviceAreaGrowth& out_growth,
                                  Stream stream) {
  const auto checked = cluster::CheckedFrameConfig::of(config, mesh.triangles);
  if (checked.max_vertices)
    throw Error(ErrorCode::kInvalidArgument,
                "with max_vertices, only all clusters together can be rebuilt");
  const cluster::Positions positions = positions_of(mesh);
  run(scratch, scratch_bytes, stream, mesh.positions, [&](auto& exec) {
    cluster::rebuild_worst(exec, positions, checked, view(clusters), view(growth), mesh.triangles,
                           budget, view(out), view(out_growth));
  });
}

void list_frame_vertices(void* scratch, size_t& scratch_bytes, uint32_t triangles,
                         const FrameClusterConfig& config, const DeviceClusters& clusters,
                         const DeviceVertexLists& out, Stream stream) {
  const auto checked = cluster::CheckedFrameConfig::of(config, triangles);
  if (!checked.max_vertices && 3 * checked.block.max_items > cluster::TeamVertexTable::kMost)
    throw Error(ErrorCode::kInvalidArgument,
                "clusters may have more vertices than a byte can count: set max_vertices");
  run(scratch, scratch_bytes, stream, clusters.offsets, [&](auto& exec) {
    cluster::list_vertices(exec, view(clusters), checked.most_clusters(triangles),
                           {out.offsets, out.vertices, out.corners});
  });
}

}  // namespace umbel::cuda
