// A page: the geometry of one group's clusters, readable by itself. docs/format.md has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "asset/format.hpp"
#include "umbel/lod.hpp"

namespace umbel::asset {

inline constexpr uint64_t kPageHeaderBytes = 16, kClusterEntryBytes = 16;
inline constexpr uint32_t kMaxLocalVertices = 256;  // triangles have 8-bit local indices

struct PageHeader {
  uint32_t group;
  Range clusters;
  uint32_t attributes;
};

/// Where a cluster's data is in its page.
struct ClusterEntry {
  uint32_t offset, vertex_count, triangle_count, material;
};

/// Size of the page of `group`, and the page. The DAG has been checked by the writer; throws
/// kInvalidArgument if the page would be too large for its 32-bit offsets.
uint64_t page_bytes(const lod::Dag& dag, uint32_t attributes, uint32_t group);
void encode_page(const lod::Dag& dag, uint32_t attributes, uint32_t group,
                 std::span<std::byte> page);

/// Bytes of a cluster's data; at most 256 vertices are possible.
uint64_t cluster_bytes(uint32_t attributes, uint64_t vertices, uint64_t triangles);

/// Decodes `kPageHeaderBytes`. Throws kCorrupt if there are fewer.
PageHeader decode_page_header(std::span<const std::byte> bytes);
/// Decodes `kClusterEntryBytes`. Throws kCorrupt if what it names is not inside the page.
ClusterEntry decode_cluster_entry(std::span<const std::byte> entry, uint32_t attributes,
                                  uint64_t size_of_page);
/// Decodes a cluster's data. Throws kCorrupt if a local index is out of range.
lod::ClusterGeometry decode_cluster(std::span<const std::byte> data, uint32_t attributes,
                                    const ClusterEntry& entry);

}  // namespace umbel::asset
