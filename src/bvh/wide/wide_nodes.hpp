// The nodes of a Bvh, as the queries of traverse_leaves.hpp see them.
#pragma once

#include <type_traits>

#include "bvh/wide/triangle_bvh_data.hpp"
#include "query/traverse_leaves.hpp"

namespace umbel {

template <uint32_t width, bool quantised>
class WideNodes {
 public:
  static constexpr uint32_t kWidth = width, kDepth = kMaxTraversalDepth;
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

  explicit WideNodes(const LeafStore& store) : data_(static_cast<const BvhData&>(store)) {}

  Link root() const { return 0; }
  static bool is_leaf(Link link) { return BvhData::is_leaf(link); }
  Children children(Link node) const { return Children(data_.nodes.data() + size_t{2} * node); }
  template <typename Visit>
  void visit_runs(Link leaf, const Visit& visit) const {
    visit(leaf);
  }
  bool repeats() const { return data_.repeats != 0; }

 private:
  const BvhData& data_;
};

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
