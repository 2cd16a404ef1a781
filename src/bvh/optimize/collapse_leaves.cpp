// Leaves by cost: bottom-up, every subtree that costs no more as one leaf becomes one (as in Karras
// & Aila, "Fast parallel construction of high-quality bounding volume hierarchies", 2013).
#include <vector>

#include "base/progress.hpp"
#include "bvh/tree/config.hpp"
#include "bvh/tree/layout.hpp"
#include "bvh/tree/node_area.hpp"

namespace umbel::bvh {
void collapse_leaves(Bvh2& tree, const CostModel& cost, uint32_t max_leaf_size,
                     const BuildOptions& options) {
  check_cost(cost);
  if (tree.nodes.empty()) return;
  Progress progress(options);
  progress.report(0, "collapsing leaves");
  struct Below {
    double cost;
    uint32_t count;
  };
  const size_t n = tree.nodes.size();
  std::vector<Below> below(n);
  std::vector<uint8_t> becomes_leaf(n, 0);
  // Without area a line meets every node or none.
  const bool has_area = half_area(tree.nodes[0]) > 0;
  for (size_t i = n; i-- > 0;) {
    const Node& node = tree.nodes[i];
    const double area = has_area ? half_area(node) : 1.0;
    if (node.is_leaf()) {
      below[i] = {area * double(cost.intersection) * node.count, node.count};
      continue;
    }
    const Below &left = below[node.first], &right = below[node.first + 1];
    const uint32_t count = left.count + right.count;
    const double split = area * double(cost.traversal) + left.cost + right.cost;
    const double leaf = area * double(cost.intersection) * count;
    becomes_leaf[i] = count <= max_leaf_size && leaf <= split;
    below[i] = {becomes_leaf[i] ? leaf : split, count};
  }
  progress.report(0.5, "collapsing leaves");
  tree = laid_out(tree, becomes_leaf);
  progress.report(1, "collapsing leaves");
}

}  // namespace umbel::bvh
