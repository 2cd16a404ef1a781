// Boxes and triangles tested in plain C++, for the walk of ray_walk.hpp.
#pragma once

#include "bvh/ray_walk.hpp"

namespace umbel {

template <uint32_t width>
class PortableLanes {
 public:
  static constexpr uint32_t kWidth = width;

  explicit PortableLanes(const RayFrame& frame) : f_(frame), boxes_(frame) {}

  uint32_t visit(const uint32_t* node, float cull, StackEntry*& top) const {
    return boxes_.visit(node, cull, top);
  }

  uint32_t triangles(const TriangleBvhData& tree, uint32_t link, bool cull_back, float t_max,
                     LeafHits& hits) const {
    uint32_t lanes = 0;
    for (uint32_t i = 0; i < TriangleBvhData::leaf_size(link); ++i) {
      const LeafTriangle triangle = tree.triangle(link, i);
      FrameTriangle corners;
      permute(triangle.p0, corners.a);
      permute(triangle.p1, corners.b);
      permute(triangle.p2, corners.c);
      TriangleHit hit;
      if (!test_triangle(f_, corners, cull_back, hit)) continue;
      if (!(hit.t >= f_.t_min && hit.t <= t_max)) continue;
      lanes |= 1u << i;
      hits.t[i] = hit.t;
      hits.v[i] = hit.v;
      hits.w[i] = hit.w;
      hits.determinant[i] = hit.determinant;
    }
    return lanes;
  }

 private:
  void permute(const Vec3& p, float* out) const {
    const float coordinates[3] = {p.x, p.y, p.z};
    out[0] = coordinates[f_.kx];
    out[1] = coordinates[f_.ky];
    out[2] = coordinates[f_.kz];
  }

  const RayFrame& f_;
  PlainBoxes<PortableLanes, width> boxes_;
};

}  // namespace umbel
