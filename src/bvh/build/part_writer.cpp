#include "bvh/build/part_writer.hpp"

#include <utility>

#include "base/big_vector.hpp"
#include "base/cpu_buffer.hpp"
#include "base/in_order.hpp"

namespace umbel::bvh {
namespace {

/// A child: a node above the parts, or ~part. And the node that it is in the tree.
struct ChildStep {
  uint32_t id, slot;
};

class PartWriter {
 public:
  PartWriter(std::span<const TopNode> top, const MostNodes& most, std::vector<uint32_t> primitives,
             const BuildPart& build)
      : top_(top), pairs_(top.size()), slots_(top.size()), most_(most), build_(build) {
    tree_.primitives = std::move(primitives);
    reserve_big(tree_.nodes, most.tree);
    tree_.nodes.resize(1);
    nodes_ = tree_.nodes.data();
    steps_.push_back({top.empty() ? ~0u : 0u, 0});
  }

  Bvh2 run() {
    struct Scratch {
      CpuBuffer<Node> nodes;
      TreePart part;
      uint32_t base;  ///< of the nodes below it
    };
    const std::vector<uint32_t> parts = left_to_right();
    in_order<Scratch>(
        parts.size(),
        [&](size_t i, Scratch& s) {
          if (s.nodes.size() == 0) s.nodes = CpuBuffer<Node>(most_.part);
          s.part = build_(parts[i], s.nodes.data() + s.nodes.size());
        },
        [&](size_t /*i*/, Scratch& s) { s.base = reserve_for(s.part); },
        [&](size_t /*i*/, Scratch& s) { copy_part(s.part, s.base, nodes_, tree_.primitives); });
    unite_top();
    return std::move(tree_);
  }

 private:
  /// The parts from left to right.
  std::vector<uint32_t> left_to_right() const {
    std::vector<uint32_t> parts, open{steps_[0].id};
    while (!open.empty()) {
      const uint32_t id = open.back();
      open.pop_back();
      if (static_cast<int32_t>(id) < 0) {
        parts.push_back(~id);
      } else {
        open.push_back(top_[id].right);
        open.push_back(top_[id].left);
      }
    }
    return parts;
  }

  /// Where the nodes go that are below the root of the next part.
  uint32_t reserve_for(const TreePart& part) {
    auto nodes = static_cast<uint32_t>(tree_.nodes.size());
    while (static_cast<int32_t>(steps_.back().id) >= 0) {
      const ChildStep step = steps_.back();
      pairs_[step.id] = nodes;
      slots_[step.id] = step.slot;
      steps_.back() = {top_[step.id].right, nodes + 1};
      steps_.push_back({top_[step.id].left, nodes});
      nodes += 2;
    }
    const uint32_t slot = steps_.back().slot;
    steps_.pop_back();
    tree_.nodes.resize(nodes + 2 * size_t(part.pairs));
    Node& root = nodes_[slot];
    root = part.root;
    if (root.is_leaf())
      finish_leaf(root, part.leaf_base, tree_.primitives);
    else
      root.first = nodes;
    return nodes;
  }

  void unite_top() {
    for (size_t t = top_.size(); t-- > 0;) {
      const uint32_t pair = pairs_[t];
      Aabb box = tree_.nodes[pair].box();
      extend(box, tree_.nodes[pair + 1].box());
      tree_.nodes[slots_[t]] = {box.min, pair, box.max, 0};
    }
  }

  std::span<const TopNode> top_;
  std::vector<uint32_t> pairs_, slots_;  // of the nodes above: their children, themselves
  std::vector<ChildStep> steps_;         // what is still to be placed, the next one last
  MostNodes most_;
  const BuildPart& build_;
  Bvh2 tree_;
  Node* nodes_ = nullptr;
};

}  // namespace

Bvh2 write_parts(std::span<const TopNode> top, const MostNodes& most,
                 std::vector<uint32_t> primitives, const BuildPart& build) {
  return PartWriter(top, most, std::move(primitives), build).run();
}

}  // namespace umbel::bvh
