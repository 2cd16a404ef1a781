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

/// What is written; versions from kOldestMajor on are read.
inline constexpr uint16_t kVersionMajor = 6, kVersionMinor = 0, kOldestMajor = 3;
/// Of pages and the end of the file header: a cache line.
inline constexpr uint64_t kPageAlignment = 64;
constexpr uint64_t page_alignment(uint32_t version) { return version == 3 ? 4096 : kPageAlignment; }

struct PageEntry {
  uint64_t offset;  // from the start of the file, a multiple of kPageAlignment
  uint32_t bytes;
  uint32_t groups;
  uint64_t checksum;
};

/// Tables of pages and of nodes have a checksum for every so many entries, so that they can be read
/// in slices.
inline constexpr uint64_t kSliceEntries = 4096;

struct FileEntry {
  uint64_t offset, bytes, checksum;
};

struct MeshEntry {
  AssetMesh mesh;
  Range attributes{}, levels{}, roots{}, nodes{};
};

/// A table that is not read with the file header: that of nodes, which follows the pages, and that
/// of pages where it has checksums of its slices.
struct TableSection {
  uint64_t offset = 0, count = 0;
  uint32_t element_bytes = 0;
  uint64_t checksum = 0;
  std::vector<uint64_t> slices;  ///< a checksum for every kSliceEntries, or none
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
  std::vector<PageEntry> pages;  // in file order; none if they are read in slices
  /// Whether the table of pages is last in the file header, with checksums of its slices, so that
  /// opening the file need not read it. As the writer decides: see wants_slices.
  bool has_page_slices = false;
  TableSection page_table;  // where the pages are, in a file that was read
  TableSection nodes;
  TableSection coarse;  ///< groups (coarse_groups.hpp); none in small files
  /// Of a tree of instances; none if all are in `instances`.
  std::vector<float> coarsest_errors;  // one a mesh
  TableSection instance_nodes, instance_pages;
};

/// Whether a table of so many entries is long enough to be read in slices.
inline bool wants_slices(uint64_t entries) { return entries > kSliceEntries; }
/// A checksum for every kSliceEntries of a table.
std::vector<uint64_t> slice_checksums(std::span<const std::byte> table, uint64_t element_bytes);

/// The attributes of a mesh.
VertexFormat format_of(const FileHeader& header, const MeshEntry& mesh);
/// Says in `info` what attributes there are, and how they are stored.
void describe_format(const VertexFormat& format, AssetInfo& info);

inline constexpr uint64_t kNodeBytes = 32;
std::vector<std::byte> encode_nodes(std::span<const lod::Node> nodes);
/// Throws kCorrupt if there are fewer bytes.
std::vector<lod::Node> decode_nodes(std::span<const std::byte> bytes, uint64_t count,
                                    uint32_t element_bytes);
std::vector<PageEntry> decode_pages(std::span<const std::byte> bytes, uint64_t count,
                                    uint32_t element_bytes);

/// Size of the file header, a multiple of kPageAlignment: where the first page starts.
uint64_t header_bytes(const FileHeader& header);
std::vector<std::byte> encode_header(const FileHeader& header);

/// To read a file header: read kPrologueBytes, then fixed_header_bytes_in of these, then
/// opening_bytes_in of those: the whole file header, or what comes before the table of pages if
/// that can be read in slices. All throw kCorrupt or kUnsupported.
inline constexpr uint64_t kPrologueBytes = 16;
uint64_t fixed_header_bytes_in(std::span<const std::byte> prologue);
uint64_t opening_bytes_in(std::span<const std::byte> header, uint64_t file_bytes);
FileHeader decode_header(std::span<const std::byte> header);
/// Whether the whole file header has the checksum that its beginning says.
bool header_is_whole(std::span<const std::byte> header);

}  // namespace umbel::asset
