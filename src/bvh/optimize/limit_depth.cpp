// A bound on depth for any tree. A subtree that is too deep keeps its top as long as the leaves of
// each child can still be told apart in the levels that are left; what cannot be kept is rebuilt by
// halving the sequence of its leaves, which the old tree left in a coherent order.
#include <algorithm>

#include "base/math.hpp"
#include "bvh/tree/config.hpp"

namespace umbel::bvh {
namespace {

class Limiter {
 public:
  Limiter(const Bvh2& tree, uint32_t max_depth) : tree_(tree), max_depth_(max_depth) {
    const size_t n = tree.nodes.size();
    height_.resize(n);
    leaves_.resize(n);
    for (size_t i = n; i-- > 0;) {
      const Node& node = tree.nodes[i];
      height_[i] = node.is_leaf() ? 0 : 1 + std::max(height_[node.first], height_[node.first + 1]);
      leaves_[i] = node.is_leaf() ? 1 : leaves_[node.first] + leaves_[node.first + 1];
    }
  }

  bool needed() const { return height_[0] > max_depth_; }

  std::vector<Node> run() {
    out_.reserve(tree_.nodes.size());
    out_.emplace_back();
    struct Step {
      uint32_t from, to, depth;
    };
    std::vector<Step> stack{{0, 0, 0}};
    while (!stack.empty()) {
      const Step s = stack.back();
      stack.pop_back();
      Node node = tree_.nodes[s.from];
      if (!node.is_leaf() && !can_keep(s.from, s.depth)) {
        rebuild(s.from, s.to);
        continue;
      }
      if (!node.is_leaf()) {
        const uint32_t left = node.first;
        node.first = add_pair();
        stack.push_back({left + 1, node.first + 1, s.depth + 1});
        stack.push_back({left, node.first, s.depth + 1});
      }
      out_[s.to] = node;
    }
    return std::move(out_);
  }

 private:
  bool can_keep(uint32_t index, uint32_t depth) const {
    if (depth + height_[index] <= max_depth_) return true;
    const uint32_t left = tree_.nodes[index].first;
    return depth < max_depth_ && fits_depth(leaves_[left], max_depth_ - depth - 1) &&
           fits_depth(leaves_[left + 1], max_depth_ - depth - 1);
  }

  uint32_t add_pair() {
    const auto pair = static_cast<uint32_t>(out_.size());
    out_.resize(out_.size() + 2);
    return pair;
  }

  void rebuild(uint32_t from, uint32_t to) {
    leaves_below_.clear();
    std::vector<uint32_t> stack{from};
    while (!stack.empty()) {
      const Node& node = tree_.nodes[stack.back()];
      stack.pop_back();
      if (node.is_leaf()) {
        leaves_below_.push_back(node);
      } else {
        stack.push_back(node.first + 1);
        stack.push_back(node.first);
      }
    }
    halve(0, static_cast<uint32_t>(leaves_below_.size()), to);
  }

  // As deep as the logarithm of the number of leaves.
  void halve(uint32_t begin, uint32_t end, uint32_t to) {
    if (end - begin == 1) {
      out_[to] = leaves_below_[begin];
      return;
    }
    const uint32_t pair = add_pair(), middle = begin + (end - begin) / 2;
    halve(begin, middle, pair);
    halve(middle, end, pair + 1);
    Aabb box = out_[pair].box();
    extend(box, out_[pair + 1].box());
    out_[to] = {box.min, pair, box.max, 0};
  }

  const Bvh2& tree_;
  const uint32_t max_depth_;
  std::vector<uint32_t> height_, leaves_;
  std::vector<Node> out_, leaves_below_;
};

}  // namespace

void limit_depth(Bvh2& tree, uint32_t max_depth) {
  if (tree.nodes.empty()) return;
  Limiter limiter(tree, max_depth);
  if (limiter.needed()) tree.nodes = limiter.run();
}

}  // namespace umbel::bvh
