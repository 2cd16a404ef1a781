// What a tree costs by the surface area heuristic (Goldsmith & Salmon, "Automatic creation of
// object hierarchies for ray tracing", 1987), and its size: binary trees and those with any number
// of children a node.
#include <algorithm>
#include <vector>

#include "bvh/tree/config.hpp"
#include "bvh/tree/node_area.hpp"

namespace umbel::bvh {
namespace {

uint32_t child_count(const Node& node) { return node.is_leaf() ? 0 : 2; }
uint32_t child_count(const KaryNode& node) { return node.children; }

template <typename Tree>
double cost_of(const Tree& tree, const CostModel& cost) {
  check_measure(cost);
  if (tree.nodes.empty()) return 0.0;
  const double root = half_area(tree.nodes[0]);
  double sum = 0.0;
  for (const auto& node : tree.nodes) {
    const double visit =
        node.is_leaf() ? double(cost.intersection) * node.count : double(cost.traversal);
    sum += root > 0 ? visit * half_area(node) / root : visit;
  }
  return sum;
}

template <typename Tree>
Statistics statistics_of(const Tree& tree, const CostModel& cost) {
  Statistics s{};
  s.nodes = static_cast<uint32_t>(tree.nodes.size());
  s.sah_cost = cost_of(tree, cost);
  s.bytes = tree.nodes.size() * sizeof tree.nodes[0] + tree.primitives.size() * sizeof(uint32_t);
  std::vector<uint32_t> depth(tree.nodes.size(), 0);
  for (size_t i = 0; i < tree.nodes.size(); ++i) {
    const auto& node = tree.nodes[i];
    if (node.is_leaf()) {
      ++s.leaves;
      s.references += node.count;
      s.max_depth = std::max(s.max_depth, depth[i]);
    }
    for (uint32_t k = 0; k < child_count(node); ++k) depth[node.first + k] = depth[i] + 1;
  }
  return s;
}

}  // namespace

double sah_cost(const Bvh2& tree, const CostModel& cost) { return cost_of(tree, cost); }
double sah_cost(const KaryTree& tree, const CostModel& cost) { return cost_of(tree, cost); }

Statistics statistics(const Bvh2& tree, const CostModel& cost) { return statistics_of(tree, cost); }
Statistics statistics(const KaryTree& tree, const CostModel& cost) {
  return statistics_of(tree, cost);
}

}  // namespace umbel::bvh
