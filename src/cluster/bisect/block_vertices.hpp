// The unique vertices of ranges of a block's items: by their vertex indices, or by the bits of
// connections, which say what vertices two items share.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "cluster/bisect/block_items.hpp"
#include "cluster/bisect/shared_bits.hpp"
#include "cluster/bisect/split_constraints.hpp"
#include "cluster/source.hpp"
#include "cluster/vertex_table.hpp"

namespace umbel::cluster {

class BlockVertices {
 public:
  /// Prepares for these items; local index i is items[i].
  void load(const Source& source, const uint32_t* items, uint32_t count);

  /// The constraints with the most items that the vertex limit will let clusters have. Where
  /// clusters run out of vertices before they are full of items, splits must aim at that number, or
  /// each full node ends in two half-full ones. A few samples of neighbours tell.
  SplitConstraints expected(const BlockItems& items, const SplitConstraints& constraints);

  /// Whether the items [begin, end) of an order have no more vertices than `limit`.
  bool within(const BlockItems& items, uint32_t begin, uint32_t end, int axis, uint32_t limit);

  /// Numbers the vertices of all items, which is worth it where most nodes are counted.
  void number(const BlockItems& items);

  /// Prepares to count along the orders of a node's items: `reset` and then `insert` of each.
  void enter(const BlockItems& items, uint32_t begin, uint32_t end);
  uint32_t per_item() const { return arity_; }
  /// Of the node.
  uint32_t node_count() const { return node_count_; }
  void reset() {
    if (shared_.active()) return shared_.clear();
    if (++pass_ != 0) return;
    std::fill(seen_.begin(), seen_.end(), 0);
    pass_ = 1;
  }
  /// How many of an item's vertices are new.
  uint32_t insert(uint32_t local) {
    if (shared_.active()) return shared_.insert(local);
    uint32_t fresh = 0;
    for (uint32_t k = 0; k < arity_; ++k) {
      uint32_t& seen = seen_[numbers_[size_t(local) * arity_ + k]];
      fresh += seen != pass_ ? 1 : 0;
      seen = pass_;
    }
    return fresh;
  }

 private:
  const uint32_t* vertices_of(const BlockItems& items, uint32_t local) const {
    return vertices_ + size_t(items.item(local)) * arity_;
  }
  void number_items(const BlockItems& items, const uint32_t* locals, uint32_t count);
  uint32_t count_by_bits(const uint32_t* order, uint32_t begin, uint32_t end);

  const uint32_t* vertices_ = nullptr;  ///< of the source
  uint32_t arity_ = 0;
  VertexTable table_;
  QuickVertexCount quick_count_;
  SharedBits shared_;
  std::vector<uint32_t> numbers_;  ///< of the vertices of the node's items, or of all
  bool all_are_numbered_ = false;
  std::vector<uint32_t> seen_;  ///< the last pass that saw each vertex
  uint32_t pass_ = 0;
  uint32_t node_count_ = 0;
};

}  // namespace umbel::cluster
