// Rays for measuring: three views of a mesh in tiles of 4 x 4, and what bounces from what they hit.
#pragma once

#include <cmath>
#include <vector>

#include "base/math.hpp"
#include "umbel/mesh.hpp"
#include "umbel/ray_arrays.hpp"
#include "umbel/triangle_queries.hpp"

namespace bench {

using umbel::Aabb, umbel::Hit, umbel::Mesh, umbel::Ray, umbel::Vec3;

inline Vec3 normalized(const Vec3& a) { return a * (1.0f / length(a)); }

/// Looks from `eye` to `target`; 4 x 4 tiles.
inline void add_view(const Vec3& eye, const Vec3& target, uint32_t size, std::vector<Ray>& rays) {
  const Vec3 forward = normalized(target - eye);
  const Vec3 up = std::fabs(forward.y) > 0.9f ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 right = normalized(cross(forward, up)), above = cross(right, forward);
  const float scale = 1.1f / static_cast<float>(size);  // a field of view of about 58 degrees
  for (uint32_t tile_y = 0; tile_y < size; tile_y += 4)
    for (uint32_t tile_x = 0; tile_x < size; tile_x += 4)
      for (uint32_t i = 0; i < 16; ++i) {
        const uint32_t column = tile_x + i % 4, row = tile_y + i / 4;
        const float x = (static_cast<float>(column) + 0.5f) * scale - 0.55f;
        const float y = (static_cast<float>(row) + 0.5f) * scale - 0.55f;
        Ray ray;
        ray.origin = eye;
        ray.direction = normalized(forward + right * x + above * y);
        rays.push_back(ray);
      }
}

/// Two from outside, one from the middle along the longest side.
inline std::vector<Ray> primary_rays(const Mesh& mesh, uint32_t size) {
  const Aabb box = bounds(mesh.view());
  const Vec3 extent = box.max - box.min, middle = center(box);
  const float reach = length(extent);
  std::vector<Ray> rays;
  add_view(middle + normalized({0.6f, 0.4f, 0.7f}) * reach, middle, size, rays);
  add_view(middle + normalized({-0.8f, 0.25f, -0.5f}) * (0.8f * reach), middle, size, rays);
  const Vec3 inside = middle + Vec3{0.05f * extent.x, 0.03f * extent.y, 0.02f * extent.z};
  const bool x_is_longest = extent.x >= extent.y && extent.x >= extent.z;
  add_view(inside,
           inside + (x_is_longest ? Vec3{reach, 0.05f * reach, 0.02f * reach}
                                  : Vec3{0.05f * reach, 0.02f * reach, reach}),
           size, rays);
  return rays;
}

inline float uniform(uint32_t seed) {
  seed ^= seed >> 16;
  seed *= 0x7feb352du;
  seed ^= seed >> 15;
  seed *= 0x846ca68bu;
  seed ^= seed >> 16;
  return static_cast<float>(seed >> 8) * 0x1p-24f;
}

/// One from each hit, cosine-distributed.
inline std::vector<Ray> bounce_rays(const Mesh& mesh, const std::vector<Ray>& rays,
                                    const std::vector<Hit>& hits) {
  const float offset = 1e-5f * length(bounds(mesh.view()).max - bounds(mesh.view()).min);
  std::vector<Ray> result;
  for (size_t i = 0; i < rays.size(); ++i) {
    if (!hits[i].hit()) continue;
    const umbel::Triangle& triangle = mesh.triangles[hits[i].primitive];
    const Vec3 p0 = mesh.positions[triangle[0]];
    Vec3 normal = cross(mesh.positions[triangle[1]] - p0, mesh.positions[triangle[2]] - p0);
    if (!(length(normal) > 0)) continue;
    normal = normalized(normal);
    if (dot(normal, rays[i].direction) > 0) normal = normal * -1.0f;
    const auto seed = static_cast<uint32_t>(i);
    const float z = 1 - 2 * uniform(2 * seed), angle = 6.2831853f * uniform(2 * seed + 1);
    const float radius = std::sqrt(std::max(0.0f, 1 - z * z));
    const Vec3 direction =
        normal * 1.0001f + Vec3{radius * std::cos(angle), radius * std::sin(angle), z};
    Ray ray;
    ray.origin = rays[i].origin + rays[i].direction * hits[i].t + normal * offset;
    ray.direction = normalized(direction);
    result.push_back(ray);
  }
  return result;
}

}  // namespace bench
