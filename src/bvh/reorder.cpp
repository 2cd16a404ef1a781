// Depth-first layout: a traversal that goes into the larger child first, which is hit more often,
// finds what it needs next close by. Subtrees are laid out in parallel, and then put one after the
// other.
#include <algorithm>
#include <unordered_map>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "bvh/layout.hpp"
#include "bvh/node_area.hpp"

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

/// A subtree, with its root as node 0.
class Layout {
 public:
  Layout(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf)
      : tree_(tree), becomes_leaf_(becomes_leaf) {}

  Bvh2 run(uint32_t root) {
    out_.nodes.emplace_back();
    std::vector<Step> stack{{root, 0}};
    while (!stack.empty()) {
      const Step step = stack.back();
      stack.pop_back();
      Node node = tree_.nodes[step.from];
      if (node.is_leaf() || (!becomes_leaf_.empty() && becomes_leaf_[step.from])) {
        write_leaf(node, step.from, step.to);
        continue;
      }
      const auto pair = static_cast<uint32_t>(out_.nodes.size());
      const auto [second, first] = steps_into(tree_, node.first, pair);
      out_.nodes.resize(out_.nodes.size() + 2);
      node.first = pair;
      out_.nodes[step.to] = node;
      stack.push_back(second);
      stack.push_back(first);
    }
    return std::move(out_);
  }

 private:
  void write_leaf(Node node, uint32_t from, uint32_t to) {
    const auto start = static_cast<std::ptrdiff_t>(out_.primitives.size());
    below_.assign(1, from);
    while (!below_.empty()) {
      const Node& n = tree_.nodes[below_.back()];
      below_.pop_back();
      if (n.is_leaf()) {
        const auto first = tree_.primitives.begin() + n.first;
        out_.primitives.insert(out_.primitives.end(), first, first + n.count);
      } else {
        below_.push_back(n.first + 1);
        below_.push_back(n.first);
      }
    }
    const auto begin = out_.primitives.begin() + start;
    std::sort(begin, out_.primitives.end());
    if (!node.is_leaf())
      out_.primitives.erase(std::unique(begin, out_.primitives.end()), out_.primitives.end());
    node.first = static_cast<uint32_t>(start);
    node.count = static_cast<uint32_t>(out_.primitives.size() - static_cast<size_t>(start));
    out_.nodes[to] = node;
  }

  const Bvh2& tree_;
  const std::vector<uint8_t>& becomes_leaf_;
  Bvh2 out_;
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

/// Puts subtrees where the layout of the whole tree has them.
class Joiner {
 public:
  Joiner(const Bvh2& tree, const std::vector<uint32_t>& roots, const std::vector<Bvh2>& parts)
      : tree_(tree), parts_(parts), places_(parts.size()) {
    for (size_t i = 0; i < roots.size(); ++i) part_of_[roots[i]] = i;
  }

  Bvh2 run() {
    size_t nodes = 2 * parts_.size() - 1, primitives = 0;
    for (const Bvh2& part : parts_) {
      nodes += part.nodes.size() - 1;
      primitives += part.primitives.size();
    }
    out_.nodes.resize(nodes);
    out_.primitives.resize(primitives);
    lay_out_top();
    parallel_for(parts_.size(), 1, [&](size_t i) { copy(parts_[i], places_[i]); });
    return std::move(out_);
  }

 private:
  struct Place {
    uint32_t root, below, primitives;
  };

  void lay_out_top() {
    std::vector<Step> stack{{0, 0}};
    uint32_t nodes = 1, primitives = 0;
    while (!stack.empty()) {
      const Step step = stack.back();
      stack.pop_back();
      const auto part = part_of_.find(step.from);
      if (part != part_of_.end()) {
        const Bvh2& tree = parts_[part->second];
        places_[part->second] = {step.to, nodes, primitives};
        nodes += static_cast<uint32_t>(tree.nodes.size()) - 1;
        primitives += static_cast<uint32_t>(tree.primitives.size());
        continue;
      }
      Node node = tree_.nodes[step.from];
      const auto [second, first] = steps_into(tree_, node.first, nodes);
      node.first = nodes;
      nodes += 2;
      out_.nodes[step.to] = node;
      stack.push_back(second);
      stack.push_back(first);
    }
  }

  void copy(const Bvh2& part, const Place& place) {
    for (size_t i = 0; i < part.nodes.size(); ++i) {
      Node node = part.nodes[i];
      node.first += node.is_leaf() ? place.primitives : place.below - 1;
      out_.nodes[i == 0 ? place.root : place.below + i - 1] = node;
    }
    std::copy(part.primitives.begin(), part.primitives.end(),
              out_.primitives.begin() + place.primitives);
  }

  const Bvh2& tree_;
  const std::vector<Bvh2>& parts_;
  std::vector<Place> places_;
  std::unordered_map<uint32_t, size_t> part_of_;
  Bvh2 out_;
};

}  // namespace

Bvh2 laid_out(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf) {
  if (tree.nodes.empty()) return {};
  const std::vector<uint32_t> roots = roots_of_parts(tree, becomes_leaf);
  std::vector<Bvh2> parts(roots.size());
  parallel_for(parts.size(), 1,
               [&](size_t i) { parts[i] = Layout(tree, becomes_leaf).run(roots[i]); });
  return parts.size() == 1 ? std::move(parts[0]) : Joiner(tree, roots, parts).run();
}

void reorder(Bvh2& tree, const BuildOptions& options) {
  Progress progress(options);
  progress.report(0, "reordering");
  tree = laid_out(tree, {});
  progress.report(1, "reordering");
}

}  // namespace umbel::bvh
