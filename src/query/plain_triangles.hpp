// The triangle test of a leaf in plain C++.
#pragma once

#include "query/ray_queries.hpp"

namespace umbel {

/// `Tag` keeps the instruction sets' forms apart.
template <typename Tag>
class PlainTriangles {
 public:
  explicit PlainTriangles(const RayFrame& frame) : f_(frame) {}

  uint32_t operator()(const LeafStore& tree, uint32_t link, bool cull_back, float t_max,
                      LeafHits& hits) const {
    uint32_t lanes = 0;
    for (uint32_t i = 0; i < LeafStore::leaf_size(link); ++i) {
      const LeafTriangle triangle = tree.triangle(link, i);
      FrameTriangle corners;
      permute(triangle.p0, corners.a);
      permute(triangle.p1, corners.b);
      permute(triangle.p2, corners.c);
      TriangleHit hit;
      if (!test_triangle(f_, corners, cull_back, hit)) continue;
      if (!(hit.t >= f_.t_min && hit.t <= t_max)) continue;
      if (!settle(f_, triangle, hit.t) || hit.t > t_max) continue;
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
};

}  // namespace umbel
