// Nodes as boxes and links, and the walk to every leaf whose boxes pass a test.
#pragma once

#include <array>
#include <type_traits>

#include "bvh/wide/triangle_bvh_data.hpp"

namespace umbel {

/// Deepest tree there is: 255 levels of Config::max_depth, and those of leaves of up to 255
/// triangles that had to be cut up.
inline constexpr uint32_t kMaxWalkDepth = 288;

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

/// The nodes of a TriangleBvh, as the queries below see those of any structure:
///   kWidth, kDepth              slots a node, deepest level of a leaf
///   Link                        names a node or a leaf; kNoLink is neither
///   root(), is_leaf(link)
///   children(link)              the boxes and links of a node's slots
///   visit_runs(link, visit)     calls visit(run) for the leaf store's runs of a leaf
///   repeats()                   whether a triangle may be in several leaves
template <uint32_t width, bool quantised>
class WideNodes {
 public:
  static constexpr uint32_t kWidth = width, kDepth = kMaxWalkDepth;
  using Link = uint32_t;
  static constexpr Link kNoLink = kNoChild;

  struct PlainChildren {
    explicit PlainChildren(const uint32_t* node) : words(node) {}
    NodeBoxes<width> boxes() const { return {reinterpret_cast<const float*>(words)}; }
    Link link(uint32_t slot) const { return words[6 * width + slot]; }
    const uint32_t* words;
  };
  struct GridChildren {
    explicit GridChildren(const uint32_t* node) : links(node + grid::links_at(width)) {
      for (uint32_t row = 0; row < 6; ++row)
        for (uint32_t slot = 0; slot < width; ++slot)
          planes[row * width + slot] = grid::position_of(node, width, row, slot);
    }
    NodeBoxes<width> boxes() const { return {planes}; }
    Link link(uint32_t slot) const { return links[slot]; }
    const uint32_t* links;
    float planes[6 * width + 2] = {};  ///< four can be read from anywhere
  };
  using Children = std::conditional_t<quantised, GridChildren, PlainChildren>;

  explicit WideNodes(const LeafStore& store) : data_(static_cast<const TriangleBvhData&>(store)) {}

  Link root() const { return 0; }
  static bool is_leaf(Link link) { return TriangleBvhData::is_leaf(link); }
  Children children(Link node) const { return Children(data_.nodes.data() + size_t{2} * node); }
  template <typename Visit>
  void visit_runs(Link leaf, const Visit& visit) const {
    visit(leaf);
  }
  bool repeats() const { return data_.repeats != 0; }

 private:
  const TriangleBvhData& data_;
};

/// Every leaf whose boxes pass a test, in no particular order. `test(NodeBoxes, uint32_t* passes)`
/// sets passes[slot] for each slot, whatever for those without a child; `run(link)` takes runs.
template <typename Nodes, typename Test, typename Run>
void walk_leaves(const Nodes& nodes, const Test& test, const Run& run) {
  using Link = typename Nodes::Link;
  if (nodes.is_leaf(nodes.root())) return nodes.visit_runs(nodes.root(), run);
  std::array<Link, Nodes::kDepth*(Nodes::kWidth - 1) + 1> stack;
  size_t waiting = 0;
  stack[waiting++] = nodes.root();
  while (waiting > 0) {
    const auto children = nodes.children(stack[--waiting]);
    uint32_t passes[Nodes::kWidth];
    test(children.boxes(), passes);
    for (uint32_t slot = 0; slot < Nodes::kWidth; ++slot) {
      const Link link = children.link(slot);
      if (!passes[slot] || link == Nodes::kNoLink) continue;
      if (nodes.is_leaf(link))
        nodes.visit_runs(link, run);
      else
        stack[waiting++] = link;
    }
  }
}

/// Calls body(std::integral_constant<uint32_t, width>) for a width.
template <typename Body>
decltype(auto) with_width(uint32_t width, const Body& body) {
  switch (width) {
    case 2:
      return body(std::integral_constant<uint32_t, 2>());
    case 4:
      return body(std::integral_constant<uint32_t, 4>());
    default:
      return body(std::integral_constant<uint32_t, 8>());
  }
}

}  // namespace umbel
