// A small file, and changes of it under right checksums.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "asset/scratch.hpp"
#include "asset/synthetic_dag.hpp"
#include "base/hash.hpp"
#include "umbel/asset.hpp"

namespace umbel::testing {

/// `origin` and `scene` add sections behind the others.
inline std::vector<char> small_asset(const Scratch& scratch, Vec3d origin = {},
                                     const std::string& scene = "") {
  const lod::Dag sphere = synthetic_dag(shapes::sphere(1), {8, 2});
  const lod::Dag fan = synthetic_dag(shapes::fan(5));
  AssetContents contents;
  contents.meshes = {&sphere, &fan};
  contents.instances = {{1}, {0}, {1}};
  contents.metadata = "{\"a\": 1}";
  contents.files = {{std::byte{1}, std::byte{2}, std::byte{3}}};
  contents.origin = origin;
  contents.scene = scene;
  AssetConfig config;
  config.page_bytes = 4096;
  write_asset(scratch / "whole.umbel", contents, {}, config);
  return read_bytes(scratch / "whole.umbel");
}

/// Opens the asset and reads all of it; the code of the error, or nothing if all is well.
inline std::optional<ErrorCode> failure_of(const std::filesystem::path& path) {
  try {
    const Asset asset(path);
    for (uint32_t m = 0; m < asset.meshes().size(); ++m)
      for (uint32_t c = 0; c < asset.tables(m).clusters.size(); ++c) asset.geometry(c, m);
    for (uint32_t p = 0; p < asset.info().pages; ++p)
      if (!asset.page_is_whole(p)) return ErrorCode::kCorrupt;
    for (uint32_t f = 0; f < asset.files(); ++f) asset.file(f);
  } catch (const Error& error) {
    EXPECT_GT(std::string(error.what()).size(), 10u);
    return error.code();
  }
  return std::nullopt;
}

inline uint64_t get(const std::vector<char>& bytes, size_t at, size_t size) {
  uint64_t value = 0;
  for (size_t i = 0; i < size; ++i)
    value |= uint64_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
  return value;
}

inline void put(std::vector<char>& bytes, size_t at, size_t size, uint64_t value) {
  for (size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<char>(value >> (8 * i));
}

inline constexpr size_t kHeaderBytes = 128, kSectionBytes = 40, kSections = 10;
inline constexpr size_t kFileSection = 7, kPageSection = 8, kNodeSection = 9;

/// Where a section's entry is in the table.
inline size_t entry_of(const std::vector<char>& bytes, size_t section) {
  return get(bytes, 12, 4) + section * kSectionBytes;
}

inline void repair(std::vector<char>& bytes, size_t checksum_at, size_t offset, size_t size) {
  if (offset <= bytes.size() && size <= bytes.size() - offset)
    put(bytes, checksum_at, 8, xxh64(bytes.data() + offset, size));
}

/// Of a table whose elements have an offset, a size of `size_bytes` bytes, and end in a checksum.
inline void repair_elements(std::vector<char>& bytes, size_t section, size_t size_bytes) {
  const size_t entry = entry_of(bytes, section);
  const size_t table = get(bytes, entry + 8, 8), count = get(bytes, entry + 24, 8);
  const size_t stride = get(bytes, entry + 4, 4);
  if (stride < 24 || table > bytes.size() || count > (bytes.size() - table) / stride) return;
  for (size_t at = table; at < table + stride * count; at += stride)
    repair(bytes, at + 16, get(bytes, at, 8), get(bytes, at + 8, size_bytes));
}

inline void repair_checksums(std::vector<char>& bytes) {
  const size_t header = get(bytes, 12, 4);
  if (header < kHeaderBytes || header + kSections * kSectionBytes > bytes.size()) return;
  repair_elements(bytes, kPageSection, 4);
  repair_elements(bytes, kFileSection, 8);
  const size_t sections = std::min<size_t>(get(bytes, 40, 4), kSections + 2);
  for (size_t section = 0; section < sections; ++section) {
    const size_t entry = entry_of(bytes, section);
    repair(bytes, entry + 32, get(bytes, entry + 8, 8), get(bytes, entry + 16, 8));
  }
  const size_t header_end = get(bytes, 24, 8);
  if (header_end >= header) repair(bytes, 32, header, header_end - header);
  put(bytes, header - 8, 8, xxh64(bytes.data(), header - 8));
}

}  // namespace umbel::testing
