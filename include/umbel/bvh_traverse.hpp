// Traversals of a Bvh2 over primitives of your own: templates that take the test of a node and the
// visit of a leaf as functions, which are inlined.
//
// A ray against spheres, nearest first:
//
//   const bvh::Bvh2 tree = bvh::build(boxes_of(spheres));
//   float nearest = ray.t_max;
//   bvh::traverse_ordered(
//       tree, [&](const bvh::Node& node) { return entry_distance(ray, node.box()); },
//       [&](std::span<const uint32_t> primitives) {
//         for (uint32_t i : primitives) nearest = std::min(nearest, hit(ray, spheres[i]));
//         return nearest;  // nodes that begin farther away are left out
//       });
//
// Everything that overlaps a box:
//
//   bvh::traverse(
//       tree, [&](const bvh::Node& node) { return overlaps(node.box(), region); },
//       [&](std::span<const uint32_t> primitives) {
//         found.insert(found.end(), primitives.begin(), primitives.end());
//         return true;  // go on
//       });
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>

#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// Deepest tree that the traversals take: as deep as Config::max_depth allows any builder.
inline constexpr uint32_t kMaxTraversalDepth = 255;

namespace detail {

/// Nodes that wait for their visit. One of two children waits while the other is visited, so
/// there are never more than the tree has levels.
template <typename Entry>
class TraversalStack {
 public:
  bool empty() const { return size_ == 0; }
  Entry pop() { return entries_[--size_]; }
  void push(const Entry& entry) {
    if (size_ == entries_.size())
      throw Error(ErrorCode::kInvalidArgument, "the tree is deeper than 255 levels");
    entries_[size_++] = entry;
  }

 private:
  std::array<Entry, kMaxTraversalDepth + 1> entries_;
  size_t size_ = 0;
};

inline std::span<const uint32_t> primitives_of(const Bvh2& tree, const Node& leaf) {
  return {tree.primitives.data() + leaf.first, leaf.count};
}

}  // namespace detail

/// Visits every leaf below nodes that `enters(const Node&) -> bool` lets through, left before
/// right. `leaf(std::span<const uint32_t> primitives) -> bool` says whether to go on. Returns
/// false if it was told to stop. No recursion and no allocation. The tree must be sound
/// (bvh::check); one deeper than 255 levels throws kInvalidArgument.
template <typename Enters, typename Leaf>
bool traverse(const Bvh2& tree, Enters&& enters, Leaf&& leaf) {
  if (tree.nodes.empty() || !enters(tree.nodes[0])) return true;
  detail::TraversalStack<uint32_t> stack;
  uint32_t current = 0;
  for (;;) {
    const Node& node = tree.nodes[current];
    if (node.is_leaf()) {
      if (!leaf(detail::primitives_of(tree, node))) return false;
    } else {
      const bool left = enters(tree.nodes[node.first]);
      const bool right = enters(tree.nodes[node.first + 1]);
      if (left && right) stack.push(node.first + 1);
      if (left || right) {
        current = node.first + (left ? 0 : 1);
        continue;
      }
    }
    if (stack.empty()) return true;
    current = stack.pop();
  }
}

/// Visits leaves in the order of `key(const Node&)`, nearest child first: a lower bound of
/// what is searched for below the node (a distance, its square, a t); NaN or infinity leave the
/// node out. `leaf(std::span<const uint32_t> primitives)` returns the limit from then on: nodes
/// whose key is above it are not visited, those equal to it are, and the limit never rises. A
/// negative infinite limit ends the visit. Returns the last limit. Otherwise as traverse().
template <typename Key, typename Leaf>
auto traverse_ordered(const Bvh2& tree, Key&& key, Leaf&& leaf) {
  using Limit = decltype(key(tree.nodes[0]));
  struct Entry {
    uint32_t node;
    Limit key;
  };
  constexpr Limit kInfinity = std::numeric_limits<Limit>::infinity();
  Limit limit = std::numeric_limits<Limit>::max();
  const auto enters = [&](Limit k) { return k <= limit && k != kInfinity; };
  detail::TraversalStack<Entry> stack;
  if (!tree.nodes.empty()) {
    const Limit k = key(tree.nodes[0]);
    if (enters(k)) stack.push({0, k});
  }
  while (!stack.empty()) {
    Entry entry = stack.pop();
    if (!enters(entry.key)) continue;
    for (;;) {
      const Node& node = tree.nodes[entry.node];
      if (node.is_leaf()) {
        const Limit next = leaf(detail::primitives_of(tree, node));
        if (next < limit) limit = next;
        break;
      }
      Entry near{node.first, key(tree.nodes[node.first])};
      Entry far{node.first + 1, key(tree.nodes[node.first + 1])};
      if (far.key < near.key) std::swap(near, far);
      // A NaN is not below anything: whichever came second is tested by itself.
      if (!enters(near.key)) {
        if (!enters(far.key)) break;
        entry = far;
        continue;
      }
      if (enters(far.key)) stack.push(far);
      entry = near;
    }
  }
  return limit;
}

}  // namespace umbel::bvh
