// A page: groups that are read together. docs/format.md has every byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "asset/file/format.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

inline constexpr uint64_t kPageHeaderBytes = 16, kGroupRecordBytes = 64;

/// A group and its encoded chunk.
struct EncodedGroup {
  uint32_t mesh, id;
  lod::Group group;
  uint32_t parents, references;
  std::vector<std::byte> chunk;
};

/// A multiple of kPageAlignment.
uint64_t page_bytes(std::span<const EncodedGroup> groups);
std::vector<std::byte> encode_page(uint32_t index, std::span<const EncodedGroup> groups);

/// Decodes a page's groups, without their geometry, and takes its bytes. `formats` are the meshes',
/// `expected` is how many groups the page must have. Throws kCorrupt for impossible values.
AssetPage decode_page(const FileHeader& header, std::span<const VertexFormat> formats,
                      uint32_t index, uint32_t expected, std::vector<std::byte> bytes);

/// The size of pages that suits an asset whose groups take so many bytes: larger pages make their
/// table shorter, and reading from a server quicker.
inline uint32_t page_bytes_for(uint64_t bytes) {
  constexpr uint64_t kGigabyte = 1'000'000'000;
  if (bytes > 16 * kGigabyte) return 256 << 10;
  return bytes > 4 * kGigabyte ? 64 << 10 : 40 << 10;
}

}  // namespace umbel::asset
