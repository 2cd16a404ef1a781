#include "builders.hpp"
#include "bvh/compressed/build_compact.hpp"

namespace umbel::cuda {
namespace {

MeshCorners corners_of(const Mesh& mesh) {
  return {{reinterpret_cast<const char*>(mesh.positions.data()), sizeof(Vec3)},
          mesh.triangles.data()};
}

}  // namespace

BuiltBvh build_on_processor(const Mesh& mesh, const DeviceBvhConfig& config) {
  const auto n = static_cast<uint32_t>(mesh.triangles.size());
  const uint32_t references = device_references(n, config);
  BuiltBvh tree;
  tree.nodes.resize(bvh::compact_node_capacity(references));
  tree.triangles.resize(references);
  CpuExec exec;
  build_compact(exec, corners_of(mesh), nullptr, n, config,
                {tree.nodes.data(), tree.triangles.data(), &tree.info}, NoStages{});
  tree.nodes.resize(tree.info.nodes);
  return tree;
}

BuiltBvh build_cluster_bvh_on_processor(const Mesh& mesh, const FrameClusterer& clusters,
                                        const FrameClusterConfig& of_clusters,
                                        const DeviceBvhConfig& config) {
  const auto n = static_cast<uint32_t>(mesh.triangles.size());
  BuiltBvh tree;
  tree.nodes.resize(bvh::compact_node_capacity(n));
  tree.triangles.resize(n);
  const auto count = static_cast<uint32_t>(clusters.count());
  const uint32_t most = max_frame_clusters(n, of_clusters);
  CpuExec exec;
  build_compact(exec,
                {{reinterpret_cast<const char*>(mesh.positions.data()), sizeof(Vec3)},
                 clusters.triangles().data()},
                clusters.items().data(), n, config,
                {tree.nodes.data(), tree.triangles.data(), &tree.info}, NoStages{},
                {clusters.offsets().data(), clusters.boxes().data(), &count, most});
  tree.nodes.resize(tree.info.nodes);
  return tree;
}

BuiltBvh refit_on_processor(BuiltBvh tree, const Mesh& mesh) {
  const auto references = static_cast<uint32_t>(tree.triangles.size());
  tree.nodes.resize(bvh::compact_node_capacity(references));
  CpuExec exec;
  refit_triangles(exec, corners_of(mesh), references,
                  {tree.nodes.data(), tree.triangles.data(), &tree.info});
  tree.nodes.resize(tree.info.nodes);
  return tree;
}

}  // namespace umbel::cuda
