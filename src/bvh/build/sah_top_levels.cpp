// SAH-built top levels, as HLBVH has above its treelets (Pantaleoni & Luebke, "HLBVH: Hierarchical
// LBVH Construction for Real-Time Ray Tracing of Dynamic Geometry", 2010). Agglomeration finds good
// small clusters, but where triangles are small and alike, a sweep makes a better tree of them.
#include "bvh/build/sah_top_levels.hpp"

#include <vector>

#include "bvh/build/builders.hpp"

namespace umbel::bvh {
namespace {

/// The merges above the clusters, and the clusters.
struct Merges {
  std::vector<uint32_t> merges;
  std::vector<Subtree> clusters;
  std::vector<Aabb> boxes;
  std::vector<uint32_t> counts;
  double area = 0;  ///< of the merges
};

Merges find_top(const BigVector<Merge>& merges, Subtree root, Boxes boxes, uint32_t most) {
  Merges top;
  std::vector<Subtree> open{root};
  while (!open.empty()) {
    const Subtree subtree = open.back();
    open.pop_back();
    const bool is_primitive = subtree.is_primitive();
    const uint32_t count = is_primitive ? 1 : merges[subtree.index()].count;
    if (count <= most) {
      top.clusters.push_back(subtree);
      top.counts.push_back(count);
      top.boxes.push_back(is_primitive ? boxes[subtree.index()] : merges[subtree.index()].box);
      continue;
    }
    const Merge& merge = merges[subtree.index()];
    top.merges.push_back(subtree.index());
    top.area += double(area_of(merge.box));
    open.push_back(merge.right);
    open.push_back(merge.left);
  }
  return top;
}

double inner_area(const Bvh2& tree) {
  double sum = 0;
  for (const Node& node : tree.nodes)
    if (!node.is_leaf()) sum += double(area_of(node.box()));
  return sum;
}

}  // namespace

Subtree sah_top_levels(BigVector<Merge>& merges, Subtree root, Boxes boxes, uint32_t most,
                       const Config& config) {
  const Merges top = find_top(merges, root, boxes, most);
  if (top.clusters.size() < 3) return root;
  const Bvh2 by_sah = sweep_clusters(top.boxes, top.counts, config);
  if (inner_area(by_sah) >= top.area) return root;
  std::vector<Subtree> subtrees(by_sah.nodes.size());
  uint32_t used = 0;
  for (size_t i = by_sah.nodes.size(); i-- > 0;) {
    const Node& node = by_sah.nodes[i];
    if (node.is_leaf()) {
      subtrees[i] = top.clusters[by_sah.primitives[node.first]];
      continue;
    }
    const auto count = [&](Subtree s) { return s.is_primitive() ? 1 : merges[s.index()].count; };
    const Subtree left = subtrees[node.first], right = subtrees[node.first + 1];
    const uint32_t merge = top.merges[used++];
    merges[merge] = {node.box(), left, right, count(left) + count(right)};
    subtrees[i] = Subtree::of_merge(merge);
  }
  return subtrees[0];
}

}  // namespace umbel::bvh
