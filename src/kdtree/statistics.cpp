// What a kd-tree costs by the surface area heuristic, and its size.
#include "kdtree/split_cost.hpp"

namespace umbel::kdtree {
namespace {

struct Place {
  uint32_t node, depth;
  Aabb cell;
};

// In double: neither the largest nor the smallest cells overflow or vanish.
double half_area(const Aabb& cell) {
  const double x = double(cell.max.x) - double(cell.min.x),
               y = double(cell.max.y) - double(cell.min.y),
               z = double(cell.max.z) - double(cell.min.z);
  return x * (y + z) + y * z;
}

}  // namespace

Statistics statistics(const Tree& tree, const bvh::CostModel& cost) {
  Statistics s{};
  s.nodes = static_cast<uint32_t>(tree.nodes.size());
  s.bytes = tree.nodes.size() * sizeof(Node) + tree.references.size() * sizeof(uint32_t);
  if (tree.nodes.empty()) return s;
  const double whole = half_area(tree.bounds);
  std::vector<Place> stack{{0, 0, tree.bounds}};
  while (!stack.empty()) {
    const Place place = stack.back();
    stack.pop_back();
    const Node& node = tree.nodes[place.node];
    // Where there is no area, every node is visited.
    const double share = whole > 0 ? half_area(place.cell) / whole : 1;
    if (node.is_leaf()) {
      ++s.leaves;
      s.empty_leaves += node.count() == 0;
      s.max_depth = std::max(s.max_depth, place.depth);
      s.references += node.count();
      s.leaf_visits += share;
      s.tests += share * node.count();
      continue;
    }
    s.inner_visits += share;
    const Split split{0, node.at, node.axis(), false};
    stack.push_back({node.above(), place.depth + 1, cell_above(place.cell, split)});
    stack.push_back({place.node + 1, place.depth + 1, cell_below(place.cell, split)});
  }
  s.sah_cost = double(cost.traversal) * s.inner_visits + double(cost.intersection) * s.tests;
  return s;
}

}  // namespace umbel::kdtree
