// The file header of a .umbel file: fixed header, section table and sections. docs/format.md has
// every byte.
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

/// The table of nodes, which follows the pages.
struct NodeSection {
  uint64_t offset, count;
  uint32_t element_bytes;
  uint64_t checksum;
};

struct FileHeader {
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
VertexFormat format_of(const FileHeader& header, const MeshEntry& mesh);
/// Says in `info` what attributes there are, and how they are stored.
void describe_format(const VertexFormat& format, AssetInfo& info);

inline constexpr uint64_t kNodeBytes = 32;
std::vector<std::byte> encode_nodes(std::span<const lod::Node> nodes);
/// Throws kCorrupt if there are fewer bytes.
std::vector<lod::Node> decode_nodes(std::span<const std::byte> bytes, uint64_t count,
                                    uint32_t element_bytes);

/// Size of the file header, a multiple of kPageAlignment: where the first page starts.
uint64_t header_bytes(const FileHeader& header);
std::vector<std::byte> encode_header(const FileHeader& header);

/// To read a file header: read kPrologueBytes, then fixed_header_bytes_in of these, then
/// header_bytes_in of those. All throw kCorrupt or kUnsupported.
inline constexpr uint64_t kPrologueBytes = 16;
uint64_t fixed_header_bytes_in(std::span<const std::byte> prologue);
uint64_t header_bytes_in(std::span<const std::byte> header, uint64_t file_bytes);
FileHeader decode_header(std::span<const std::byte> header);

}  // namespace umbel::asset
