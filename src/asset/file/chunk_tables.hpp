// The tables at the start of a group's chunk: the ranges of its components and its clusters'
// records. docs/format.md has every bit, and every byte of version 3.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "asset/codec/vertex_codec.hpp"

namespace umbel::asset {

/// What a chunk's tables say of a cluster.
struct ClusterRecord {
  uint32_t bytes;  ///< of its data
  uint32_t vertices, triangles;
  uint32_t reference;  ///< to the group that it was made from, or kNone
  uint32_t material;
  std::array<uint16_t, 6> box;  ///< in steps of the mesh's
};

struct PackedTables {
  std::vector<ComponentRange> ranges;
  std::vector<ClusterRecord> clusters;
  uint64_t bytes = 0;  ///< that they take in the chunk
};

/// Appends them. `references` is how many the chunk has.
void write_tables(const PackedTables& tables, uint32_t references, std::vector<std::byte>& out);

/// How many of each the group has, as is known before.
struct TableCounts {
  uint32_t components, clusters, references;
};
/// `chunk` is the group's from behind its references on. Throws kCorrupt if it is too short or
/// holds impossible values.
PackedTables read_tables(std::span<const std::byte> chunk, const TableCounts& counts);
/// Those of version 3.
PackedTables read_tables_3(std::span<const std::byte> chunk, const TableCounts& counts);

}  // namespace umbel::asset
