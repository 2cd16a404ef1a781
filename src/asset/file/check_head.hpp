// What must hold of a head before anything else of the file is read.
#pragma once

#include "asset/file/format.hpp"

namespace umbel::asset {

/// Whether [offset, offset + bytes) lies within [begin, end).
inline bool inside(uint64_t offset, uint64_t bytes, uint64_t begin, uint64_t end) {
  return offset >= begin && offset <= end && bytes <= end - offset;
}

/// Throws kCorrupt if ranges leave their tables, pages or files lie where they cannot, an
/// instance is of no mesh, or it or the origin is not finite.
void check_head(const Head& head);

}  // namespace umbel::asset
