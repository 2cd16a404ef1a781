// A tree made of parts: subtrees that were built by themselves.
#pragma once

#include <algorithm>
#include <cstdint>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "base/cpu_buffer.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// The nodes below `root` lie depth-first in the 2 x `pairs` nodes before `nodes_end`. An inner
/// node's `first` is how many nodes before `nodes_end` its children lie; a leaf's is relative to
/// `leaf_base`.
struct TreePart {
  Node root;
  uint32_t pairs;
  const Node* nodes_end;
  uint32_t leaf_base;
};

/// Keeps the nodes of finished subtrees until they are joined.
class PartStore {
 public:
  /// Memory for the nodes of the subtree that this thread builds next. Its content is lost with the
  /// next call.
  static Node* scratch_end(size_t most_nodes) {
    thread_local CpuBuffer<Node> scratch;
    if (scratch.size() < most_nodes) scratch = CpuBuffer<Node>(most_nodes);
    return scratch.data() + scratch.size();
  }
  /// Copies a subtree out of the scratch memory. In pieces, so that memory is used again that was
  /// used before: to get fresh pages takes as long as to build what they hold.
  void keep(TreePart& subtree) {
    const size_t count = 2 * size_t(subtree.pairs);
    if (count == 0) return;
    CpuBuffer<Node> nodes(count, Pages::kSmall);
    keep_at(subtree, nodes.data());
    const std::lock_guard lock(mutex_);
    pieces_.push_back(std::move(nodes));
  }
  /// The same, into memory that there is.
  static void keep_at(TreePart& subtree, Node* nodes) {
    const size_t count = 2 * size_t(subtree.pairs);
    // NOLINTNEXTLINE(clang-analyzer-core.*): a subtree without nodes has no pairs
    std::copy(subtree.nodes_end - count, subtree.nodes_end, nodes);
    subtree.nodes_end = nodes + count;
  }

 private:
  std::mutex mutex_;
  std::vector<CpuBuffer<Node>> pieces_;
};

/// An inner node above subtrees: each child is another one behind it in the array, or ~subtree.
struct TopNode {
  uint32_t left, right;
};

/// Brings a leaf of a part into the tree with these primitives.
void finish_leaf(Node& leaf, uint32_t leaf_base, std::vector<uint32_t>& primitives);

/// Writes the nodes below a part's root to `nodes` from `base` on.
void copy_part(const TreePart& part, uint32_t base, Node* nodes, std::vector<uint32_t>& primitives);

/// Joins subtrees: `top` is empty for a single one. Nodes come depth-first, the left child first,
/// and primitives ascend in each leaf.
Bvh2 join_parts(std::span<const TopNode> top, std::span<const TreePart> parts,
                std::vector<uint32_t> primitives);

}  // namespace umbel::bvh
