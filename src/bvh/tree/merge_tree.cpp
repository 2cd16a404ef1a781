// Lays out a tree of merges depth-first. Where each subtree goes follows from the counts alone, so
// subtrees are written in parallel, and nothing recurses, however deep the tree.
#include "bvh/tree/merge_tree.hpp"

#include <vector>

#include "base/parallel.hpp"

namespace umbel::bvh {
namespace {

/// A subtree and where it goes: its own node, those below it, and its primitives.
struct Place {
  Subtree subtree;
  uint32_t node, below, primitive;
};

class Layout {
 public:
  Layout(const BigVector<Merge>& merges, Boxes boxes, Bvh2& tree)
      : merges_(merges), boxes_(boxes), tree_(tree) {}

  /// Writes the nodes of at least `grain` primitives, and returns what lies below them.
  std::vector<Place> top(Place root, uint32_t grain) {
    std::vector<Place> rest, open{root};
    while (!open.empty()) {
      const Place place = open.back();
      open.pop_back();
      if (count_of(place.subtree) < grain) {
        rest.push_back(place);
        continue;
      }
      open.resize(open.size() + 2);
      write(place, &open[open.size() - 2]);
    }
    return rest;
  }

  /// Writes a whole subtree.
  void all(Place root) {
    std::vector<Place> open{root};
    while (!open.empty()) {
      const Place place = open.back();
      open.pop_back();
      if (place.subtree.is_primitive()) {
        write_leaf(place);
        continue;
      }
      open.resize(open.size() + 2);
      write(place, &open[open.size() - 2]);
    }
  }

 private:
  uint32_t count_of(Subtree subtree) const {
    return subtree.is_primitive() ? 1 : merges_[subtree.index()].count;
  }

  void write_leaf(const Place& place) {
    const uint32_t primitive = place.subtree.index();
    const Aabb& box = boxes_[primitive];
    tree_.nodes[place.node] = {box.min, place.primitive, box.max, 1};
    tree_.primitives[place.primitive] = primitive;
  }

  /// Writes an inner node and gives the places of its children, the left one last.
  void write(const Place& place, Place* children) {
    const Merge& merge = merges_[place.subtree.index()];
    tree_.nodes[place.node] = {merge.box.min, place.below, merge.box.max, 0};
    const uint32_t left = count_of(merge.left);
    children[1] = {merge.left, place.below, place.below + 2, place.primitive};
    children[0] = {merge.right, place.below + 1, place.below + 2 * left, place.primitive + left};
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
  Layout layout(merges, boxes, tree);
  constexpr uint32_t kGrain = 4096;
  const std::vector<Place> subtrees = layout.top({root, 0, 1, 0}, kGrain);
  parallel_for(subtrees.size(), 1, [&](size_t i) { layout.all(subtrees[i]); });
  return tree;
}

}  // namespace umbel::bvh
