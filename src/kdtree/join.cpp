// Joins the parts of a tree in depth-first order, and lets leaves with the same triangles share
// one list.
#include "base/hash.hpp"
#include "kdtree/grow.hpp"

namespace umbel::kdtree {
namespace {

class Joiner {
 public:
  explicit Joiner(Tree& tree) : tree_(tree) {}

  void add(const Branch& branch) {
    if (!branch.below) {
      add(branch.subtree);
      return;
    }
    const size_t index = tree_.nodes.size();
    tree_.nodes.emplace_back();
    add(*branch.below);
    tree_.nodes[index] =
        Node::inner(branch.split.axis, branch.split.at, static_cast<uint32_t>(tree_.nodes.size()));
    add(*branch.above);
  }

 private:
  void add(const Subtree& part) {
    const auto base = static_cast<uint32_t>(tree_.nodes.size());
    for (const Node& node : part.nodes) {
      if (node.is_leaf()) {
        const std::span list(part.references.data() + node.first, node.count());
        tree_.nodes.push_back(Node::leaf(offset_of(list), node.count()));
      } else {
        tree_.nodes.push_back(Node::inner(node.axis(), node.at, base + node.above()));
      }
    }
  }

  /// Where a list lies; leaves that share one are neighbours mostly, so a small table that forgets
  /// finds nearly all.
  uint32_t offset_of(std::span<const uint32_t> list) {
    if (list.empty()) return 0;
    Known& known = known_[xxh64(list.data(), list.size_bytes()) % known_.size()];
    if (known.count == list.size() &&
        std::equal(list.begin(), list.end(), tree_.references.begin() + known.first))
      return known.first;
    known = {static_cast<uint32_t>(tree_.references.size()), static_cast<uint32_t>(list.size())};
    tree_.references.insert(tree_.references.end(), list.begin(), list.end());
    return known.first;
  }

  struct Known {
    uint32_t first = 0, count = 0;
  };
  Tree& tree_;
  std::vector<Known> known_ = std::vector<Known>(4096);
};

}  // namespace

Tree join(const Branch& root, const Aabb& bounds) {
  Tree tree;
  tree.bounds = bounds;
  Joiner(tree).add(root);
  tree.nodes.shrink_to_fit();
  tree.references.shrink_to_fit();
  return tree;
}

}  // namespace umbel::kdtree
