// The rays of pictures: through their pixels, and what bounces from what they hit.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "trace/camera.hpp"
#include "trace/sampler.hpp"
#include "trace/vector.hpp"
#include "umbel/trace.hpp"

namespace bench {

using umbel::Hit, umbel::Mesh, umbel::Ray, umbel::Triangle, umbel::TriangleQueries, umbel::Vec2,
    umbel::Vec3;
namespace trace = umbel::trace;

/// One ray through every pixel for each sample, in the order of the tracer's tiles;
/// `size` is a multiple of 16.
inline std::vector<Ray> camera_rays(const umbel::Camera& camera, uint32_t size, uint32_t samples) {
  const trace::RayCamera rays(camera, size, size);
  std::vector<Ray> result;
  const uint32_t across = size / 16;
  for (uint32_t tile = 0; tile < across * across; ++tile) {
    const uint32_t left = tile % across * 16, top = tile / across * 16;
    for (uint32_t i = 0; i < 256 * samples; ++i) {
      const uint32_t pixel = i / samples, row = pixel / 16, column = pixel % 16;
      const Vec2 u = trace::Sampler(1, tile, i).point(0);
      const float x = static_cast<float>(left + column) + u.x;
      const float y = static_cast<float>(top + row) + u.y;
      result.push_back(rays.ray(x, y, {0, 0}));
    }
  }
  return result;
}

/// A diffuse bounce from each hit.
inline std::vector<Ray> bounces(const Mesh& mesh, const std::vector<Ray>& rays,
                                const TriangleQueries& structure) {
  using trace::operator*, trace::operator-;
  const float offset = 1e-5f * length(structure.bounds().max - structure.bounds().min);
  std::vector<Ray> result;
  for (size_t i = 0; i < rays.size(); ++i) {
    const Hit hit = structure.intersect(rays[i]);
    if (!hit.hit()) continue;
    const Triangle& t = mesh.triangles[hit.primitive];
    const Vec3 p = mesh.positions[t[0]];
    Vec3 normal =
        trace::normalized(cross(mesh.positions[t[1]] - p, mesh.positions[t[2]] - p), {0, 1, 0});
    if (dot(normal, rays[i].direction) > 0) normal = -normal;
    const Vec2 disc = trace::on_disc(trace::Sampler(2, static_cast<uint32_t>(i), 0).point(0));
    const float z = std::sqrt(std::max(0.0f, 1.0f - disc.x * disc.x - disc.y * disc.y));
    Ray ray;
    ray.origin = rays[i].origin + rays[i].direction * hit.t + normal * offset;
    ray.direction = trace::basis_around(normal).to_world({disc.x, disc.y, z});
    result.push_back(ray);
  }
  return result;
}

}  // namespace bench
