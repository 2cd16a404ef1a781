// Parallel reinsertion (Meister & Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy
// Optimization", 2018): for many subtrees at once a branch-and-bound search over the
// whole tree finds where they enlarge it least. The moves are then made one by one, the best first.
//
// Where the paper keeps conflicting moves apart by locks, each move is tried on the tree as it is
// by then, and taken back unless it pays. So the cost never rises, and nothing depends on threads.
#include "bvh/optimize/reinsertion.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "base/simd/box4.hpp"
#include "bvh/tree/box_node.hpp"
#include "bvh/tree/layout.hpp"

namespace umbel::bvh {
namespace {

struct Move {
  float gain;
  uint32_t node, target;
  bool operator<(const Move& o) const { return gain != o.gain ? gain > o.gain : node < o.node; }
};

float area(const Box4& b) { return b.half_area(splat(0)); }
Box4 joined(const Box4& a, const Box4& b) {
  Box4 both = a;
  both.extend(b);
  return both;
}

/// A tree whose nodes know their parents. The two children of a node stay neighbours; children
/// may come before their parents.
class LinkedTree {
 public:
  explicit LinkedTree(std::vector<Node>& nodes) : nodes_(nodes), parents_(nodes.size() / 2) {
    for (uint32_t i = 0; i < nodes.size(); ++i) adopt(i);
  }

  size_t size() const { return nodes_.size(); }
  const Node& operator[](uint32_t i) const { return nodes_[i]; }
  Box4 box(uint32_t i) const { return Box4::from(nodes_[i].box()); }
  static uint32_t sibling(uint32_t i) { return ((i - 1) ^ 1) + 1; }
  uint32_t parent(uint32_t i) const { return parents_[(i - 1) / 2]; }

  bool is_below(uint32_t node, uint32_t ancestor) const {
    for (; node != 0; node = parent(node))
      if (node == ancestor) return true;
    return ancestor == 0;
  }

  /// Makes `node` and `target` siblings: the old sibling replaces the old parent, and
  /// `target` moves to where the old sibling was. Returns how much larger the inner nodes have
  /// become.
  double move(uint32_t node, uint32_t target) {
    const uint32_t old_sibling = sibling(node), old_parent = parent(node);
    const Node new_parent = nodes_[old_parent];
    double change = -double(area(box(old_parent)));
    put(old_parent, nodes_[old_sibling]);
    change += refit_above(old_parent);
    put(old_sibling, nodes_[target]);
    put(target, new_parent);
    set_box(target, joined(box(node), box(old_sibling)));
    change += double(area(box(target))) + refit_above(target);
    return change;
  }

 private:
  /// Tells the children of `i` where it is.
  void adopt(uint32_t i) {
    if (!nodes_[i].is_leaf()) parents_[(nodes_[i].first - 1) / 2] = i;
  }
  void put(uint32_t i, const Node& node) {
    nodes_[i] = node;
    adopt(i);
  }
  void set_box(uint32_t i, const Box4& box) {
    nodes_[i] = node_of(box, nodes_[i].first, nodes_[i].count);
  }
  double refit_above(uint32_t i) {
    double change = 0;
    while (i != 0) {
      i = parent(i);
      const Node before = nodes_[i];
      set_box(i, joined(box(before.first), box(before.first + 1)));
      if (nodes_[i] == before) break;
      change += double(area(box(i))) - double(area(Box4::from(before.box())));
    }
    return change;
  }

  std::vector<Node>& nodes_;
  std::vector<uint32_t> parents_;  // of each pair
};

/// The best sibling for `node` by branch and bound: in what lies beside the path to the root, from
/// the bottom up.
Move best_move(const LinkedTree& tree, uint32_t node) {
  constexpr uint32_t kMostVisits = 1024;
  struct Candidate {
    float saved;  ///< area saved above, before it is joined with the node
    uint32_t index;
  };
  Candidate stack[64];
  const Box4 box = tree.box(node);
  const float own_area = area(box);
  Move best{0, node, kNone};
  uint32_t visits = 0, sibling = LinkedTree::sibling(node), pivot = tree.parent(node);
  float saved = area(tree.box(pivot));
  Box4 pivot_box = tree.box(sibling);
  bool at_parent = true;
  while (true) {
    uint32_t size = 0;
    stack[size++] = {saved, sibling};
    while (size > 0 && visits < kMostVisits) {
      const Candidate top = stack[--size];
      if (top.saved - own_area <= best.gain) continue;
      ++visits;
      const Node& target = tree[top.index];
      const Box4 target_box = Box4::from(target.box());
      const float gain = top.saved - area(joined(target_box, box));
      if (gain > best.gain) {
        best.gain = gain;
        best.target = top.index;
      }
      const float below = gain + area(target_box);
      if (target.is_leaf() || below - own_area <= best.gain || size + 2 > 64) continue;
      stack[size++] = {below, target.first};
      stack[size++] = {below, target.first + 1};
    }
    if (!at_parent) {
      pivot_box.extend(tree.box(sibling));
      saved += area(tree.box(pivot)) - area(pivot_box);
    }
    if (pivot == 0 || visits >= kMostVisits) return best;
    at_parent = false;
    sibling = LinkedTree::sibling(pivot);
    pivot = tree.parent(pivot);
  }
}

class Reinserter {
 public:
  Reinserter(std::vector<Node>& nodes, float fraction)
      : tree_(nodes), fraction_(fraction), touched_(nodes.size()) {
    for (const Node& node : nodes)
      if (!node.is_leaf()) inner_area_ += double(area(Box4::from(node.box())));
  }

  /// False if there is nothing to gain any more.
  bool run_round() {
    choose(fraction_);
    moves_.resize(candidates_.size());
    parallel_for(candidates_.size(), 64,
                 [&](size_t i) { moves_[i] = best_move(tree_, candidates_[i]); });
    std::erase_if(moves_, [](const Move& m) { return m.target == kNone; });
    std::sort(moves_.begin(), moves_.end());
    std::fill(touched_.begin(), touched_.end(), 0);
    double gained = 0;
    for (const Move& m : moves_) gained += make(m);
    const bool is_all = fraction_ >= 1;
    if (gained < kLittle * inner_area_) fraction_ *= 2;
    return gained > 0 || !is_all;
  }

 private:
  static constexpr double kLittle = 1e-3;

  /// The largest nodes: most is to be gained from them. Children of the root have nowhere to go.
  void choose(float fraction) {
    candidates_.clear();
    for (uint32_t i = 3; i < tree_.size(); ++i) candidates_.push_back(i);
    std::vector<float> areas(tree_.size());
    parallel_for(tree_.size(), 4096, [&](size_t i) { areas[i] = area(tree_.box(uint32_t(i))); });
    const auto count = static_cast<size_t>(float(candidates_.size()) * fraction) + 1;
    if (count >= candidates_.size()) return;
    std::nth_element(
        candidates_.begin(), candidates_.begin() + ptrdiff_t(count), candidates_.end(),
        [&](uint32_t a, uint32_t b) { return areas[a] != areas[b] ? areas[a] > areas[b] : a < b; });
    candidates_.resize(count);
  }

  /// Returns the area gained.
  double make(const Move& m) {
    if (touched_[m.node] || touched_[m.target]) return 0;
    const uint32_t sibling = LinkedTree::sibling(m.node), parent = tree_.parent(m.node);
    if (m.target == sibling || m.target == parent || tree_.is_below(m.target, m.node)) return 0;
    const double change = tree_.move(m.node, m.target);
    if (change >= 0) {
      // The old sibling is where the old parent was.
      tree_.move(m.node, parent);
      return 0;
    }
    for (const uint32_t i : {sibling, parent, m.target}) touched_[i] = 1;
    return -change;
  }

  LinkedTree tree_;
  double inner_area_ = 0;
  float fraction_;
  std::vector<uint8_t> touched_;  // hold another node than when the round began
  std::vector<uint32_t> candidates_;
  std::vector<Move> moves_;
};

}  // namespace

void reinsert(Bvh2& tree, uint32_t rounds, const BuildOptions& options) {
  reinsert(tree, rounds, kReinserted, options);
}

void reinsert(Bvh2& tree, uint32_t rounds, float fraction, const BuildOptions& options) {
  if (tree.nodes.size() < 5 || rounds == 0) return;
  Progress progress(options);
  with_threads(options.threads, [&] {
    Reinserter reinserter(tree.nodes, fraction);
    for (uint32_t round = 0; round < rounds; ++round) {
      progress.report(double(round) / rounds, "reinserting");
      if (!reinserter.run_round()) break;
    }
  });
  tree = laid_out(tree, {});
  progress.report(1, "reinserting");
}

}  // namespace umbel::bvh
