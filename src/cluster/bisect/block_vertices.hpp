// The unique vertices of ranges of a block's items: by their vertex indices, or by the bits of
// connections, which say what vertices two items share.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "cluster/bisect/block_items.hpp"
#include "cluster/bisect/shared_bits.hpp"
#include "cluster/bisect/small_components.hpp"
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
  /// Of all items, once they are numbered: see small_components.hpp. Empty where vertices have no
  /// indices.
  std::span<const uint32_t> small_components(uint32_t most);

  /// Prepares to count along the orders of a node's items.
  void enter(const BlockItems& items, uint32_t begin, uint32_t end);
  uint32_t per_item() const { return arity_; }
  /// Along an order of the node's n items: left[i] are the vertices of those up to the i-th,
  /// right[i] those of the ones behind it. There is room for one more on the right.
  void count_sides(const uint32_t* order, uint32_t n, uint32_t* left, uint32_t* right);

 private:
  const uint32_t* vertices_of(const BlockItems& items, uint32_t local) const {
    return vertices_ + size_t(items.item(local)) * arity_;
  }
  template <typename LocalOf>
  void number_items(const BlockItems& items, uint32_t count, const LocalOf& local_of);
  uint32_t count_by_bits(const uint32_t* order, uint32_t begin, uint32_t end);
  template <uint32_t kArity>
  void count_sides_of(const uint32_t* order, uint32_t n, uint32_t* left, uint32_t* right);

  const uint32_t* vertices_ = nullptr;  ///< of the source
  uint32_t arity_ = 0;
  size_t vertex_count_ = 0;  ///< of the source
  VertexTable table_;
  QuickVertexCount quick_count_;
  SharedBits shared_;
  std::vector<uint32_t> numbers_;  ///< of the vertices of the node's items, or of all
  bool all_are_numbered_ = false;
  /// Of each vertex, the position of the last item that had it, from first_ on in this order.
  std::vector<uint32_t> last_;
  uint32_t first_ = 1;
  SmallComponents components_;
};

}  // namespace umbel::cluster
