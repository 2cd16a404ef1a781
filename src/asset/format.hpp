// The fixed part of a .umbel file, its head: header, section table and tables. docs/format.md
// has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "asset/vertex_codec.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

inline constexpr uint16_t kVersionMajor = 2, kVersionMinor = 0;
inline constexpr uint64_t kPageAlignment = 64;

struct PageEntry {
  uint64_t offset;  // from the start of the file, a multiple of kPageAlignment
  uint64_t bytes;
  uint64_t checksum;
  uint32_t group;
};

struct Head {
  AssetInfo info;
  VertexFormat format;
  lod::Tables tables;
  std::vector<PageEntry> pages;  // in file order
};

/// Says in `info` what attributes there are, and how they are stored.
void describe_format(const VertexFormat& format, AssetInfo& info);

/// Size of the head, and so where the first page begins.
uint64_t head_bytes(const Head& head);
std::vector<std::byte> encode_head(const Head& head);

/// Bytes that must be read to know how many to read for decode_head: kPrologueBytes, then what
/// header_bytes_in and head_bytes_in say. All throw kCorrupt or kUnsupported.
inline constexpr uint64_t kPrologueBytes = 16;
uint64_t header_bytes_in(std::span<const std::byte> prologue);
uint64_t head_bytes_in(std::span<const std::byte> header, uint64_t file_bytes);
Head decode_head(std::span<const std::byte> head);

}  // namespace umbel::asset
