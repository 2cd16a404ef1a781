#include "bvh/build/tree_parts.hpp"

#include "base/big_vector.hpp"
#include "bvh/tree/leaf_order.hpp"

namespace umbel::bvh {

void finish_leaf(Node& leaf, uint32_t leaf_base, std::vector<uint32_t>& primitives) {
  leaf.first += leaf_base;
  sort_leaf(primitives.data() + leaf.first, leaf.count);
}

void copy_part(const TreePart& part, uint32_t base, Node* nodes,
               std::vector<uint32_t>& primitives) {
  const uint32_t count = 2 * part.pairs, end = base + count;
  const Node* from = part.nodes_end - count;
  for (uint32_t i = 0; i < count; ++i) {
    Node node = from[i];
    if (node.is_leaf()) {
      finish_leaf(node, part.leaf_base, primitives);
    } else {
      node.first = end - node.first;
    }
    nodes[base + i] = node;
  }
}

namespace {

class Joiner {
 public:
  Joiner(std::span<const TopNode> top, std::span<const TreePart> parts,
         std::vector<uint32_t> primitives)
      : top_(top), parts_(parts), above_(top.size()), bases_(parts.size()) {
    tree_.primitives = std::move(primitives);
  }

  Bvh2 join() {
    for (size_t t = top_.size(); t-- > 0;) unite(t);
    const uint32_t root = top_.empty() ? ~0u : 0u;
    const size_t nodes = 2 * size_t(child(root).pairs) + 1;
    reserve_big(tree_.nodes, nodes);
    tree_.nodes.resize(nodes);
    write_root(root, 1, 0);
    for (size_t t = 0; t < top_.size(); ++t) {
      const uint32_t base = above_[t].root.first;
      write_root(top_[t].left, base + 2, base);
      write_root(top_[t].right, base + 2 + 2 * child(top_[t].left).pairs, base + 1);
    }
    parallel_for(parts_.size(), 1, [&](size_t s) {
      copy_part(parts_[s], bases_[s], tree_.nodes.data(), tree_.primitives);
    });
    return std::move(tree_);
  }

 private:
  const TreePart& child(uint32_t id) const {
    return static_cast<int32_t>(id) < 0 ? parts_[~id] : above_[id];
  }

  void unite(size_t t) {
    const TreePart &left = child(top_[t].left), &right = child(top_[t].right);
    Aabb box = left.root.box();
    extend(box, right.root.box());
    above_[t] = {{box.min, 0, box.max, 0}, left.pairs + right.pairs + 1, nullptr, 0};
  }

  /// The nodes below this child begin at `base`; it is itself the node `slot`.
  void write_root(uint32_t id, uint32_t base, uint32_t slot) {
    Node& node = tree_.nodes[slot];
    node = child(id).root;
    if (static_cast<int32_t>(id) < 0) {
      bases_[~id] = base;
      if (node.is_leaf()) finish_leaf(node, parts_[~id].leaf_base, tree_.primitives);
    } else {
      above_[id].root.first = base;
    }
    if (!node.is_leaf()) node.first = base;
  }

  std::span<const TopNode> top_;
  std::span<const TreePart> parts_;
  std::vector<TreePart> above_;
  std::vector<uint32_t> bases_;  // where the nodes below each subtree begin
  Bvh2 tree_;
};

}  // namespace

Bvh2 join_parts(std::span<const TopNode> top, std::span<const TreePart> parts,
                std::vector<uint32_t> primitives) {
  return Joiner(top, parts, std::move(primitives)).join();
}

}  // namespace umbel::bvh
