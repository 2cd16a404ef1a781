// What tables must satisfy for selection, streaming and reading to be safe at all: verification
// starts with it, and assets are refused without it. Whether levels, errors, spheres and links are
// also *right* is for verify_tables.hpp.
#pragma once

#include <string>

#include "umbel/lod/types.hpp"

namespace umbel::lod {

/// A sentence naming the first fault, or nothing: a range or link that leaves its table, an unknown
/// method, clusters that are not in exactly one group, nodes that form no tree.
std::string structure_fault(const Tables& tables);
/// The same of tables whose clusters are elsewhere, so many of them.
std::string structure_fault_but_clusters(const Tables& tables, size_t clusters);

/// Whether the range lies within a table of that size.
inline bool is_within(const Range& range, size_t size) {
  return range.offset <= size && range.count <= size - range.offset;
}

}  // namespace umbel::lod
