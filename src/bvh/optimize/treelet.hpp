// Treelet restructuring for any executor (Domingues & Pedrini, "Bounding Volume Hierarchy
// Optimization through Agglomerative Treelet Restructuring", 2015): bottom-up, the few largest
// subtrees below each node are agglomerated, always the two with the smallest common box, and the
// result is kept where it costs less (as in Karras & Aila, "Fast Parallel Construction of
// High-Quality Bounding Volume Hierarchies", 2013, who search all ways of joining them).
#pragma once

#include <cstdint>
#include <limits>

#include "base/exec.hpp"
#include "base/progress.hpp"
#include "bvh/tree/leaf_rule.hpp"
#include "bvh/tree/merge_parents.hpp"

namespace umbel::bvh {

/// A tree of merges over items.
struct TreeletInput {
  const Aabb* boxes;
  const uint32_t* primitives;  ///< of each item; none: one each
  uint32_t items;
  Merge* merges;
};

/// A subtree of a treelet.
struct TreeletPart {
  Aabb box;
  float cost;
  uint32_t count;
  Subtree subtree;  ///< until it is written: ~i for what the i-th join made
};
struct TreeletMerge {
  Aabb box;
  float cost;
  uint32_t count;
  Subtree left, right;  ///< as those of parts
};

/// The memory of a team that restructures a treelet.
struct TreeletMemory {
  static constexpr uint32_t kMost = 15;

  TreeletPart parts[kMost + 1];
  TreeletMerge joins[kMost];
  float distance[kMost + 1][kMost + 1];  ///< of pairs, the larger index first
  uint32_t merges[kMost];                ///< that were taken apart, the root first
};

/// One treelet: a team takes it apart and agglomerates it.
template <typename Team>
class Treelet {
 public:
  UMBEL_HOST_DEVICE Treelet(const Team& team, const TreeletInput& tree, float* costs,
                            const MergeParents& parents, const LeafRule& rule,
                            TreeletMemory& memory)
      : team_(team), tree_(tree), costs_(costs), parents_(parents), rule_(rule), m_(memory) {}

  /// Restructures the treelet of at most `size` subtrees below the merge `root`, if it becomes
  /// cheaper by that.
  UMBEL_HOST_DEVICE void restructure(uint32_t root, uint32_t size) {
    take_apart(root, size);
    const bool is_cheaper = join() < costs_[root] * kWorthwhile;
    team_.sync();  // all have read what is written now
    if (is_cheaper) write();
    team_.sync();
  }

 private:
  static constexpr float kWorthwhile = 1 - 1e-5f;  ///< rounding alone should move nothing
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();

  UMBEL_HOST_DEVICE TreeletPart part_of(Subtree s) const {
    if (s.is_primitive()) {
      const uint32_t i = s.index();
      const Aabb& box = tree_.boxes[i];
      return {box, rule_.leaf_cost(box, tree_.primitives ? tree_.primitives[i] : 1), 1, s};
    }
    const Merge& merge = tree_.merges[s.index()];
    return {merge.box, costs_[s.index()], merge.count, s};
  }

  struct Largest {
    float area;
    uint32_t part;
    Subtree subtree;
  };
  /// Of equal ones the first.
  struct Larger {
    UMBEL_HOST_DEVICE Largest operator()(const Largest& a, const Largest& b) const {
      if (a.area != b.area) return a.area > b.area ? a : b;
      return a.part <= b.part ? a : b;
    }
  };

  /// Opens the merge with the largest box again and again.
  UMBEL_HOST_DEVICE void take_apart(uint32_t root, uint32_t size) {
    used_ = merge_count_ = 0;
    open(root, 0, used_);
    while (used_ < size) {
      Largest largest{-1, kNone, {kNone}};
      for (uint32_t i = team_.rank(); i < used_; i += team_.size()) {
        const TreeletPart& part = m_.parts[i];
        if (part.subtree.is_primitive()) continue;
        largest = Larger{}(largest, {number(area_of(part.box)), i, part.subtree});
      }
      largest = team_.reduce(largest, Larger{});
      if (largest.part == kNone) return;
      // The last part takes the place of the one that is opened.
      open(largest.subtree.index(), largest.part, used_ - 1);
    }
  }
  /// Puts the children of a merge at the parts from `at` on, once what is there is at `last_to`.
  UMBEL_HOST_DEVICE void open(uint32_t merge, uint32_t last_to, uint32_t at) {
    for (uint32_t k = team_.rank(); k < 2; k += team_.size()) {
      if (k == 0 && at > 0) m_.parts[last_to] = m_.parts[at];
      if (k == 0) m_.merges[merge_count_] = merge;
      m_.parts[at + k] = part_of(k == 0 ? tree_.merges[merge].left : tree_.merges[merge].right);
    }
    ++merge_count_;
    used_ = at + 2;
    team_.sync();
  }

  /// Two parts, named by the larger index, times kRow, and the smaller one.
  struct Nearest {
    float distance;
    uint32_t pair;
  };
  static constexpr uint32_t kRow = TreeletMemory::kMost + 1;
  struct Nearer {
    UMBEL_HOST_DEVICE Nearest operator()(const Nearest& a, const Nearest& b) const {
      if (a.distance != b.distance) return a.distance < b.distance ? a : b;
      return a.pair <= b.pair ? a : b;
    }
  };

  /// Calls visit(i, j) with all j < i < used_, shared out among the team.
  template <typename Visit>
  UMBEL_HOST_DEVICE void each_pair(const Visit& visit) const {
    const uint32_t columns = team_.size() < kRow ? team_.size() : kRow;
    const uint32_t rows = team_.size() / columns;
    for (uint32_t i = 1 + team_.rank() / columns; i < used_; i += rows)
      for (uint32_t j = team_.rank() % columns; j < i; j += columns) visit(i, j);
  }

  /// Joins the parts into one, and returns its cost.
  UMBEL_HOST_DEVICE float join() {
    each_pair([&](uint32_t i, uint32_t j) {
      m_.distance[i][j] = distance(m_.parts[i].box, m_.parts[j].box);
    });  // until the first two are joined, each lane looks at those that it wrote
    join_count_ = 0;
    while (used_ > 1) {
      Nearest nearest{kInfinity, kRow};  // the first pair
      each_pair([&](uint32_t i, uint32_t j) {
        nearest = Nearer{}(nearest, {m_.distance[i][j], kRow * i + j});
      });
      nearest = team_.reduce(nearest, Nearer{});
      join_two(nearest.pair / kRow, nearest.pair % kRow);
    }
    return m_.parts[0].cost;
  }
  UMBEL_HOST_DEVICE static float distance(const Aabb& a, const Aabb& b) {
    return number(area_of(united(a, b)));
  }
  /// Infinite where it is no number, which has no order.
  UMBEL_HOST_DEVICE static float number(float x) {
    if (x == x) return x;
    return kInfinity;
  }

  /// Puts the joined part at b < a, and moves the last one to a.
  UMBEL_HOST_DEVICE void join_two(uint32_t a, uint32_t b) {
    const Subtree left = m_.parts[b].subtree, right = m_.parts[a].subtree;
    TreeletPart joined;
    joined.box = united(m_.parts[b].box, m_.parts[a].box);
    joined.count = m_.parts[b].count + m_.parts[a].count;
    joined.cost = rule_.cheaper(joined.box, joined.count, m_.parts[b].cost, m_.parts[a].cost);
    joined.subtree = {~join_count_};
    const uint32_t last = --used_;
    for (uint32_t i = team_.rank(); i < last; i += team_.size()) {
      if (i == b) continue;
      if (i != a) between(a, i) = between(last, i);
      between(i, b) = distance(m_.parts[i == a ? last : i].box, joined.box);
    }
    team_.sync();
    if (team_.rank() == 0) {
      m_.joins[join_count_] = {joined.box, joined.cost, joined.count, left, right};
      m_.parts[a] = m_.parts[last];
      m_.parts[b] = joined;
    }
    ++join_count_;
    team_.sync();
  }
  UMBEL_HOST_DEVICE float& between(uint32_t i, uint32_t j) const {
    return i < j ? m_.distance[j][i] : m_.distance[i][j];
  }

  /// The last join becomes the root; the others, from the last on, the merges below it.
  UMBEL_HOST_DEVICE void write() {
    for (uint32_t i = team_.rank(); i < join_count_; i += team_.size()) {
      const TreeletMerge& join = m_.joins[i];
      const uint32_t id = id_of(i);
      const Subtree left = resolved(join.left, i), right = resolved(join.right, i);
      tree_.merges[id] = {join.box, left, right, join.count};
      costs_[id] = join.cost;
      for (const Subtree s : {left, right})
        (s.is_primitive() ? parents_.of_items : parents_.of_merges)[s.index()] = id;
    }
  }
  UMBEL_HOST_DEVICE uint32_t id_of(uint32_t join) const {
    return m_.merges[join_count_ - 1 - join];
  }
  /// Links ~i with i below `joins` are joins: ids of primitives and merges never come so high.
  UMBEL_HOST_DEVICE Subtree resolved(Subtree s, uint32_t joins) const {
    return ~s.link < joins ? Subtree::of_merge(id_of(~s.link)) : s;
  }

  const Team& team_;
  const TreeletInput& tree_;
  float* costs_;
  const MergeParents& parents_;
  const LeafRule& rule_;
  TreeletMemory& m_;
  uint32_t used_ = 0, merge_count_ = 0, join_count_ = 0;
};

/// Every lane climbs from an item, and goes on from a merge if it is the second to arrive there.
/// What lanes find to restructure, all of them do together.
struct TreeletClimb {
  static constexpr uint32_t kLanes = 32;
  struct Shared {
    uint32_t found[kLanes];
    TreeletMemory memory;
  };

  TreeletInput tree;
  float* costs;
  MergeParents parents;
  uint32_t* arrived;
  LeafRule rule;
  uint32_t size;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    for (uint32_t first = 0; first < kLanes; first += team.size()) {
      const uint32_t lane = first + team.rank();  // may be beyond, if 32 is no multiple of the size
      const size_t item = index * kLanes + lane;
      const bool climbs = lane < kLanes && item < tree.items;
      climb(team, climbs ? parents.of_items[item] : kNone, shared);
    }
  }

 private:
  template <typename Team>
  UMBEL_HOST_DEVICE void climb(const Team& team, uint32_t node, Shared& shared) const {
    while (team.count(node != kNone) > 0) {
      if (node != kNone && !is_last_to_arrive(&arrived[node], 1)) node = kNone;
      bool is_large = false;
      if (node != kNone) {
        const Merge& merge = tree.merges[node];
        costs[node] =
            rule.cheaper(merge.box, merge.count, cost_of(merge.left), cost_of(merge.right));
        is_large = merge.count >= size;
      }
      const uint32_t place = team.rank_among(is_large), found = team.count(is_large);
      if (is_large) shared.found[place] = node;
      team.sync();
      for (uint32_t i = 0; i < found; ++i)
        Treelet<Team>(team, tree, costs, parents, rule, shared.memory)
            .restructure(shared.found[i], size);
      if (node != kNone) node = parents.of_merges[node];
    }
  }
  UMBEL_HOST_DEVICE float cost_of(Subtree s) const {
    if (!s.is_primitive()) return costs[s.index()];
    return rule.leaf_cost(tree.boxes[s.index()], tree.primitives ? tree.primitives[s.index()] : 1);
  }
};

/// Restructures treelets of `size` subtrees (3..15) all over the tree, in rounds.
template <typename Exec>
class TreeletRounds {
 public:
  TreeletRounds(Exec& exec, const TreeletInput& tree, const Subtree* root, const LeafRule& rule)
      : exec_(exec), tree_(tree), rule_(rule) {
    costs_ = exec.template allocate<float>(tree.items);
    arrived_ = exec.template allocate<uint32_t>(tree.items);
    merge_parents_ = exec.template allocate<uint32_t>(tree.items);
    item_parents_ = exec.template allocate<uint32_t>(tree.items);
    find_parents(exec, tree.merges, tree.items - 1, root, parents());
  }

  void run_round(uint32_t size) {
    exec_.for_each(tree_.items,
                   [arrived = arrived_.data()] UMBEL_DEVICE_LAMBDA(size_t i) { arrived[i] = 0; });
    exec_.for_each_team(
        (tree_.items + size_t{TreeletClimb::kLanes} - 1) / TreeletClimb::kLanes,
        TreeletClimb{tree_, costs_.data(), parents(), arrived_.data(), rule_, size});
  }

 private:
  template <typename T>
  using Buffer = typename Exec::template Buffer<T>;

  MergeParents parents() const { return {merge_parents_.data(), item_parents_.data()}; }

  Exec& exec_;
  TreeletInput tree_;
  LeafRule rule_;
  Buffer<float> costs_;
  Buffer<uint32_t> arrived_, merge_parents_, item_parents_;
};

/// Restructures the treelets of a tree on the processor.
void restructure(Bvh2& tree, uint32_t size, uint32_t rounds, const LeafRule& rule,
                 Progress& progress);

}  // namespace umbel::bvh
