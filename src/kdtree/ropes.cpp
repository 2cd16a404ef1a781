// Ropes: links from each face of a leaf to its neighbours there (Havran, Bittner & Zara, "Ray
// Tracing with Rope Trees", 1998), pushed down as far as a single subtree holds all of them.
#include <utility>

#include "base/parallel.hpp"
#include "kdtree/tree_data.hpp"

namespace umbel {
namespace {

using kdtree::Node;

struct Visit {
  uint32_t node;
  RopeLeaf rope;
};

/// The smallest subtree of `node` that has all neighbours of the cell across a face.
uint32_t pushed_down(const KdTreeData& data, uint32_t node, uint32_t face, const Aabb& cell) {
  while (!data.nodes[node].is_leaf()) {
    const Node& n = data.nodes[node];
    bool is_below = false;
    if (n.axis() == face / 2)
      is_below = face % 2 == 1;
    else if (n.at >= component(cell.max, n.axis()))
      is_below = true;
    else if (n.at > component(cell.min, n.axis()))
      break;
    node = is_below ? node + 1 : n.above();
  }
  return node;
}

}  // namespace

void make_ropes(KdTreeData& data) {
  if (data.nodes.empty() || !data.rope_leaves.empty()) return;
  BigVector<RopeLeaf> leaves;
  BigVector<uint32_t> leaf_of(data.nodes.size(), kNone);
  const Visit root{0, {data.bounds, {kNone, kNone, kNone, kNone, kNone, kNone}}};
  std::vector<Visit> stack{root};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    const Node& node = data.nodes[visit.node];
    if (node.is_leaf()) {
      leaf_of[visit.node] = static_cast<uint32_t>(leaves.size());
      leaves.push_back(visit.rope);
      continue;
    }
    Visit below = visit, above = visit;
    below.node = visit.node + 1;
    above.node = node.above();
    component(below.rope.cell.max, node.axis()) = node.at;
    component(above.rope.cell.min, node.axis()) = node.at;
    below.rope.ropes[2 * node.axis() + 1] = above.node;
    above.rope.ropes[2 * node.axis()] = below.node;
    stack.push_back(above);
    stack.push_back(below);
  }
  parallel_for(leaves.size(), 1024, [&](size_t i) {
    RopeLeaf& leaf = leaves[i];
    for (uint32_t face = 0; face < 6; ++face)
      if (leaf.ropes[face] != kNone)
        leaf.ropes[face] = pushed_down(data, leaf.ropes[face], face, leaf.cell);
  });
  data.rope_leaves = std::move(leaves);
  data.rope_leaf_of = std::move(leaf_of);
}

}  // namespace umbel
