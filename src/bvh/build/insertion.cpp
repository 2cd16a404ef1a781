// Incremental insertion (Goldsmith & Salmon, "Automatic Creation of Object Hierarchies for Ray
// Tracing", 1987): each primitive joins the node where it adds least to the area of the tree. That
// node is found by branch and bound (Bittner, Hapala & Havran, "Incremental BVH construction for
// ray tracing", 2015), and on the way up from it nodes are exchanged where that saves area
// (Kensler, "Tree rotations for improving bounding volume hierarchies", 2008).
#include <utility>
#include <vector>

#include "base/big_vector.hpp"
#include "base/exec.hpp"
#include "base/hash.hpp"
#include "base/morton.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {
namespace {

/// Half the area of a union.
float united_area(const Aabb& a, const Aabb& b) { return area_of(united(a, b)); }

/// A tree that grows. Siblings are stored next to each other, in pairs.
class GrowingTree {
 public:
  explicit GrowingTree(size_t primitives) : nodes_(2 * primitives), parents_(primitives) {}

  void insert(uint32_t primitive, const Aabb& box) {
    const GrowingNode leaf{box, Subtree::of_primitive(primitive), area_of(box)};
    if (pairs_ == 0) {
      pairs_ = 1;  // the first holds the root alone
      nodes_[0] = leaf;
      return;
    }
    const uint32_t sibling = best_sibling(box, leaf.area), pair = pairs_++;
    put(2 * pair, nodes_[sibling]);
    nodes_[2 * pair + 1] = leaf;
    nodes_[sibling].link = Subtree::of_merge(pair);
    parents_[pair] = sibling;
    climb(sibling);
  }

  /// The same tree as merges, as many as there are pairs below the root.
  Subtree to_merges(BigVector<Merge>& merges) const {
    std::vector<uint32_t> order;
    order.reserve(pairs_);
    if (!nodes_[0].link.is_primitive()) order.push_back(nodes_[0].link.index());
    for (size_t i = 0; i < order.size(); ++i)
      for (const uint32_t child : {2 * order[i], 2 * order[i] + 1})
        if (!nodes_[child].link.is_primitive()) order.push_back(nodes_[child].link.index());
    for (size_t i = order.size(); i-- > 0;) {
      const uint32_t pair = order[i];
      const Subtree left = merge_of(2 * pair), right = merge_of(2 * pair + 1);
      merges[pair - 1] = {nodes_[parents_[pair]].box, left, right,
                          count_of(left, merges) + count_of(right, merges)};
    }
    return merge_of(0);
  }

 private:
  struct GrowingNode {
    Aabb box;
    Subtree link;  ///< a primitive, or the pair of its children
    float area;    ///< half the box's
  };
  static_assert(sizeof(GrowingNode) == 32);

  /// A pair to be searched, and by how much its ancestors grow.
  struct Candidate {
    float growth;
    uint32_t pair;
  };

  Subtree merge_of(uint32_t node) const {
    const Subtree link = nodes_[node].link;
    return link.is_primitive() ? link : Subtree::of_merge(link.index() - 1);
  }
  static uint32_t count_of(Subtree subtree, const BigVector<Merge>& merges) {
    return subtree.is_primitive() ? 1 : merges[subtree.index()].count;
  }

  /// The node that should become the sibling of the box.
  uint32_t best_sibling(const Aabb& box, float area) {
    float best = united_area(nodes_[0].box, box);
    uint32_t best_node = 0;
    candidates_.clear();
    if (!nodes_[0].link.is_primitive())
      candidates_.push_back({best - nodes_[0].area, nodes_[0].link.index()});
    while (!candidates_.empty()) {
      const Candidate candidate = candidates_.back();
      candidates_.pop_back();
      // Whatever lies below: the new parent is no smaller than the box itself.
      if (candidate.growth + area >= best) continue;
      Candidate below[2];
      for (uint32_t i = 0; i < 2; ++i) {
        const GrowingNode& node = nodes_[2 * candidate.pair + i];
        const float cost = candidate.growth + united_area(node.box, box);
        if (cost < best) {
          best = cost;
          best_node = 2 * candidate.pair + i;
        }
        below[i] = {cost - node.area, node.link.link};
      }
      // The more promising one is searched first, so it is pushed last.
      if (below[0].growth < below[1].growth) std::swap(below[0], below[1]);
      for (const Candidate& next : below)
        if (!Subtree{next.pair}.is_primitive() && next.growth + area < best)
          candidates_.push_back(next);
    }
    return best_node;
  }

  /// Moves a node into another slot; its children follow.
  void put(uint32_t at, const GrowingNode& node) {
    nodes_[at] = node;
    if (!node.link.is_primitive()) parents_[node.link.index()] = at;
  }

  /// Brings boxes up to date from a node that is new upwards, and rotates, as far as that may
  /// change anything: a rotation depends on the boxes of children and grandchildren.
  void climb(uint32_t node) {
    for (uint32_t changed = 3; changed > 0; node = parents_[node / 2]) {
      const uint32_t left = 2 * nodes_[node].link.index();
      const Aabb box = united(nodes_[left].box, nodes_[left + 1].box);
      changed = box == nodes_[node].box ? changed - 1 : 2;
      nodes_[node].box = box;
      nodes_[node].area = area_of(box);
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
      if (nodes_[inner].link.is_primitive()) continue;
      const uint32_t first = 2 * nodes_[inner].link.index();
      for (const uint32_t leaving : {first, first + 1}) {
        const float gain =
            nodes_[inner].area - united_area(nodes_[outer].box, nodes_[leaving ^ 1].box);
        if (gain <= best) continue;
        best = gain;
        node = outer;
        child = leaving;
      }
    }
    if (best == 0) return false;
    const GrowingNode moved = nodes_[node];
    put(node, nodes_[child]);
    put(child, moved);
    GrowingNode& shrunk = nodes_[node ^ 1];
    shrunk.box = united(nodes_[child].box, nodes_[child ^ 1].box);
    shrunk.area = area_of(shrunk.box);
    return true;
  }

  BigVector<GrowingNode> nodes_;  ///< pair p is nodes 2 p and 2 p + 1
  BigVector<uint32_t> parents_;   ///< of each pair, a node
  uint32_t pairs_ = 0;
  std::vector<Candidate> candidates_;
};

/// Rounds of random primitives, each of about as many as all before it, and each along the Morton
/// curve (Amenta, Choi & Rote, "Incremental constructions con BRIO", 2003): as good a tree as of a
/// random order, in a third of the time, because neighbours meet a warm cache.
std::vector<uint32_t> insertion_order(Boxes boxes) {
  CpuExec exec;
  const auto order = morton_order<uint64_t>(exec, boxes.data(), boxes.size(), 21);
  std::vector<uint32_t> primitives(order.primitives.data(), order.primitives.data() + boxes.size());
  const auto round = [](uint32_t primitive) { return -std::countl_zero(mix64(primitive)); };
  std::stable_sort(primitives.begin(), primitives.end(),
                   [&](uint32_t a, uint32_t b) { return round(a) < round(b); });
  return primitives;
}

}  // namespace

Bvh2 build_insertion(Boxes boxes, const Config& /*config*/, BuildProgress& progress) {
  const auto count = static_cast<uint32_t>(boxes.size());
  GrowingTree tree(count);
  uint32_t inserted = 0;
  for (const uint32_t primitive : insertion_order(boxes)) {
    if (inserted++ % 65536 == 0) progress.report(0.05 + 0.85 * inserted / count, "inserting");
    tree.insert(primitive, boxes[primitive]);
  }
  BigVector<Merge> merges(count - 1);
  const Subtree root = tree.to_merges(merges);
  progress.report(0.95, "laying out");
  return emit(merges, root, boxes);
}

}  // namespace umbel::bvh
