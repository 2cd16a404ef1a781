#include "cluster_groups.hpp"

#include <algorithm>

#include "geometry_groups.hpp"

namespace sample {

namespace {

VkPhysicalDeviceClusterAccelerationStructurePropertiesNV limits_of(const Device& device) {
  VkPhysicalDeviceClusterAccelerationStructurePropertiesNV limits{
      .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_CLUSTER_ACCELERATION_STRUCTURE_PROPERTIES_NV};
  VkPhysicalDeviceProperties2 all{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
                                  .pNext = &limits};
  vkGetPhysicalDeviceProperties2(device.physical(), &all);
  limits.pNext = nullptr;
  return limits;
}

VkDeviceAddress aligned(VkDeviceAddress address, uint64_t to) {
  return (address + to - 1) / to * to;
}

VkClusterAccelerationStructureBuildTriangleClusterInfoNV info_of(uint32_t number,
                                                                 const umbel::lod::Cluster& cluster,
                                                                 VkDeviceAddress words) {
  VkClusterAccelerationStructureBuildTriangleClusterInfoNV info{};
  info.clusterID = number;
  info.triangleCount = cluster.triangle_count & 0x1ff;
  info.vertexCount = cluster.vertex_count & 0x1ff;
  info.indexType = VK_CLUSTER_ACCELERATION_STRUCTURE_INDEX_FORMAT_16BIT_NV;
  info.baseGeometryIndexAndGeometryFlags.geometryIndex = number & 0xffffff;
  info.baseGeometryIndexAndGeometryFlags.geometryFlags =
      VK_CLUSTER_ACCELERATION_STRUCTURE_GEOMETRY_OPAQUE_BIT_NV;
  info.indexBufferStride = 2;
  info.vertexBufferStride = 16;
  info.indexBuffer = words + 16 * uint64_t{cluster.vertex_count};
  info.vertexBuffer = words;
  return info;
}

VkClusterAccelerationStructureInputInfoNV input_of(VkClusterAccelerationStructureOpTypeNV type,
                                                   size_t count) {
  return {.sType = VK_STRUCTURE_TYPE_CLUSTER_ACCELERATION_STRUCTURE_INPUT_INFO_NV,
          .maxAccelerationStructureCount = static_cast<uint32_t>(count),
          .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
          .opType = type,
          .opMode = VK_CLUSTER_ACCELERATION_STRUCTURE_OP_MODE_IMPLICIT_DESTINATIONS_NV};
}

}  // namespace

std::unique_ptr<GroupBuilder> make_group_builder(const Device& device, const Tables& tables) {
  if (ClusterGroups::fits(device, tables)) return std::make_unique<ClusterGroups>(device, tables);
  return std::make_unique<GeometryGroups>(device);
}

bool ClusterGroups::fits(const Device& device, const Tables& tables) {
  if (!device.cluster_structures()) return false;
  const auto limits = limits_of(device);
  return tables.max_triangles() <= limits.maxTrianglesPerCluster &&
         tables.max_vertices() <= limits.maxVerticesPerCluster &&
         tables.host().clusters.size() <= limits.maxClusterGeometryIndex;
}

ClusterGroups::ClusterGroups(const Device& device, const Tables&)
    : device_(device), limits_(limits_of(device)) {}

// All in one buffer, one behind the other, as the device packs them.
ClusterGroups::Built ClusterGroups::run(const VkClusterAccelerationStructureInputInfoNV& input,
                                        std::span<const std::byte> infos,
                                        uint64_t alignment) const {
  const uint32_t count = input.maxAccelerationStructureCount;
  VkAccelerationStructureBuildSizesInfoKHR needs{
      .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
  vkGetClusterAccelerationStructureBuildSizesNV(device_.handle(), &input, &needs);
  const auto storage = std::make_shared<const Buffer>(
      device_, needs.accelerationStructureSize + alignment, Place::kDevice);
  const uint64_t scratch_alignment = limits_.clusterScratchByteAlignment;
  const Buffer scratch(device_, needs.buildScratchSize + scratch_alignment, Place::kDevice);
  const Buffer addresses(device_, count * sizeof(VkDeviceAddress), Place::kHost);
  const Buffer given(device_, infos.size(), Place::kHost);
  std::copy(infos.begin(), infos.end(), given.mapped<std::byte>().begin());
  const Buffer counted(device_, sizeof count, Place::kHost);
  counted.mapped<uint32_t>()[0] = count;
  const VkClusterAccelerationStructureCommandsInfoNV command{
      .sType = VK_STRUCTURE_TYPE_CLUSTER_ACCELERATION_STRUCTURE_COMMANDS_INFO_NV,
      .input = input,
      .dstImplicitData = aligned(storage->address(), alignment),
      .scratchData = aligned(scratch.address(), scratch_alignment),
      .dstAddressesArray = {addresses.address(), sizeof(VkDeviceAddress),
                            count * sizeof(VkDeviceAddress)},
      .srcInfosArray = {given.address(), infos.size() / count, infos.size()},
      .srcInfosCount = counted.address()};
  device_.run([&](VkCommandBuffer commands) {
    vkCmdBuildClusterAccelerationStructureIndirectNV(commands, &command);
    wait_for_writes(commands);
  });
  const auto found = addresses.mapped<VkDeviceAddress>().first(count);
  return {{found.begin(), found.end()}, storage};
}

std::vector<ClusterGroups::Kept> ClusterGroups::clusters_of(
    std::span<const std::vector<uint32_t>> sets, const Tables& tables, const PagePool& pool) {
  std::erase_if(known_, [](const auto& known) { return known.second.expired(); });
  std::vector<uint32_t> missing;
  uint64_t triangles = 0, vertices = 0;
  for (const std::vector<uint32_t>& set : sets) {
    for (const uint32_t c : set) {
      if (!known_.try_emplace(c).second) continue;
      missing.push_back(c);
      triangles += tables.host().clusters[c].triangle_count;
      vertices += tables.host().clusters[c].vertex_count;
    }
  }
  Kept new_clusters;  // alive until the sets have them
  if (!missing.empty()) {
    std::vector<VkClusterAccelerationStructureBuildTriangleClusterInfoNV> infos;
    for (const uint32_t c : missing) {
      infos.push_back(info_of(c, tables.host().clusters[c],
                              pool.words().address() + 4 * pool.word_of(tables, c)));
    }
    VkClusterAccelerationStructureTriangleClusterInputNV shapes{
        .sType = VK_STRUCTURE_TYPE_CLUSTER_ACCELERATION_STRUCTURE_TRIANGLE_CLUSTER_INPUT_NV,
        .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
        .maxGeometryIndexValue = static_cast<uint32_t>(tables.host().clusters.size()),
        .maxClusterUniqueGeometryCount = 1,
        .maxClusterTriangleCount = tables.max_triangles(),
        .maxClusterVertexCount = tables.max_vertices(),
        .maxTotalTriangleCount = static_cast<uint32_t>(triangles),
        .maxTotalVertexCount = static_cast<uint32_t>(vertices)};
    VkClusterAccelerationStructureInputInfoNV input = input_of(
        VK_CLUSTER_ACCELERATION_STRUCTURE_OP_TYPE_BUILD_TRIANGLE_CLUSTER_NV, missing.size());
    input.opInput.pTriangleClusters = &shapes;
    const Built built = run(input, std::as_bytes(std::span(infos)), limits_.clusterByteAlignment);
    for (size_t i = 0; i < missing.size(); ++i) {
      new_clusters.push_back(
          std::make_shared<const Cluster>(Cluster{built.addresses[i], built.storage}));
      known_[missing[i]] = new_clusters.back();
    }
  }
  std::vector<Kept> of_sets;
  for (const std::vector<uint32_t>& set : sets) {
    Kept& kept = of_sets.emplace_back();
    for (const uint32_t c : set) kept.push_back(known_.at(c).lock());
  }
  return of_sets;
}

std::vector<GroupStructure> ClusterGroups::build(std::span<const std::vector<uint32_t>> sets,
                                                 const Tables& tables, const PagePool& pool) {
  if (sets.empty()) return {};
  const std::vector<Kept> clusters = clusters_of(sets, tables, pool);
  std::vector<VkDeviceAddress> references;
  for (const Kept& kept : clusters) {
    for (const auto& cluster : kept) references.push_back(cluster->address);
  }
  const Buffer listed(device_, references.size() * sizeof references[0], Place::kHost);
  std::copy(references.begin(), references.end(), listed.mapped<VkDeviceAddress>().begin());
  std::vector<VkClusterAccelerationStructureBuildClustersBottomLevelInfoNV> infos;
  uint64_t first = 0;
  size_t most = 0;
  for (const Kept& kept : clusters) {
    infos.push_back({.clusterReferencesCount = static_cast<uint32_t>(kept.size()),
                     .clusterReferencesStride = sizeof(VkDeviceAddress),
                     .clusterReferences = listed.address() + first * sizeof(VkDeviceAddress)});
    first += kept.size();
    most = std::max(most, kept.size());
  }
  VkClusterAccelerationStructureClustersBottomLevelInputNV shapes{
      .sType = VK_STRUCTURE_TYPE_CLUSTER_ACCELERATION_STRUCTURE_CLUSTERS_BOTTOM_LEVEL_INPUT_NV,
      .maxTotalClusterCount = static_cast<uint32_t>(references.size()),
      .maxClusterCountPerAccelerationStructure = static_cast<uint32_t>(most)};
  VkClusterAccelerationStructureInputInfoNV input = input_of(
      VK_CLUSTER_ACCELERATION_STRUCTURE_OP_TYPE_BUILD_CLUSTERS_BOTTOM_LEVEL_NV, sets.size());
  input.opInput.pClustersBottomLevel = &shapes;
  const Built built =
      run(input, std::as_bytes(std::span(infos)), limits_.clusterBottomLevelByteAlignment);
  std::vector<GroupStructure> groups;
  for (size_t i = 0; i < sets.size(); ++i) {
    const auto keeps = std::make_shared<const std::pair<Kept, std::shared_ptr<const Buffer>>>(
        clusters[i], built.storage);
    groups.push_back({built.addresses[i], built.storage->bytes() / sets.size(), keeps});
  }
  return groups;
}

}  // namespace sample
