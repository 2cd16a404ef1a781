// Lays out a tree of merges depth-first. Where each subtree goes follows from the counts alone, so
// subtrees are written in parallel, and nothing recurses, however deep the tree.
#include "bvh/tree/merge_tree.hpp"

#include <vector>

#include "base/parallel.hpp"

namespace umbel::bvh {
namespace {

/// A subtree and where it goes: its own node, those below it, and its primitives.
struct Target {
  Subtree subtree;
  uint32_t node, below, primitive;
};

class MergeLayout {
 public:
  MergeLayout(const BigVector<Merge>& merges, Boxes boxes, Bvh2& tree)
      : merges_(merges), boxes_(boxes), tree_(tree) {}

  /// Writes the nodes of at least `grain` primitives, and returns what lies below them.
  std::vector<Target> top(Target root, uint32_t grain) {
    std::vector<Target> rest, open{root};
    while (!open.empty()) {
      const Target target = open.back();
      open.pop_back();
      if (count_of(target.subtree) < grain) {
        rest.push_back(target);
        continue;
      }
      open.resize(open.size() + 2);
      write(target, &open[open.size() - 2]);
    }
    return rest;
  }

  /// Writes a whole subtree.
  void all(Target root) {
    std::vector<Target> open{root};
    while (!open.empty()) {
      const Target target = open.back();
      open.pop_back();
      if (target.subtree.is_primitive()) {
        write_leaf(target);
        continue;
      }
      open.resize(open.size() + 2);
      write(target, &open[open.size() - 2]);
    }
  }

 private:
  uint32_t count_of(Subtree subtree) const {
    return subtree.is_primitive() ? 1 : merges_[subtree.index()].count;
  }

  void write_leaf(const Target& target) {
    const uint32_t primitive = target.subtree.index();
    const Aabb& box = boxes_[primitive];
    tree_.nodes[target.node] = {box.min, target.primitive, box.max, 1};
    tree_.primitives[target.primitive] = primitive;
  }

  /// Writes an inner node and gives the targets of its children, the left one last.
  void write(const Target& target, Target* children) {
    const Merge& merge = merges_[target.subtree.index()];
    tree_.nodes[target.node] = {merge.box.min, target.below, merge.box.max, 0};
    const uint32_t left = count_of(merge.left);
    children[1] = {merge.left, target.below, target.below + 2, target.primitive};
    children[0] = {merge.right, target.below + 1, target.below + 2 * left, target.primitive + left};
  }

  const BigVector<Merge>& merges_;
  Boxes boxes_;
  Bvh2& tree_;
};

}  // namespace

Bvh2 emit(const BigVector<Merge>& merges, Subtree root, Boxes boxes) {
  Bvh2 tree;
  tree.nodes.resize(2 * boxes.size() - 1);
  tree.primitives.resize(boxes.size());
  MergeLayout layout(merges, boxes, tree);
  constexpr uint32_t kGrain = 4096;
  const std::vector<Target> subtrees = layout.top({root, 0, 1, 0}, kGrain);
  parallel_for(subtrees.size(), 1, [&](size_t i) { layout.all(subtrees[i]); });
  return tree;
}

}  // namespace umbel::bvh
