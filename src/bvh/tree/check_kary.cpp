// Whether a tree with any number of children a node, from an unknown source, is sound.
#include <algorithm>
#include <string>
#include <vector>

#include "base/math.hpp"
#include "umbel/bvh.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kMostChildren = 64;

[[noreturn]] void fail(size_t node, const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "node " + std::to_string(node) + " " + what);
}

bool encloses(const KaryNode& outer, const KaryNode& inner) {
  return outer.min.x <= inner.min.x && outer.min.y <= inner.min.y && outer.min.z <= inner.min.z &&
         outer.max.x >= inner.max.x && outer.max.y >= inner.max.y && outer.max.z >= inner.max.z;
}

void check_node(const KaryTree& tree, size_t index, std::vector<uint8_t>& has_parent) {
  const KaryNode& node = tree.nodes[index];
  if (!is_finite(node.min) || !is_finite(node.max) || is_empty(node.box()))
    fail(index, "has a box that is empty or not finite");
  if (node.is_leaf()) {
    if (node.count == 0) fail(index, "has neither children nor primitives");
    return;
  }
  if (node.count != 0) fail(index, "has children and primitives");
  if (node.children < 2 || node.children > kMostChildren)
    fail(index, "has " + std::to_string(node.children) + " children, but must have 2 to 64");
  if (node.first <= index || size_t{node.first} + node.children > tree.nodes.size())
    fail(index, "has children that do not come after it, or are not there");
  for (uint32_t child = node.first; child < node.first + node.children; ++child) {
    if (has_parent[child]) fail(child, "has two parents");
    has_parent[child] = 1;
    if (!encloses(node, tree.nodes[child])) fail(child, "reaches out of its parent's box");
  }
}

/// Each entry of the primitives is in at most one leaf.
void check_leaves(const KaryTree& tree) {
  std::vector<uint8_t> in_leaf(tree.primitives.size());
  for (size_t i = 0; i < tree.nodes.size(); ++i) {
    const KaryNode& node = tree.nodes[i];
    if (!node.is_leaf()) continue;
    if (uint64_t{node.first} + node.count > tree.primitives.size())
      fail(i, "is a leaf of primitives that are not there");
    for (uint32_t k = node.first; k < node.first + node.count; ++k) {
      if (in_leaf[k]) fail(i, "shares primitives with another leaf");
      in_leaf[k] = 1;
    }
  }
  for (size_t k = 0; k < in_leaf.size(); ++k)
    if (!in_leaf[k])
      throw Error(ErrorCode::kCorrupt,
                  "entry " + std::to_string(k) + " of the primitives is in no leaf");
}

/// Each primitive once.
void check_primitives(const KaryTree& tree, uint32_t primitive_count) {
  std::vector<uint32_t> sorted = tree.primitives;
  std::sort(sorted.begin(), sorted.end());
  if (!sorted.empty() && sorted.back() >= primitive_count)
    throw Error(ErrorCode::kCorrupt, "primitive " + std::to_string(sorted.back()) +
                                         " is in the tree, but there are " +
                                         std::to_string(primitive_count));
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end())
    throw Error(ErrorCode::kCorrupt,
                "primitive " + std::to_string(*twice) + " is in the tree twice");
}

}  // namespace

void check(const KaryTree& tree, uint32_t primitive_count) {
  std::vector<uint8_t> has_parent(tree.nodes.size());
  for (size_t i = 0; i < tree.nodes.size(); ++i) check_node(tree, i, has_parent);
  for (size_t i = 1; i < tree.nodes.size(); ++i)
    if (!has_parent[i]) fail(i, "has no parent");
  check_leaves(tree);
  check_primitives(tree, primitive_count);
}

}  // namespace umbel::bvh
