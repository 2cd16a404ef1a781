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
