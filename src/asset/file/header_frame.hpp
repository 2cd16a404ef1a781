// The frame of the file header: its fixed part and the table of sections. What the sections hold is
// format.cpp's. docs/format.md has every byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "asset/file/format.hpp"

namespace umbel::asset {

enum SectionIndex {
  kMetadata,
  kMaterials,
  kAttributes,
  kMeshes,
  kLevels,
  kRoots,
  kInstances,
  kFiles,
  kPages,
  kNodes,
  kOrigin,
  kScene,
  kPageSlices,
  kNodeSlices,
  kCoarsestErrors,
  kInstanceNodes,
  kInstancePages,
  kCoarseGroups,
  kSectionCount
};

struct Section {
  uint64_t offset, count;
  uint32_t element_bytes;
  uint64_t checksum;
};

using Sections = std::array<Section, kSectionCount>;

/// Slices of a table.
inline uint64_t slices_of(uint64_t entries) {
  return (entries + kSliceEntries - 1) / kSliceEntries;
}

struct Layout {
  Sections sections;
  uint64_t bytes;
  uint64_t opening_bytes;  ///< what comes before a table of pages that has slices; else 0

  /// Whether the file has the section.
  bool has(size_t section) const;
  uint32_t section_count() const;
};
Layout layout_of(const FileHeader& header);
/// The table of the section ORIG.
std::vector<Vec3d> origins_of(const FileHeader& header);

/// Writes the fixed header and the section table of a file header that has all else.
void write_frame(std::span<std::byte> header, const AssetInfo& info, const Layout& layout);

struct FixedHeader {
  AssetInfo info;
  uint64_t bytes, tables_checksum;
  uint64_t opening_bytes, opening_checksum;  ///< of what comes before a table of pages with slices
  uint32_t sections;
};

FixedHeader read_fixed_header(std::span<const std::byte> bytes);
/// Throws kCorrupt for sections that are missing or not where they must be.
Sections read_sections(std::span<const std::byte> header, const FixedHeader& fixed);

}  // namespace umbel::asset
