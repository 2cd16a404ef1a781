// The traversal to every leaf whose boxes pass a test, over any structure.
//
// Queries see the nodes of any structure through a class with
//   kWidth, kDepth              children a node, deepest level of a leaf
//   Link                        names a node or a leaf; kNoLink is neither
//   root(), is_leaf(link)
//   children(link)              the boxes and links of a node's children
//   visit_runs(link, visit)     calls visit(run) for the leaf store's runs of a leaf
//   repeats()                   whether a triangle may be in several leaves
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace umbel {

/// Deepest tree there is: 255 levels of Config::max_depth, and those of leaves of up to 255
/// triangles that had to be divided.
inline constexpr uint32_t kMaxTraversalDepth = 288;

/// A node's boxes, one array a plane.
template <uint32_t kWidth>
struct NodeBoxes {
  const float* planes;
  const float* min_x() const { return planes; }
  const float* max_x() const { return planes + kWidth; }
  const float* min_y() const { return planes + 2 * kWidth; }
  const float* max_y() const { return planes + 3 * kWidth; }
  const float* min_z() const { return planes + 4 * kWidth; }
  const float* max_z() const { return planes + 5 * kWidth; }
};

/// Every leaf whose boxes pass a test, in no particular order. `test(NodeBoxes, uint32_t* passes)`
/// sets passes[child] for each child, to anything for those that are not there; `run(link)` takes
/// runs.
template <typename Nodes, typename Test, typename Run>
void traverse_leaves(const Nodes& nodes, const Test& test, const Run& run) {
  using Link = typename Nodes::Link;
  if (nodes.is_leaf(nodes.root())) return nodes.visit_runs(nodes.root(), run);
  std::array<Link, Nodes::kDepth*(Nodes::kWidth - 1) + 1> stack;
  size_t waiting = 0;
  stack[waiting++] = nodes.root();
  while (waiting > 0) {
    const auto children = nodes.children(stack[--waiting]);
    uint32_t passes[Nodes::kWidth];
    test(children.boxes(), passes);
    for (uint32_t child = 0; child < Nodes::kWidth; ++child) {
      const Link link = children.link(child);
      if (!passes[child] || link == Nodes::kNoLink) continue;
      if (nodes.is_leaf(link))
        nodes.visit_runs(link, run);
      else
        stack[waiting++] = link;
    }
  }
}

}  // namespace umbel
