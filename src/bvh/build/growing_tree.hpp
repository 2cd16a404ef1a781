// A tree that primitives join and leave one at a time (Goldsmith & Salmon, "Automatic Creation of
// Object Hierarchies for Ray Tracing", 1987). The node where a primitive adds least to the area of
// the tree is found by branch and bound (Bittner, Hapala & Havran, "Incremental BVH construction
// for ray tracing", 2015), and on the way up from it nodes are exchanged where that saves area
// (Kensler, "Tree rotations for improving bounding volume hierarchies", 2008).
#pragma once

#include <algorithm>
#include <bit>
#include <utility>
#include <vector>

#include "base/big_vector.hpp"
#include "base/hash.hpp"
#include "base/simd/box4.hpp"
#include "bvh/tree/merge_tree.hpp"
#include "bvh/tree/scale.hpp"
#include "umbel/dynamic_bvh.hpp"

namespace umbel::bvh {

/// Siblings are stored next to each other, in pairs. A change for which there is no memory leaves
/// the tree as it was.
class GrowingTree {
 public:
  /// With room for so many primitives at once.
  explicit GrowingTree(size_t primitives) : nodes_(2 * primitives), parents_(primitives) {}

  bool empty() const { return pairs_ == 0; }
  std::span<const DynamicNode> nodes() const { return {nodes_.data(), 2 * size_t{pairs_}}; }

  /// From now on remembers where primitives are, so that they can be found again.
  void track() { is_tracking_ = true; }
  /// The leaf of a primitive that is there.
  uint32_t leaf_of(uint32_t primitive) const { return leaves_[primitive]; }

  void insert(uint32_t primitive, const Aabb& box) {
    if (free_pairs_.empty()) make_room();
    if (is_tracking_) make_room_for_leaf(primitive);
    insert_beside(pairs_ == 0 ? 0 : best_sibling(primitive, box), primitive, box);
  }
  /// Needs no memory for a primitive that was just removed.
  void insert_beside(uint32_t sibling, uint32_t primitive, const Aabb& box) {
    const DynamicNode leaf{box, Subtree::of_primitive(primitive).link, area_of(box)};
    if (pairs_ == 0) {
      pairs_ = 1;  // the first holds the root alone
      put(0, leaf);
      return;
    }
    const uint32_t pair = split(sibling);
    put(2 * pair + 1, leaf);
    climb(sibling);
  }

  /// Takes out a leaf; its sibling takes the place of their parent, which is returned.
  uint32_t remove(uint32_t leaf) {
    if (leaf == 0) {
      pairs_ = 0;
      free_pairs_.clear();
      return 0;
    }
    const uint32_t pair = leaf / 2, parent = parents_[pair];
    free_pairs_.push_back(pair);
    put(parent, nodes_[leaf ^ 1]);
    if (parent == 0) return parent;
    set_scale(nodes_[0].box);
    climb(parents_[parent / 2]);
    return parent;
  }

  /// A root, to be put; for a tree that is made from the root down.
  void set_root() {
    make_room();
    pairs_ = 1;
  }
  /// Gives a node two children, which are to be put; returns their pair.
  uint32_t make_inner(uint32_t node) {
    const uint32_t pair = new_pair();
    nodes_[node].link = Subtree::of_merge(pair).link;
    parents_[pair] = node;
    return pair;
  }

  /// Moves a node into another place; its children follow.
  void put(uint32_t at, const DynamicNode& node) {
    nodes_[at] = node;
    if (!node.is_leaf()) {
      parents_[node.link] = at;
    } else if (is_tracking_) {
      make_room_for_leaf(node.primitive());
      leaves_[node.primitive()] = at;
    }
  }

  /// Makes the boxes of all nodes those of their children, after set_leaves() has set the leaves'.
  template <typename SetLeaves>
  void refit(const SetLeaves& set_leaves) {
    const std::vector<uint32_t> order = inner_nodes();
    set_leaves();
    for (const uint32_t node : order) set_box(node, united_children(node));
  }
  void set_box(uint32_t node, const Aabb& box) {
    nodes_[node].box = box;
    nodes_[node].half_area = area_of(box);
  }

  /// The same tree as merges, as many as there are pairs below the root. Nothing was removed.
  Subtree to_merges(BigVector<Merge>& merges) const {
    for (const uint32_t node : inner_nodes()) {
      const uint32_t pair = nodes_[node].link;
      const Subtree left = merge_of(2 * pair), right = merge_of(2 * pair + 1);
      merges[pair - 1] = {nodes_[node].box, left, right,
                          count_of(left, merges) + count_of(right, merges)};
    }
    return merge_of(0);
  }

 private:
  /// Children before parents.
  std::vector<uint32_t> inner_nodes() const {
    std::vector<uint32_t> order;
    order.reserve(pairs_);
    if (!nodes_[0].is_leaf()) order.push_back(0);
    for (size_t i = 0; i < order.size(); ++i) {
      const uint32_t left = nodes_[order[i]].first_child();
      for (const uint32_t child : {left, left + 1})
        if (!nodes_[child].is_leaf()) order.push_back(child);
    }
    std::reverse(order.begin(), order.end());
    return order;
  }
  Aabb united_children(uint32_t node) const {
    const uint32_t left = nodes_[node].first_child();
    return united(nodes_[left].box, nodes_[left + 1].box);
  }

  /// Gives a node two children, the first of which is what it was; returns their pair.
  uint32_t split(uint32_t node) {
    const DynamicNode first = nodes_[node];
    const uint32_t pair = make_inner(node);
    put(2 * pair, first);
    return pair;
  }

  void make_room() {
    if (nodes_.size() > 2 * size_t{pairs_} + 1) return;
    const size_t pairs = std::max<size_t>(16, nodes_.size());
    parents_.resize(pairs);
    nodes_.resize(2 * pairs);  // last: its size says whether there is room
  }
  void make_room_for_leaf(uint32_t primitive) {
    if (leaves_.size() > primitive) return;
    leaves_.resize(std::max<size_t>(primitive + 1, 2 * leaves_.size()));
  }
  uint32_t new_pair() {
    if (!free_pairs_.empty()) {
      const uint32_t pair = free_pairs_.back();
      free_pairs_.pop_back();
      return pair;
    }
    make_room();
    return pairs_++;
  }

  /// Pairs that are searched for one box. Boxes of meshes need some hundred; where most boxes hold
  /// the new one, as around one point, all would be searched, which takes the square of their
  /// number.
  static constexpr uint32_t kMostSearched = 4096;

  /// A pair to be searched, and by how much its ancestors grow.
  struct Candidate {
    float growth;
    uint32_t pair;
  };

  Subtree merge_of(uint32_t node) const {
    const DynamicNode& of = nodes_[node];
    return of.is_leaf() ? Subtree{of.link} : Subtree::of_merge(of.link - 1);
  }
  static uint32_t count_of(Subtree subtree, const BigVector<Merge>& merges) {
    return subtree.is_primitive() ? 1 : merges[subtree.index()].count;
  }

  /// For areas that are compared, in a tree with this box.
  void set_scale(const Aabb& whole) {
    scale_ = moderate_scale(whole);
    padding_ = 0x1p-24f * scaled_box(whole).longest();
  }
  /// Scaled as the whole tree, so that no area overflows or vanishes.
  Box4 scaled_box(const Aabb& box) const {
    Box4 b = Box4::load(box);
    if (scale_ != 1.0f) [[unlikely]]
      b = {b.low * splat(scale_), b.negated_high * splat(scale_)};
    return b;
  }
  /// Of a scaled box, enlarged by a sliver of the whole tree: points and segments on a line have an
  /// area, too.
  float padded_area(const Box4& box) const { return box.half_area(splat(padding_)); }
  float united_area(const Box4& a, const Box4& b) const {
    return padded_area({min4(a.low, b.low), min4(a.negated_high, b.negated_high)});
  }

  /// The node that should become the sibling of the box.
  uint32_t best_sibling(uint32_t primitive, const Aabb& box) {
    const Aabb whole = united(nodes_[0].box, box);
    set_scale(whole);
    const Box4 added = scaled_box(box);
    const float area = padded_area(added);
    float best = padded_area(scaled_box(whole));
    uint32_t best_node = 0;
    candidates_.clear();
    if (!nodes_[0].is_leaf())
      candidates_.push_back({best - padded_area(scaled_box(nodes_[0].box)), nodes_[0].link});
    for (uint32_t searched = 0; searched < kMostSearched && !candidates_.empty(); ++searched) {
      const Candidate candidate = candidates_.back();
      candidates_.pop_back();
      // Whatever lies below: the new parent is no smaller than the box itself.
      if (candidate.growth + area >= best) continue;
      Candidate below[2];
      for (uint32_t i = 0; i < 2; ++i) {
        const DynamicNode& node = nodes_[2 * candidate.pair + i];
        const Box4 node_box = scaled_box(node.box);
        const float cost = candidate.growth + united_area(node_box, added);
        if (cost < best) {
          best = cost;
          best_node = 2 * candidate.pair + i;
        }
        // Below a leaf there is nothing to be searched.
        below[i] = {node.is_leaf() ? best : cost - padded_area(node_box), node.link};
      }
      // The more promising one is searched first, so it is pushed last.
      if (below[0].growth < below[1].growth) std::swap(below[0], below[1]);
      for (const Candidate& next : below)
        if (next.growth + area < best) candidates_.push_back(next);
    }
    // Among equal boxes all places cost the same. A random one keeps them from becoming a chain.
    for (uint64_t path = mix64(primitive); !nodes_[best_node].is_leaf();
         path = std::rotr(path, 1)) {
      const uint32_t next = nodes_[best_node].first_child() + (path & 1);
      if (nodes_[next].box != box) break;
      best_node = next;
    }
    return best_node;
  }

  /// Brings boxes up to date from a node that is new upwards, and rotates, as far as that may
  /// change anything: a rotation depends on the boxes of children and grandchildren.
  void climb(uint32_t node) {
    for (uint32_t changed = 3; changed > 0; node = parents_[node / 2]) {
      const uint32_t left = nodes_[node].first_child();
      const Aabb box = united_children(node);
      changed = box == nodes_[node].box ? changed - 1 : 2;
      set_box(node, box);
      if (rotate(left, left + 1)) changed = 2;
      if (node == 0) return;
    }
  }

  /// Exchanges one of two siblings with a child of the other where that shrinks the other most;
  /// false where it does not.
  bool rotate(uint32_t left, uint32_t right) {
    float best = 0;
    uint32_t node = 0, child = 0;
    for (const auto& [outer, inner] : {std::pair{left, right}, std::pair{right, left}}) {
      if (nodes_[inner].is_leaf()) continue;
      const uint32_t first = nodes_[inner].first_child();
      const float area = padded_area(scaled_box(nodes_[inner].box));
      for (const uint32_t leaving : {first, first + 1}) {
        const float gain =
            area - united_area(scaled_box(nodes_[outer].box), scaled_box(nodes_[leaving ^ 1].box));
        if (gain <= best) continue;
        best = gain;
        node = outer;
        child = leaving;
      }
    }
    if (best == 0) return false;
    const DynamicNode moved = nodes_[node];
    put(node, nodes_[child]);
    put(child, moved);
    set_box(node ^ 1, united_children(node ^ 1));
    return true;
  }

  BigVector<DynamicNode> nodes_;  ///< pair p is nodes 2 p and 2 p + 1
  BigVector<uint32_t> parents_;   ///< of each pair, a node
  BigVector<uint32_t> leaves_;    ///< of each primitive, where `is_tracking_`
  std::vector<uint32_t> free_pairs_;
  uint32_t pairs_ = 0;  ///< free ones included
  bool is_tracking_ = false;
  float scale_ = 1, padding_ = 0;  ///< see set_scale
  std::vector<Candidate> candidates_;
};

}  // namespace umbel::bvh
