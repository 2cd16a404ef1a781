// Ray kernels in plain C++, for machines without AVX2 and as the reference for the others.
#include <limits>

#include "bvh/ray_walk.hpp"

namespace umbel {
namespace {

template <uint32_t width>
struct PortableLanes {
  static constexpr uint32_t kWidth = width;

  static uint32_t boxes(const uint32_t* node, const RayFrame& f, float cull, float* near) {
    float far[width];
    const float t_min = f.t_min - std::fabs(f.t_min) * kTieSlack;
    for (uint32_t i = 0; i < width; ++i) {
      near[i] = t_min;
      far[i] = cull;
    }
    for (int axis = 0; axis < 3; ++axis) {
      const uint32_t* low = node + static_cast<size_t>(2 * axis) * width;
      const bool flip = f.inv[axis] < 0.0f;
      const uint32_t *near_planes = low + (flip ? width : 0),
                     *far_planes = low + (flip ? 0 : width);
      for (uint32_t i = 0; i < width; ++i) {
        const float a = std::bit_cast<float>(near_planes[i]) * f.inv[axis] + f.near_b[axis];
        const float b = std::bit_cast<float>(far_planes[i]) * f.inv[axis] + f.far_b[axis];
        near[i] = a > near[i] ? a : near[i];
        far[i] = b < far[i] ? b : far[i];
      }
    }
    uint32_t mask = 0;
    for (uint32_t i = 0; i < width; ++i) mask |= static_cast<uint32_t>(near[i] <= far[i]) << i;
    return mask;
  }

  static uint32_t triangles(const TriangleBvhData& tree, uint32_t link, const RayFrame& f,
                            const RayOptions& options, float t_max, LeafHits& hits) {
    uint32_t mask = 0;
    for (uint32_t i = 0; i < TriangleBvhData::leaf_size(link); ++i) {
      const LeafTriangle triangle = tree.triangle(link, i);
      FrameTriangle corners;
      permute(f, triangle.p0, corners.a);
      permute(f, triangle.p1, corners.b);
      permute(f, triangle.p2, corners.c);
      TriangleHit hit;
      if (!test_triangle(f, corners, options.cull_back_faces, hit)) continue;
      if (!(hit.t >= f.t_min && hit.t <= t_max)) continue;
      mask |= 1u << i;
      hits.t[i] = hit.t;
      hits.u[i] = hit.u;
      hits.v[i] = hit.v;
    }
    return mask;
  }

  static void permute(const RayFrame& f, const Vec3& p, float* out) {
    const float coordinates[3] = {p.x, p.y, p.z};
    out[0] = coordinates[f.kx];
    out[1] = coordinates[f.ky];
    out[2] = coordinates[f.kz];
  }
};

}  // namespace

const RayKernels* portable_kernels(uint32_t width) {
  if (width == 2) return &kernels_of<PortableLanes<2>>;
  if (width == 4) return &kernels_of<PortableLanes<4>>;
  return &kernels_of<PortableLanes<8>>;
}

}  // namespace umbel
