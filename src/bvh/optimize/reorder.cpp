// Depth-first layout: a traversal that goes into the larger child first, which is hit more often,
// finds what it needs next close by. Subtrees are laid out in parallel, and then put one after the
// other.
#include <algorithm>
#include <unordered_set>

#include "base/big_vector.hpp"
#include "base/in_order.hpp"
#include "base/progress.hpp"
#include "bvh/tree/layout.hpp"
#include "bvh/tree/leaf_order.hpp"
#include "bvh/tree/node_area.hpp"

namespace umbel::bvh {
namespace {

/// Where a node goes.
struct Step {
  uint32_t from, to;
};

/// The children of a node, whose new pair they are, in the order in which a stack gives the larger
/// one first.
std::pair<Step, Step> steps_into(const Bvh2& tree, uint32_t left, uint32_t pair) {
  const uint32_t larger = half_area(tree.nodes[left]) < half_area(tree.nodes[left + 1]) ? 1 : 0;
  return {{left + 1 - larger, pair + 1 - larger}, {left + larger, pair + larger}};
}

/// A subtree, with its root as node 0. Used again it needs no fresh memory.
class Layout {
 public:
  void run(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf, uint32_t root) {
    nodes.assign(1, {});
    primitives.clear();
    std::vector<Step>& stack = stack_;
    stack.assign(1, {root, 0});
    while (!stack.empty()) {
      const Step step = stack.back();
      stack.pop_back();
      Node node = tree.nodes[step.from];
      if (node.is_leaf() || (!becomes_leaf.empty() && becomes_leaf[step.from])) {
        write_leaf(tree, step.from, step.to);
        continue;
      }
      const auto pair = static_cast<uint32_t>(nodes.size());
      const auto [second, first] = steps_into(tree, node.first, pair);
      nodes.resize(nodes.size() + 2);
      node.first = pair;
      nodes[step.to] = node;
      stack.push_back(second);
      stack.push_back(first);
    }
  }

  std::vector<Node> nodes;
  std::vector<uint32_t> primitives;

 private:
  void write_leaf(const Bvh2& tree, uint32_t from, uint32_t to) {
    const size_t start = primitives.size();
    below_.assign(1, from);
    while (!below_.empty()) {
      const Node& n = tree.nodes[below_.back()];
      below_.pop_back();
      if (n.is_leaf()) {
        const auto first = tree.primitives.begin() + n.first;
        primitives.insert(primitives.end(), first, first + n.count);
      } else {
        below_.push_back(n.first + 1);
        below_.push_back(n.first);
      }
    }
    Node node = tree.nodes[from];
    sort_leaf(primitives.data() + start, static_cast<uint32_t>(primitives.size() - start));
    if (!node.is_leaf()) {
      const auto begin = primitives.begin() + static_cast<std::ptrdiff_t>(start);
      primitives.erase(std::unique(begin, primitives.end()), primitives.end());
    }
    node.first = static_cast<uint32_t>(start);
    node.count = static_cast<uint32_t>(primitives.size() - start);
    nodes[to] = node;
  }

  std::vector<Step> stack_;
  std::vector<uint32_t> below_;
};

/// The roots of subtrees that together hold all but the top of a tree.
std::vector<uint32_t> roots_of_parts(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf) {
  constexpr size_t kSmall = size_t{1} << 14, kParts = 128;
  std::vector<uint32_t> open{0};
  if (tree.nodes.size() < kSmall) return open;
  std::vector<uint32_t> roots;
  for (size_t i = 0; i < open.size(); ++i) {
    const Node& node = tree.nodes[open[i]];
    if (open.size() - i + roots.size() >= kParts || node.is_leaf() ||
        (!becomes_leaf.empty() && becomes_leaf[open[i]])) {
      roots.push_back(open[i]);
    } else {
      open.push_back(node.first);
      open.push_back(node.first + 1);
    }
  }
  return roots;
}

/// Lays out subtrees one after the other, in the order of the whole tree.
class Writer {
 public:
  Writer(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf,
         const std::vector<uint32_t>& roots)
      : tree_(tree), becomes_leaf_(becomes_leaf), is_root_(roots.begin(), roots.end()) {
    reserve_big(out_.nodes, tree.nodes.size());
    out_.primitives.reserve(tree.primitives.size());
    nodes_ = out_.nodes.data();
    primitives_ = out_.primitives.data();
    out_.nodes.resize(1);
  }

  Bvh2 run() {
    struct Scratch {
      Layout layout;
      uint32_t root = 0, below = 0, primitives = 0;
    };
    const std::vector<uint32_t> roots = in_their_order();
    stack_.assign(1, {0, 0});
    in_order<Scratch>(
        roots.size(), [&](size_t i, Scratch& s) { s.layout.run(tree_, becomes_leaf_, roots[i]); },
        [&](size_t /*i*/, Scratch& s) {
          s.root = next_root();
          s.below = static_cast<uint32_t>(out_.nodes.size());
          s.primitives = static_cast<uint32_t>(out_.primitives.size());
          out_.nodes.resize(s.below + s.layout.nodes.size() - 1);
          out_.primitives.resize(s.primitives + s.layout.primitives.size());
        },
        [&](size_t /*i*/, Scratch& s) {
          const auto moved = [&](Node node) {
            node.first += node.is_leaf() ? s.primitives : s.below - 1;
            return node;
          };
          nodes_[s.root] = moved(s.layout.nodes[0]);
          std::transform(s.layout.nodes.begin() + 1, s.layout.nodes.end(), nodes_ + s.below, moved);
          std::copy(s.layout.primitives.begin(), s.layout.primitives.end(),
                    primitives_ + s.primitives);
        });
    return std::move(out_);
  }

 private:
  std::vector<uint32_t> in_their_order() const {
    std::vector<uint32_t> roots;
    std::vector<Step> stack{{0, 0}};
    while (!stack.empty()) {
      const uint32_t at = stack.back().from;
      stack.pop_back();
      if (is_root_.contains(at)) {
        roots.push_back(at);
        continue;
      }
      const auto [second, first] = steps_into(tree_, tree_.nodes[at].first, 0);
      stack.push_back(second);
      stack.push_back(first);
    }
    return roots;
  }

  /// Writes the nodes above the next root, and returns where it goes.
  uint32_t next_root() {
    while (true) {
      const Step step = stack_.back();
      stack_.pop_back();
      if (is_root_.contains(step.from)) return step.to;
      const auto pair = static_cast<uint32_t>(out_.nodes.size());
      out_.nodes.resize(out_.nodes.size() + 2);
      Node node = tree_.nodes[step.from];
      const auto [second, first] = steps_into(tree_, node.first, pair);
      node.first = pair;
      nodes_[step.to] = node;
      stack_.push_back(second);
      stack_.push_back(first);
    }
  }

  const Bvh2& tree_;
  const std::vector<uint8_t>& becomes_leaf_;
  std::unordered_set<uint32_t> is_root_;
  std::vector<Step> stack_;  // what is above the roots that are left
  Bvh2 out_;
  Node* nodes_;
  uint32_t* primitives_;
};

}  // namespace

Bvh2 laid_out(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf) {
  if (tree.nodes.empty()) return {};
  return Writer(tree, becomes_leaf, roots_of_parts(tree, becomes_leaf)).run();
}

void reorder(Bvh2& tree, const BuildOptions& options) {
  Progress progress(options);
  progress.report(0, "reordering");
  tree = laid_out(tree, {});
  progress.report(1, "reordering");
}

}  // namespace umbel::bvh
