// The part of a page that is one group: what its clusters were made from, what is known of them
// without decoding, and their geometry. docs/format.md has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "asset/codec/vertex_codec.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

inline constexpr uint64_t kReferenceBytes = 32, kComponentBytes = 8, kClusterRecordBytes = 24;
/// Clusters name the group that they were made from in 16 bits, one value of which is none.
inline constexpr uint32_t kMaxReferences = 0xffff;
inline constexpr uint64_t kPartAlignment = 8;

/// A mesh whose groups are encoded, and what their parts need beside it.
struct EncodedMesh {
  const lod::Dag& dag;
  const VertexFormat& format;
  const Aabb& bounds;           ///< of all its clusters
  uint32_t first_material = 0;  ///< added to its material numbers
};

/// The distinct groups that a group's clusters were made from, in the order in which they occur.
std::vector<uint32_t> children_of(const lod::Tables& tables, uint32_t group);

/// The part of `group`, a multiple of kPartAlignment long, its references left zero; the writer
/// fills them in by write_reference once it knows their pages. The DAG has been checked.
std::vector<std::byte> encode_part(const EncodedMesh& mesh, uint32_t group,
                                   std::span<const uint32_t> children);
void write_reference(std::span<std::byte> part, size_t index, const GroupRef& reference);

/// What is in front of a part's bits.
struct PartTables {
  std::vector<GroupRef> children;
  std::vector<ComponentRange> ranges;
  std::vector<lod::Cluster> clusters;  ///< `group` is not set
  std::vector<uint32_t> ends;          ///< of each cluster's data, in the part
  uint32_t first_data;                 ///< where the first cluster's data begin
};

/// Throws kCorrupt if the part ends before what it holds, or holds impossible values.
PartTables decode_tables(const VertexFormat& format, const Aabb& bounds, uint32_t clusters,
                         uint32_t references, std::span<const std::byte> part);

/// Decodes the part's clusters up to the `count`-th: each may lean on those before it. Throws
/// kCorrupt if the bits are not those of their vertices and triangles.
std::vector<lod::ClusterGeometry> decode_clusters(const VertexFormat& format,
                                                  const PartTables& tables,
                                                  std::span<const std::byte> part, size_t count);

}  // namespace umbel::asset
