// The tree of instances as bytes. docs/format.md has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "umbel/asset.hpp"

namespace umbel::asset {

inline constexpr uint64_t kInstanceNodeBytes = 64;

/// Where a node's page is, from the start of the section of pages.
struct PlacementPage {
  uint64_t offset;
  uint32_t bytes;
  uint64_t checksum;
};

struct StoredInstanceTree {
  std::vector<InstanceNode> nodes;
  std::vector<PlacementPage> pages;  ///< one a node
};

std::vector<std::byte> encode_placements(uint32_t node, std::span<const Instance> placements);
/// Throws kCorrupt for a page of another node or number of placements, for a transform that is not
/// finite and for a mesh that is not there.
std::vector<Instance> decode_placements(std::span<const std::byte> page, uint32_t node,
                                        uint32_t count, size_t meshes);

std::vector<std::byte> encode_instance_nodes(const StoredInstanceTree& tree);
/// Throws kCorrupt for what is no tree breadth first, and for pages that are outside `page_bytes`.
StoredInstanceTree decode_instance_nodes(std::span<const std::byte> bytes, uint64_t count,
                                         uint32_t element_bytes, uint64_t page_bytes,
                                         size_t top_instances);

}  // namespace umbel::asset
