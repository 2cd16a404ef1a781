// Connected components of a few items, by the vertices that they share: a split through one doubles
// vertices, one between two does not.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::cluster {

class SmallComponents {
 public:
  /// `numbers` are the items' vertices, `arity` an item, all below `vertex_count`. Returns one item
  /// of its component for each, the same one for all, and of components with more than `most` items
  /// each item itself.
  std::span<const uint32_t> find(std::span<const uint32_t> numbers, uint32_t arity,
                                 size_t vertex_count, uint32_t most);

 private:
  uint32_t first_of(uint32_t item);

  std::vector<uint32_t> parents_;  ///< by item: another of its component, or itself
  std::vector<uint32_t> sizes_;    ///< by item that is its own parent
  std::vector<uint32_t> users_;    ///< by vertex: an item that has it
  std::vector<uint32_t> firsts_;   ///< by item
};

}  // namespace umbel::cluster
