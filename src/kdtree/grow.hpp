// The recursion that every builder of kd-trees shares: when to split, when to stop, how a subtree
// that did not pay becomes a leaf, and how subtrees are built in parallel. Nothing depends on the
// number of threads: what runs in parallel is decided by counts of triangles alone.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "base/shared_progress.hpp"
#include "kdtree/split_cost.hpp"

namespace umbel::kdtree {

/// What a subtree may use up.
struct Allowance {
  uint32_t levels;       ///< below
  uint32_t bad_refines;  ///< splits that may cost more than a leaf
  uint64_t spare;        ///< references more than there are
};

/// Nodes and references in depth-first order, numbered from 0.
struct Subtree {
  std::vector<Node> nodes;
  std::vector<uint32_t> references;
};

/// A part of the tree that one task builds, or a split with two of them.
struct Branch {
  std::unique_ptr<Branch> below, above;
  Split split;
  Subtree subtree;
};

/// Whether the best split of a cell is taken.
inline bool is_worth(const CostRule& rule, const Split& split, uint32_t count,
                     const Allowance& left, bool& is_bad) {
  constexpr uint32_t kFew = 16;  // with these a bad split seldom leads to good ones
  if (count <= rule.target_leaf_size || left.levels == 0 || !split.exists()) return false;
  const double leaf = rule.leaf(count);
  is_bad = split.cost >= leaf;
  if (!is_bad) return true;
  return left.bad_refines > 0 && count >= kFew;
}

/// Hands down what is left: spare references in proportion to those that there are.
inline std::pair<Allowance, Allowance> shares(const Allowance& left, uint32_t count, bool is_bad,
                                              uint32_t below, uint32_t above) {
  Allowance next = left;
  --next.levels;
  next.bad_refines -= is_bad ? 1 : 0;
  const uint64_t total = uint64_t{below} + above;
  next.spare -= total > count ? total - count : 0;
  Allowance first = next, second = next;
  first.spare = total == 0 ? 0 : next.spare * below / total;
  second.spare = next.spare - first.spare;
  return {first, second};
}

inline void add_leaf(std::span<const uint32_t> triangles, Subtree& out) {
  const auto first = static_cast<uint32_t>(out.references.size());
  out.nodes.push_back(Node::leaf(first, static_cast<uint32_t>(triangles.size())));
  out.references.insert(out.references.end(), triangles.begin(), triangles.end());
  std::sort(out.references.begin() + first, out.references.end());
}

/// Makes one leaf of the subtree that begins there.
inline void join_leaves(size_t node, size_t reference, Subtree& out) {
  out.nodes.resize(node);
  const auto first = out.references.begin() + static_cast<std::ptrdiff_t>(reference);
  std::sort(first, out.references.end());
  out.references.erase(std::unique(first, out.references.end()), out.references.end());
  out.nodes.push_back(Node::leaf(static_cast<uint32_t>(reference),
                                 static_cast<uint32_t>(out.references.size() - reference)));
}

/// `Set` holds the triangles of a cell:
///   size()                           how many
///   best_split(cell)                 the cheapest plane there is
///   split(cell, split, below, above) fills two sets; false if they would hold more than
///                                    size() + spare triangles
///   triangles()                      their numbers
///   is_small()                       whether grow_small(...) is to take over
template <typename Set>
class Grower {
 public:
  Grower(const CostRule& rule, Progress& progress)
      : rule_(rule), progress_(progress, "splitting", 0.1, 0.95, kAll) {}

  void build(Set set, const Aabb& cell, const Allowance& left, Branch& root) {
    grow(std::move(set), cell, left, root, kAll);
    progress_.finish();
  }

 private:
  /// `share` is that of the branch in all of the work.
  void grow(Set set, const Aabb& cell, const Allowance& left, Branch& branch, uint64_t share) {
    progress_.add(0);
    if (progress_.is_stopped()) return;
    if (set.size() <= kSequential) {
      grow_here(set, cell, left, branch.subtree);
      progress_.add(share);
      return;
    }
    const Split split = set.best_split(cell);
    bool is_bad = false;
    Set below, above;
    if (!is_worth(rule_, split, set.size(), left, is_bad) ||
        !set.split(cell, split, left.spare, below, above)) {
      add_leaf(set.triangles(), branch.subtree);
      progress_.add(share);
      return;
    }
    const auto [first, second] = shares(left, set.size(), is_bad, below.size(), above.size());
    const uint64_t total = std::max(uint64_t{below.size()} + above.size(), uint64_t{1});
    const uint64_t share_below = share * below.size() / total;
    set = Set();
    branch.split = split;
    branch.below = std::make_unique<Branch>();
    branch.above = std::make_unique<Branch>();
    parallel_invoke(
        [&, &a = first] {
          grow(std::move(below), cell_below(cell, split), a, *branch.below, share_below);
        },
        [&, &a = second] {
          grow(std::move(above), cell_above(cell, split), a, *branch.above, share - share_below);
        });
  }

  /// The expected cost of a line through the cell.
  double grow_here(const Set& set, const Aabb& cell, const Allowance& left, Subtree& out) const {
    if (set.is_small()) return set.grow_small(rule_, cell, left, out);
    const Split split = set.best_split(cell);
    bool is_bad = false;
    Set below, above;
    if (!is_worth(rule_, split, set.size(), left, is_bad) ||
        !set.split(cell, split, left.spare, below, above)) {
      add_leaf(set.triangles(), out);
      return rule_.leaf(set.size());
    }
    const auto [first, second] = shares(left, set.size(), is_bad, below.size(), above.size());
    const size_t node = out.nodes.size(), reference = out.references.size();
    const Aabb low = cell_below(cell, split), high = cell_above(cell, split);
    out.nodes.emplace_back();
    const double cost_below = grow_here(below, low, first, out);
    const auto middle = static_cast<uint32_t>(out.nodes.size());
    const double cost_above = grow_here(above, high, second, out);
    out.nodes[node] = Node::inner(split.axis, split.at, middle);
    const double cost =
        rule_.traversal +
        (rule_.area(low) * cost_below + rule_.area(high) * cost_above) / rule_.area(cell);
    if (cost < rule_.leaf(set.size())) return cost;
    out.nodes.resize(node);
    out.references.resize(reference);
    add_leaf(set.triangles(), out);
    return rule_.leaf(set.size());
  }

  static constexpr uint32_t kSequential = 1u << 12;
  static constexpr uint64_t kAll = uint64_t{1} << 32;
  const CostRule& rule_;
  SharedProgress progress_;
};

/// All parts as one tree.
Tree join(const Branch& root, const Aabb& bounds);

}  // namespace umbel::kdtree
