#include "deform/cluster_structures.hpp"

#include <algorithm>

namespace sample {

namespace {

// Refitted for many frames, and each is small: fast to build.
constexpr VkBuildAccelerationStructureFlagsKHR kFlags =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR |
    VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR;

VkAccelerationStructureGeometryKHR geometry_of(const DeformingClusters& clusters, uint32_t first) {
  const VkAccelerationStructureGeometryTrianglesDataKHR triangles{
      .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR,
      .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
      .vertexData = {.deviceAddress = clusters.positions().address()},
      .vertexStride = 12,
      .maxVertex = clusters.vertices() - 1,
      .indexType = VK_INDEX_TYPE_UINT32,
      .indexData = {.deviceAddress = clusters.triangles().address() + 12 * uint64_t{first}}};
  return {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
          .geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR,
          .geometry = {.triangles = triangles},
          .flags = VK_GEOMETRY_OPAQUE_BIT_KHR};
}

}  // namespace

void ClusterStructures::follow(DeformingClusters& clusters) {
  const std::span<const uint32_t> offsets = clusters.offsets(), kept = clusters.kept();
  std::vector<StructureInput> inputs(clusters.count());
  for (uint32_t c = 0; c < clusters.count(); ++c) {
    inputs[c].geometries = {geometry_of(clusters, offsets[c])};
    inputs[c].ranges = {{.primitiveCount = offsets[c + 1] - offsets[c]}};
    if (c < kept.size()) inputs[c].refitted = structures_[kept[c]];
  }
  built_ = clusters.count() - static_cast<uint32_t>(kept.size());
  const StructureBuilds builds(device_, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, inputs,
                               kFlags);
  device_.run(
      [&](VkCommandBuffer commands) {
        builds.record(commands);
        wait_for_writes(commands);
      },
      clusters.ready());
  structures_ = builds.structures();
}

void ClusterStructures::build_scene() {
  std::vector<VkAccelerationStructureInstanceKHR> instances;
  for (uint32_t c = 0; c < structures_.size(); ++c) {
    VkAccelerationStructureInstanceKHR& instance = instances.emplace_back();
    for (int k = 0; k < 3; ++k) instance.transform.matrix[k][k] = 1;
    instance.instanceCustomIndex = c & 0xffffff;
    instance.mask = 0xff;
    instance.accelerationStructureReference = structures_[c]->address();
  }
  const uint64_t bytes = instances.size() * sizeof instances[0];
  if (instances_ == nullptr || instances_->bytes() < bytes) {
    instances_ = std::make_unique<Buffer>(device_, bytes * 3 / 2, Place::kHost);
  }
  std::copy(instances.begin(), instances.end(),
            instances_->mapped<VkAccelerationStructureInstanceKHR>().begin());
  const VkAccelerationStructureGeometryInstancesDataKHR data{
      .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR,
      .data = {.deviceAddress = instances_->address()}};
  const StructureInput input{
      .geometries = {{.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
                      .geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR,
                      .geometry = {.instances = data},
                      .flags = VK_GEOMETRY_OPAQUE_BIT_KHR}},
      .ranges = {{.primitiveCount = static_cast<uint32_t>(instances.size())}}};
  const StructureBuilds builds(device_, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR,
                               std::span(&input, 1));
  device_.run([&](VkCommandBuffer commands) {
    builds.record(commands);
    wait_for_writes(commands);
  });
  scene_ = builds.structures()[0];
}

uint64_t ClusterStructures::bytes() const {
  uint64_t sum = scene_ == nullptr ? 0 : scene_->bytes();
  for (const auto& structure : structures_) sum += structure->bytes();
  return sum;
}

}  // namespace sample
