// A group's chunk of a page: references to the groups that its clusters were made from, the
// clusters' records, and their coded geometry. docs/format.md has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "asset/codec/vertex_codec.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

inline constexpr uint64_t kReferenceBytes = 32, kComponentBytes = 8;
/// Clusters name the group that they were made from in 16 bits, one value of which is none.
inline constexpr uint32_t kMaxReferences = 0xffff;
inline constexpr uint64_t kChunkAlignment = 8;

/// What the chunks of all groups of a mesh depend on.
struct ChunkFormat {
  const VertexFormat& vertices;
  const Aabb& bounds;           ///< of all clusters of the mesh
  uint32_t first_material = 0;  ///< added to its material numbers
};

/// A group and its clusters, wherever they are kept.
struct GroupView {
  uint32_t number;  ///< for errors
  std::span<const lod::Cluster> clusters;
  std::span<const uint32_t> vertex_offsets;    ///< clusters + 1, into `cluster_vertices`
  std::span<const uint32_t> triangle_offsets;  ///< clusters + 1, in triangles
  std::span<const uint32_t> cluster_vertices;  ///< of `vertices`
  std::span<const uint8_t> cluster_triangles;  ///< 3 a triangle
  const Mesh& vertices;
};
GroupView group_of(const lod::Dag& dag, uint32_t group);

/// The distinct groups that a group's clusters were made from, in the order in which they occur.
std::vector<uint32_t> children_of(std::span<const lod::Cluster> clusters);
/// Throws kInvalidArgument for more than kMaxReferences.
void check_references(uint32_t group, size_t references);

/// The chunk of a group, a multiple of kChunkAlignment long. Of its references it has the groups
/// alone, until the writer knows their pages and calls write_reference. The group has been checked.
std::vector<std::byte> encode_chunk(const ChunkFormat& format, const GroupView& group,
                                    std::span<const uint32_t> children);
void write_reference(std::span<std::byte> chunk, size_t index, const GroupRef& reference);
uint32_t referred_group(std::span<const std::byte> chunk, size_t index);

/// A chunk without its clusters' data.
struct ChunkTables {
  std::vector<GroupRef> children;
  std::vector<ComponentRange> ranges;
  std::vector<lod::Cluster> clusters;  ///< `group` is not set
  std::vector<uint32_t> ends;          ///< of each cluster's data, in the chunk
  uint32_t first_data;                 ///< where the first cluster's data begin
  uint32_t version;                    ///< of the file format, which its data have
};

/// Of a file of the format's version 3 or 4. Throws kCorrupt if the chunk is too short or holds
/// impossible values.
ChunkTables decode_tables(const VertexFormat& format, const Aabb& bounds, uint32_t clusters,
                          uint32_t references, std::span<const std::byte> chunk, uint32_t version);

/// Decodes the first `count` clusters of a chunk: each may share vertices with those before it.
/// Throws kCorrupt if the bits do not decode to their vertices and triangles.
std::vector<lod::ClusterGeometry> decode_clusters(const VertexFormat& format,
                                                  const ChunkTables& tables,
                                                  std::span<const std::byte> chunk, size_t count);

}  // namespace umbel::asset
