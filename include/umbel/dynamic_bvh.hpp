// A binary tree over boxes that come and go: online insertion and removal, for scenes in which
// objects move, appear and vanish one at a time.
//
//   bvh::DynamicTree tree;
//   const uint32_t door = tree.insert(box_of_door);
//   tree.move(door, box_of_open_door);
//   for (uint32_t i : tree.overlaps(region)) ...
//   if (tree.quality().rebuild_advised) tree.rebuild();
//   tree.remove(door);
#pragma once

#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// A box with two children, or one primitive.
struct DynamicNode {
  Aabb box;
  uint32_t link;    ///< highest bit set: a leaf, the others are its primitive
  float half_area;  ///< of the box's surface; 0 or infinite where it under- or overflows
  bool is_leaf() const { return (link & 0x80000000u) != 0; }
  uint32_t primitive() const { return link & 0x7fffffffu; }
  uint32_t first_child() const { return 2 * link; }  ///< the other one follows it
};
static_assert(sizeof(DynamicNode) == 32);

struct DynamicQuality {
  double sah_cost;        ///< now, with one primitive a leaf
  double built_sah_cost;  ///< when the tree was built
  /// True once sah_cost exceeds 1.5 x built_sah_cost, as RefitReport has it.
  bool rebuild_advised;
};

/// Primitives have numbers, which are given again once they are free, the last one first. Queries
/// may run at the same time from any number of threads, but not beside a change.
class UMBEL_API DynamicTree {
 public:
  /// Without primitives. Throws kInvalidArgument where a cost is not positive and finite.
  explicit DynamicTree(const CostModel& cost = {});
  ~DynamicTree();
  DynamicTree(DynamicTree&&);  ///< may throw std::bad_alloc: what is moved from stays usable
  DynamicTree& operator=(DynamicTree&&) noexcept;

  /// Over boxes, which become primitives 0, 1, ..., by any builder. Throws as bvh::build does.
  static DynamicTree build(std::span<const Aabb> boxes, const Config& config = {},
                           const BuildOptions& options = {});

  /// Puts a box where it adds least to the area of the tree (Bittner et al. 2015), and exchanges
  /// nodes above it where that saves area (Kensler 2008). Returns its number. Throws kInvalidMesh
  /// for a box that is empty or not finite, as all functions here do.
  uint32_t insert(const Aabb& box);
  /// Throws kInvalidArgument for a number that is not in use, as all functions here do.
  void remove(uint32_t primitive);
  /// Takes a primitive out and puts it where its new box belongs.
  void move(uint32_t primitive, const Aabb& box);
  /// Gives primitives new boxes where they are, which is faster for many small steps, and brings
  /// the boxes above up to date in one pass. The tree keeps its shape.
  void refit(std::span<const uint32_t> primitives, std::span<const Aabb> boxes);
  /// Builds the tree again over what there is; numbers stay.
  void rebuild(const Config& config = {}, const BuildOptions& options = {});

  size_t size() const;  ///< primitives in use
  bool contains(uint32_t primitive) const;
  Aabb box(uint32_t primitive) const;
  Aabb bounds() const;  ///< empty where there are none
  DynamicQuality quality() const;

  /// The primitives whose boxes touch a box, sorted.
  std::vector<uint32_t> overlaps(const Aabb& box) const;
  /// As a tree of its own, with leaves of up to `max_leaf_size` by cost: for the traversals of
  /// bvh_traverse.hpp, and, of triangles, for Bvh::widen. Subtrees that reach
  /// below level 255, as of nested boxes, are rebuilt to end there.
  Bvh2 snapshot(uint32_t max_leaf_size = 8) const;

  /// nodes()[0] is the root; some of the others may be out of use. None where there are no
  /// primitives. Good until the next change.
  std::span<const DynamicNode> nodes() const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

/// Visits every primitive below nodes that `enters(const Aabb&) -> bool` lets through.
/// `leaf(uint32_t primitive) -> bool` says whether to go on. Returns false if it was told to stop.
template <typename Enters, typename Leaf>
bool traverse(const DynamicTree& tree, Enters&& enters, Leaf&& leaf) {
  const std::span<const DynamicNode> nodes = tree.nodes();
  if (nodes.empty()) return true;
  std::vector<uint32_t> stack{0};
  while (!stack.empty()) {
    const DynamicNode& node = nodes[stack.back()];
    stack.pop_back();
    if (!enters(node.box)) continue;
    if (!node.is_leaf()) {
      stack.push_back(node.first_child() + 1);
      stack.push_back(node.first_child());
    } else if (!leaf(node.primitive())) {
      return false;
    }
  }
  return true;
}

/// Visits primitives in the order of `key(const Aabb&)`, nearest child first: a lower bound of what
/// is searched for in the box; NaN or infinity leave it out. `leaf(uint32_t primitive)` returns the
/// limit from then on, above which nothing is visited. Returns the last limit.
template <typename Key, typename Leaf>
auto traverse_ordered(const DynamicTree& tree, Key&& key, Leaf&& leaf) {
  using Limit = decltype(key(Aabb{}));
  struct Entry {
    uint32_t node;
    Limit key;
  };
  constexpr Limit kInfinity = std::numeric_limits<Limit>::infinity();
  Limit limit = std::numeric_limits<Limit>::max();
  const std::span<const DynamicNode> nodes = tree.nodes();
  std::vector<Entry> stack;
  const auto push = [&](const Entry& entry) {
    if (entry.key <= limit && entry.key != kInfinity) stack.push_back(entry);
  };
  if (!nodes.empty()) push({0, key(nodes[0].box)});
  while (!stack.empty()) {
    const Entry entry = stack.back();
    stack.pop_back();
    if (!(entry.key <= limit)) continue;
    const DynamicNode& node = nodes[entry.node];
    if (node.is_leaf()) {
      const Limit next = leaf(node.primitive());
      if (next < limit) limit = next;
      continue;
    }
    const uint32_t left = node.first_child();
    const Entry a{left, key(nodes[left].box)}, b{left + 1, key(nodes[left + 1].box)};
    push(a.key <= b.key ? b : a);
    push(a.key <= b.key ? a : b);
  }
  return limit;
}

}  // namespace umbel::bvh
