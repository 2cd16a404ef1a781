#include "geometry_groups.hpp"

#include "acceleration.hpp"

namespace sample {

namespace {

VkAccelerationStructureGeometryKHR geometry_of(const umbel::lod::Cluster& cluster,
                                               VkDeviceAddress words) {
  const VkAccelerationStructureGeometryTrianglesDataKHR triangles{
      .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR,
      .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
      .vertexData = {.deviceAddress = words},
      .vertexStride = 16,
      .maxVertex = cluster.vertex_count - 1,
      .indexType = VK_INDEX_TYPE_UINT16,
      .indexData = {.deviceAddress = words + 16 * uint64_t{cluster.vertex_count}}};
  return {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
          .geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR,
          .geometry = {.triangles = triangles},
          .flags = VK_GEOMETRY_OPAQUE_BIT_KHR};
}

}  // namespace

std::vector<GroupStructure> GeometryGroups::build(std::span<const std::vector<uint32_t>> sets,
                                                  const Tables& tables, const PagePool& pool) {
  std::vector<StructureInput> inputs;
  for (const std::vector<uint32_t>& set : sets) {
    StructureInput& input = inputs.emplace_back();
    for (const uint32_t c : set) {
      const umbel::lod::Cluster& cluster = tables.host().clusters[c];
      input.geometries.push_back(
          geometry_of(cluster, pool.words().address() + 4 * pool.word_of(tables, c)));
      input.ranges.push_back({.primitiveCount = cluster.triangle_count});
    }
  }
  const StructureBuilds builds(device_, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, inputs);
  device_.run([&](VkCommandBuffer commands) {
    builds.record(commands);
    wait_for_writes(commands);
  });
  std::vector<GroupStructure> built;
  for (const auto& structure : builds.structures()) {
    built.push_back({structure->address(), structure->bytes(), structure});
  }
  return built;
}

}  // namespace sample
