// Checks of a file header before anything else of the file is read.
#pragma once

#include "asset/file/format.hpp"

namespace umbel::asset {

/// Whether [offset, offset + bytes) lies within [begin, end).
inline bool inside(uint64_t offset, uint64_t bytes, uint64_t begin, uint64_t end) {
  return offset >= begin && offset <= end && bytes <= end - offset;
}

/// Throws kCorrupt for ranges outside their tables, pages or files outside the file, instances of
/// no mesh, and transforms or an origin that are not finite.
void check_header(const FileHeader& header);

/// The same for some entries of the table of pages, numbered from `first` on, none of which may
/// begin before `earliest`.
void check_pages(const AssetInfo& info, std::span<const PageEntry> pages, uint32_t first,
                 uint64_t earliest);

}  // namespace umbel::asset
