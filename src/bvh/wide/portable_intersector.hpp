// Boxes and triangles tested in plain C++, for the traversal of ray_traverse.hpp.
#pragma once

#include <type_traits>

#include "bvh/wide/ray_traverse.hpp"
#include "query/plain_triangles.hpp"

namespace umbel {

template <uint32_t width, bool quantised = false>
class PortableIntersector {
 public:
  static constexpr uint32_t kWidth = width;

  PortableIntersector(const RayFrame& frame, const BvhData& tree)
      : nodes_(tree.nodes.data()), boxes_(frame), triangles_(frame) {}

  uint32_t visit(uint32_t node, float cull, StackEntry*& top) const {
    return boxes_.visit(nodes_ + size_t{2} * node, cull, top);
  }
  uint32_t triangles(const LeafStore& tree, uint32_t link, bool cull_back, float t_max,
                     LeafHits& hits) const {
    return triangles_(tree, link, cull_back, t_max, hits);
  }

 private:
  const uint32_t* nodes_;
  std::conditional_t<quantised, GridBoxes<PortableIntersector, width>,
                     PlainBoxes<PortableIntersector, width>>
      boxes_;
  PlainTriangles<PortableIntersector> triangles_;
};

}  // namespace umbel
