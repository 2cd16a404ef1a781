// A page: the geometry of one group's clusters, readable by itself. docs/format.md has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "asset/vertex_codec.hpp"
#include "umbel/lod.hpp"

namespace umbel::asset {

inline constexpr uint64_t kPageHeaderBytes = 16, kComponentBytes = 8, kClusterEntryBytes = 8;
/// A cluster's counts are stored in a byte each, less one.
inline constexpr uint32_t kMaxLocal = 256;

struct PageHeader {
  uint32_t group;
  Range clusters;
  std::vector<ComponentRange> ranges;
};

/// Where a cluster's data are in its page.
struct ClusterEntry {
  uint32_t begin, end, vertex_count, triangle_count;
};

/// The page of `group`, a multiple of kPageAlignment long. The DAG has been checked by the writer.
std::vector<std::byte> encode_page(const lod::Dag& dag, const VertexFormat& format, uint32_t group);

/// The bytes in front of a page's clusters.
uint64_t page_header_bytes(const VertexFormat& format, uint32_t clusters);
/// Decodes the page's header, without the clusters' entries. Throws kCorrupt if there are fewer
/// bytes, or impossible values.
PageHeader decode_page_header(const VertexFormat& format, std::span<const std::byte> page);
/// The entry of the page's cluster `index` < header.clusters.count; of the page's `page_bytes`,
/// `page` needs only what page_header_bytes counts. Throws kCorrupt if its data are not inside.
ClusterEntry decode_cluster_entry(const VertexFormat& format, const PageHeader& header,
                                  std::span<const std::byte> page, uint32_t index,
                                  uint64_t page_bytes);
/// Decodes a cluster from its bytes [begin, end) of the page. Throws kCorrupt if they are not those
/// of its vertices and triangles.
lod::ClusterGeometry decode_cluster(const VertexFormat& format, const PageHeader& header,
                                    const ClusterEntry& entry, std::span<const std::byte> data);

}  // namespace umbel::asset
