// The fixed part of a .umbel file, its head: header, section table and sections. docs/format.md
// has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "asset/codec/vertex_codec.hpp"
#include "base/bytes.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

inline constexpr uint16_t kVersionMajor = 3, kVersionMinor = 2;
inline constexpr uint64_t kPageAlignment = 4096;

struct PageEntry {
  uint64_t offset;  // from the start of the file, a multiple of kPageAlignment
  uint32_t bytes;
  uint32_t groups;
  uint64_t checksum;
};

struct FileEntry {
  uint64_t offset, bytes, checksum;
};

struct MeshEntry {
  AssetMesh mesh;
  Range attributes, levels, roots, nodes;
};

/// The table of nodes, which lies behind the pages.
struct NodeSection {
  uint64_t offset, count;
  uint32_t element_bytes;
  uint64_t checksum;
};

struct Head {
  AssetInfo info;
  std::string materials, scene;
  std::vector<AttributeFormat> attributes;
  std::vector<MeshEntry> meshes;
  std::vector<Range> levels;
  std::vector<GroupRef> roots;
  std::vector<Instance> instances;
  std::vector<FileEntry> files;
  std::vector<PageEntry> pages;  // in file order
  NodeSection nodes;
};

/// The attributes of a mesh.
VertexFormat format_of(const Head& head, const MeshEntry& mesh);
/// Says in `info` what attributes there are, and how they are stored.
void describe_format(const VertexFormat& format, AssetInfo& info);

inline constexpr uint64_t kNodeBytes = 32;
std::vector<std::byte> encode_nodes(std::span<const lod::Node> nodes);
/// Throws kCorrupt if there are fewer bytes.
std::vector<lod::Node> decode_nodes(std::span<const std::byte> bytes, uint64_t count,
                                    uint32_t element_bytes);

/// Size of the head, a multiple of kPageAlignment: where the first page begins.
uint64_t head_bytes(const Head& head);
std::vector<std::byte> encode_head(const Head& head);

/// Bytes that must be read to know how many to read for decode_head: kPrologueBytes, then what
/// header_bytes_in and head_bytes_in say. All throw kCorrupt or kUnsupported.
inline constexpr uint64_t kPrologueBytes = 16;
uint64_t header_bytes_in(std::span<const std::byte> prologue);
uint64_t head_bytes_in(std::span<const std::byte> header, uint64_t file_bytes);
Head decode_head(std::span<const std::byte> head);

}  // namespace umbel::asset
