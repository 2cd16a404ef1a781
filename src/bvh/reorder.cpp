// Depth-first layout: a traversal that goes into the larger child first, which is hit more often,
// finds what it needs next close by.
#include <algorithm>

#include "base/progress.hpp"
#include "bvh/layout.hpp"

namespace umbel::bvh {
namespace {

double half_area(const Node& n) {
  const double x = double(n.max.x) - double(n.min.x), y = double(n.max.y) - double(n.min.y),
               z = double(n.max.z) - double(n.min.z);
  return x * y + y * z + z * x;
}

class Layout {
 public:
  Layout(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf)
      : tree_(tree), becomes_leaf_(becomes_leaf) {}

  Bvh2 run() {
    if (tree_.nodes.empty()) return {};
    out_.nodes.reserve(tree_.nodes.size());
    out_.primitives.reserve(tree_.primitives.size());
    out_.nodes.emplace_back();
    struct Step {
      uint32_t from, to;
    };
    std::vector<Step> stack{{0, 0}};
    while (!stack.empty()) {
      const Step step = stack.back();
      stack.pop_back();
      Node node = tree_.nodes[step.from];
      if (node.is_leaf() || (!becomes_leaf_.empty() && becomes_leaf_[step.from])) {
        write_leaf(node, step.from, step.to);
        continue;
      }
      const uint32_t left = node.first, pair = static_cast<uint32_t>(out_.nodes.size());
      out_.nodes.resize(out_.nodes.size() + 2);
      node.first = pair;
      out_.nodes[step.to] = node;
      const uint32_t right_first =
          half_area(tree_.nodes[left]) < half_area(tree_.nodes[left + 1]) ? 1 : 0;
      stack.push_back({left + 1 - right_first, pair + 1 - right_first});
      stack.push_back({left + right_first, pair + right_first});
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

}  // namespace

Bvh2 laid_out(const Bvh2& tree, const std::vector<uint8_t>& becomes_leaf) {
  return Layout(tree, becomes_leaf).run();
}

void reorder(Bvh2& tree, const BuildOptions& options) {
  Progress progress(options);
  progress.report(0, "reordering");
  tree = laid_out(tree, {});
  progress.report(1, "reordering");
}

}  // namespace umbel::bvh
