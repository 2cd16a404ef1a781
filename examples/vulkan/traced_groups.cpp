#include "traced_groups.hpp"

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

void TracedGroups::begin() {
  ++frame_;
  built_ = 0;
  shown_.clear();
  clusters_.clear();
}

uint32_t TracedGroups::show(std::span<const uint32_t> clusters) {
  const auto found = entries_.try_emplace({clusters.begin(), clusters.end()}).first;
  Entry& entry = found->second;
  if (entry.frame != frame_) {
    entry.frame = frame_;
    entry.number = static_cast<uint32_t>(shown_.size());
    entry.first = static_cast<uint32_t>(clusters_.size());
    shown_.push_back(found);
    clusters_.insert(clusters_.end(), clusters.begin(), clusters.end());
  }
  return entry.number;
}

void TracedGroups::record(VkCommandBuffer commands, const Tables& tables, const PagePool& pool) {
  std::erase_if(entries_, [&](const auto& entry) { return entry.second.frame != frame_; });
  inputs_.clear();
  std::vector<Entry*> missing;
  for (const Entries::iterator& at : shown_) {
    if (at->second.structure != nullptr) continue;
    missing.push_back(&at->second);
    StructureInput& input = inputs_.emplace_back();
    for (const uint32_t c : at->first) {
      const umbel::lod::Cluster& cluster = tables.host().clusters[c];
      input.geometries.push_back(
          geometry_of(cluster, pool.words().address() + 4 * pool.word_of(tables, c)));
      input.ranges.push_back({.primitiveCount = cluster.triangle_count});
    }
  }
  built_ = static_cast<uint32_t>(missing.size());
  builds_ = std::make_unique<StructureBuilds>(
      device_, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, inputs_);
  for (size_t i = 0; i < missing.size(); ++i) missing[i]->structure = builds_->structures()[i];
  builds_->record(commands);
}

uint64_t TracedGroups::bytes() const {
  uint64_t sum = 0;
  for (const auto& [clusters, entry] : entries_) sum += entry.structure->bytes();
  return sum;
}

}  // namespace sample
