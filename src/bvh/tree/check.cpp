// Whether a tree from an unknown source is one. Children come after their parents, so once every
// node but the root has exactly one parent, every node lies below the root.
#include "bvh/tree/check.hpp"

#include <string>
#include <vector>

#include "base/math.hpp"

namespace umbel::bvh {
namespace {

[[noreturn]] void fail(const std::string& sentence) { throw Error(ErrorCode::kCorrupt, sentence); }

std::string node_name(size_t index) { return "node " + std::to_string(index); }

void check_box(const Node& node, size_t index) {
  if (!is_finite(node.min) || !is_finite(node.max))
    fail("the box of " + node_name(index) + " is not finite");
  if (is_empty(node.box())) fail("the box of " + node_name(index) + " is empty");
}

bool encloses(const Node& outer, const Node& inner) {
  return outer.min.x <= inner.min.x && outer.min.y <= inner.min.y && outer.min.z <= inner.min.z &&
         outer.max.x >= inner.max.x && outer.max.y >= inner.max.y && outer.max.z >= inner.max.z;
}

class Checker {
 public:
  explicit Checker(const Bvh2& tree)
      : tree_(tree), has_parent_(tree.nodes.size(), 0), in_leaf_(tree.primitives.size(), 0) {}

  void run(uint32_t primitive_count) {
    for (size_t i = 0; i < tree_.nodes.size(); ++i) {
      check_box(tree_.nodes[i], i);
      if (tree_.nodes[i].is_leaf())
        check_leaf(i);
      else
        check_inner(i);
    }
    for (size_t i = 1; i < tree_.nodes.size(); ++i)
      if (!has_parent_[i]) fail(node_name(i) + " has no parent");
    for (size_t i = 0; i < in_leaf_.size(); ++i)
      if (!in_leaf_[i]) fail("entry " + std::to_string(i) + " of the primitives is in no leaf");
    check_range(primitive_count);
  }

 private:
  void check_leaf(size_t index) {
    const Node& leaf = tree_.nodes[index];
    const size_t end = size_t(leaf.first) + leaf.count;
    if (end > tree_.primitives.size())
      fail(node_name(index) + " is a leaf of the primitives from " + std::to_string(leaf.first) +
           " to " + std::to_string(end) + ", but there are " +
           std::to_string(tree_.primitives.size()));
    for (size_t i = leaf.first; i < end; ++i) {
      if (in_leaf_[i]) fail("entry " + std::to_string(i) + " of the primitives is in two leaves");
      in_leaf_[i] = 1;
    }
  }

  void check_inner(size_t index) {
    const Node& node = tree_.nodes[index];
    for (size_t child = node.first; child < size_t(node.first) + 2; ++child) {
      if (child >= tree_.nodes.size())
        fail(node_name(index) + " has the child " + std::to_string(child) + ", but there are " +
             std::to_string(tree_.nodes.size()) + " nodes");
      if (child <= index)
        fail(node_name(index) + " has the child " + std::to_string(child) +
             ", which does not come after it");
      if (has_parent_[child]) fail(node_name(child) + " has two parents");
      has_parent_[child] = 1;
      check_box(tree_.nodes[child], child);
      if (!encloses(node, tree_.nodes[child]))
        fail("the box of " + node_name(index) + " does not enclose that of its child " +
             std::to_string(child));
    }
  }

  void check_range(uint32_t primitive_count) {
    for (size_t i = 0; i < tree_.primitives.size(); ++i)
      if (tree_.primitives[i] >= primitive_count)
        fail("entry " + std::to_string(i) + " of the primitives is " +
             std::to_string(tree_.primitives[i]) + ", but there are " +
             std::to_string(primitive_count) + " primitives");
  }

  const Bvh2& tree_;
  std::vector<uint8_t> has_parent_, in_leaf_;
};

void check_uses(const Bvh2& tree, uint32_t primitive_count, bool repeats) {
  std::vector<uint8_t> uses(primitive_count, 0);
  for (const uint32_t primitive : tree.primitives) {
    if (uses[primitive] && !repeats)
      fail("primitive " + std::to_string(primitive) + " is in the tree twice");
    uses[primitive] = 1;
  }
  for (size_t i = 0; i < uses.size(); ++i)
    if (!uses[i]) fail("primitive " + std::to_string(i) + " is not in the tree");
}

}  // namespace

void check_structure(const Bvh2& tree, uint32_t primitive_count) {
  Checker(tree).run(primitive_count);
}

void check(const Bvh2& tree, uint32_t primitive_count, bool repeats) {
  check_structure(tree, primitive_count);
  check_uses(tree, primitive_count, repeats);
}

}  // namespace umbel::bvh
