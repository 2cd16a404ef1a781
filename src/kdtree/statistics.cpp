// What a kd-tree costs by the surface area heuristic, and its size.
#include <algorithm>

#include "bvh/tree/config.hpp"
#include "query/cells.hpp"
#include "umbel/kdtree.hpp"

namespace umbel::kdtree {
namespace {

struct MeasuredNode {
  uint32_t node, depth;
  Aabb cell;
};

}  // namespace

Statistics statistics(const Tree& tree, const bvh::CostModel& cost) {
  bvh::check_measure(cost);
  Statistics s{};
  s.nodes = static_cast<uint32_t>(tree.nodes.size());
  s.bytes = tree.nodes.size() * sizeof(Node) + tree.references.size() * sizeof(uint32_t);
  if (tree.nodes.empty()) return s;
  const double whole = cell_area(tree.bounds);
  std::vector<MeasuredNode> stack{{0, 0, tree.bounds}};
  while (!stack.empty()) {
    const MeasuredNode visit = stack.back();
    stack.pop_back();
    const Node& node = tree.nodes[visit.node];
    // Where there is no area, every node is visited.
    const double share = whole > 0 ? cell_area(visit.cell) / whole : 1;
    if (node.is_leaf()) {
      ++s.leaves;
      s.empty_leaves += node.count() == 0;
      s.max_depth = std::max(s.max_depth, visit.depth);
      s.references += node.count();
      s.leaf_visits += share;
      s.tests += share * node.count();
      continue;
    }
    s.inner_visits += share;
    stack.push_back({node.above(), visit.depth + 1, cell_above(visit.cell, node.axis(), node.at)});
    stack.push_back(
        {visit.node + 1, visit.depth + 1, cell_below(visit.cell, node.axis(), node.at)});
  }
  s.sah_cost = double(cost.traversal) * s.inner_visits + double(cost.intersection) * s.tests;
  return s;
}

}  // namespace umbel::kdtree
