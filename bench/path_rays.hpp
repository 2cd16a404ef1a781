// The rays of path tracing, made on a device: paths start at the pixels of a picture, bounce off
// matte surfaces, and end by Russian roulette or in the sky; at each hit two shadow rays go to the
// light. These are the rays of umbel/bench/bvh/paths.py, by other random numbers: one to the sun
// and one to the sky or, where the picture shows no sky, both to a lamp by the camera.
//
// Function templates over an executor. They add, multiply, divide and take square roots, nothing
// else, so processors and devices make the same rays to the bit.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/exec.hpp"
#include "base/hash.hpp"
#include "bvh/compressed/build_compact.hpp"
#include "umbel/triangle_queries.hpp"

namespace bench {

using umbel::Ray, umbel::Triangle, umbel::Vec3, umbel::Vec3d;

UMBEL_HOST_DEVICE inline Vec3d wide(const Vec3& a) { return {a.x, a.y, a.z}; }
UMBEL_HOST_DEVICE inline Vec3 narrow(const Vec3d& a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}
UMBEL_HOST_DEVICE inline Vec3d sum(const Vec3d& a, const Vec3d& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
UMBEL_HOST_DEVICE inline Vec3d times(const Vec3d& a, double s) {
  return {a.x * s, a.y * s, a.z * s};
}
UMBEL_HOST_DEVICE inline Vec3d difference(const Vec3d& a, const Vec3d& b) {
  return sum(a, times(b, -1));
}
UMBEL_HOST_DEVICE inline double inner(const Vec3d& a, const Vec3d& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
UMBEL_HOST_DEVICE inline Vec3d outer(const Vec3d& a, const Vec3d& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
UMBEL_HOST_DEVICE inline Vec3d unit(const Vec3d& a) { return times(a, 1 / std::sqrt(inner(a, a))); }

/// Random numbers of one of many things: the same whoever draws them, and when.
class Dice {
 public:
  UMBEL_HOST_DEVICE Dice(uint64_t seed, size_t index)
      : state_(umbel::mix64(seed ^ umbel::mix64(index))) {}

  /// In [0, 1).
  UMBEL_HOST_DEVICE double next() {
    state_ = umbel::mix64(state_);
    return static_cast<double>(state_ >> 11) * 0x1p-53;
  }
  /// In the unit ball, but not at its centre.
  UMBEL_HOST_DEVICE Vec3d in_ball() {
    for (;;) {
      const double x = 2 * next() - 1, y = 2 * next() - 1, z = 2 * next() - 1;
      const Vec3d found{x, y, z};
      const double square = inner(found, found);
      if (square <= 1 && square > 1e-12) return found;
    }
  }

 private:
  uint64_t state_;
};

/// Where a picture is taken from, and its size in pixels: multiples of 16.
struct PathCamera {
  Vec3d position{}, target{}, up{};
  double fov_y = 0;
  uint32_t width = 0, height = 0;
};

/// The plane of a picture, from the top left corner on.
struct PicturePlane {
  explicit PicturePlane(const PathCamera& camera) : origin(camera.position) {
    const Vec3d forward = unit(difference(camera.target, camera.position));
    const Vec3d right = unit(outer(forward, camera.up)), up = outer(right, forward);
    const double high = std::tan(camera.fov_y / 2), wide = high * camera.width / camera.height;
    corner = sum(forward, sum(times(right, -wide), times(up, high)));
    across = times(right, 2 * wide / camera.width);
    down = times(up, -2 * high / camera.height);
  }

  Vec3d origin, corner{}, across{}, down{};  ///< of a pixel
};

/// `samples` rays through each pixel of tiles of 16 x 16.
template <typename Exec>
void camera_rays(Exec& exec, const PathCamera& camera, uint32_t samples, uint64_t seed, Ray* rays) {
  constexpr uint32_t kTile = 16;
  const PicturePlane plane(camera);
  const uint32_t tiles_across = camera.width / kTile;
  exec.for_each(size_t(camera.width) * camera.height * samples, [=] UMBEL_DEVICE_LAMBDA(size_t i) {
    const auto pixel = static_cast<uint32_t>(i / samples);
    const uint32_t tile = pixel / (kTile * kTile), within = pixel % (kTile * kTile);
    Dice dice(seed, i);
    const uint32_t column = tile % tiles_across * kTile + within % kTile;
    const uint32_t row = tile / tiles_across * kTile + within / kTile;
    const double x = column + dice.next(), y = row + dice.next();
    const Vec3d through = sum(plane.corner, sum(times(plane.across, x), times(plane.down, y)));
    Ray ray;
    ray.origin = narrow(plane.origin);
    ray.direction = narrow(unit(through));
    rays[i] = ray;
  });
}

/// What rays have hit.
struct PathHits {
  const float* t;
  const uint32_t* primitives;
};

/// A place of the surface, a little above it, and the normal on the side that the ray came from.
struct PathVertex {
  Vec3 point, normal;
};

/// The places of those rays, numbered in `hits`.
template <typename Exec>
void path_vertices(Exec& exec, const umbel::cuda::MeshCorners& corners, double extent,
                   const Ray* rays, const PathHits& found, const uint32_t* hits, uint32_t count,
                   PathVertex* out) {
  exec.for_each(count, [=] UMBEL_DEVICE_LAMBDA(size_t i) {
    const Ray& ray = rays[hits[i]];
    const umbel::cuda::TriangleCorners c = corners(found.primitives[hits[i]]);
    const Vec3d direction = wide(ray.direction), a = wide(c.a);
    Vec3d normal = outer(difference(wide(c.b), a), difference(wide(c.c), a));
    const double square = inner(normal, normal);
    normal = square > 0 ? times(normal, 1 / std::sqrt(square)) : times(unit(direction), -1);
    if (inner(normal, direction) > 0) normal = times(normal, -1);
    const Vec3d at = sum(wide(ray.origin), times(direction, static_cast<double>(found.t[hits[i]])));
    out[i] = {narrow(sum(at, times(normal, extent * 1e-6))), narrow(normal)};
  });
}

/// What lights a picture.
enum class Light : uint32_t { kSun, kSky, kLamp };

/// The rays from places to a light, but for those that start into the surface.
struct ShadowRays {
  const PathVertex* vertices;
  Light light;
  Vec3d lamp;         ///< where it is
  double lamp_reach;  ///< the greatest distance from it along an axis
  uint64_t seed;

  /// Not of unit length to the lamp: that is at 1.
  UMBEL_HOST_DEVICE Vec3d direction(size_t i) const {
    constexpr double kSunRadius = 0.0093, kLampRadius = 0.01;
    Dice dice(seed, i);
    const Vec3d ball = dice.in_ball();
    if (light == Light::kSun)
      return unit(sum(unit(Vec3d{0.66, 0.74, 0.12}), times(ball, kSunRadius)));
    if (light == Light::kSky) return unit(Vec3d{ball.x, std::fabs(ball.y), ball.z});
    const Vec3d from = wide(vertices[i].point);
    return difference(sum(lamp, times(ball, kLampRadius * lamp_reach)), from);
  }
  UMBEL_HOST_DEVICE bool keeps(size_t i) const {
    return inner(direction(i), wide(vertices[i].normal)) > 0;
  }
  UMBEL_HOST_DEVICE Ray ray(size_t i) const {
    Ray ray;
    ray.origin = vertices[i].point;
    ray.direction = narrow(direction(i));
    if (light == Light::kLamp) ray.t_max = 1;
    return ray;
  }
};

/// The rays that go on from places, but for those that end by Russian roulette.
struct BouncedRays {
  const PathVertex* vertices;
  double survival;
  uint64_t seed;

  UMBEL_HOST_DEVICE bool keeps(size_t i) const { return Dice(~seed, i).next() < survival; }
  /// Distributed by the cosine to the normal: a point on the unit sphere around the normal's end
  /// lies in such a direction.
  UMBEL_HOST_DEVICE Ray ray(size_t i) const {
    const Vec3d on_sphere = unit(Dice(seed, i).in_ball());
    Ray ray;
    ray.origin = vertices[i].point;
    ray.direction = narrow(unit(sum(wide(vertices[i].normal), times(on_sphere, 0.9999))));
    return ray;
  }
};

/// Where `rays` has rays of `count` places: writes which it keeps, and how many.
template <typename Exec, typename Rays>
void select_rays(Exec& exec, const Rays& rays, uint32_t count, uint32_t* kept,
                 uint32_t* kept_count) {
  exec.select(
      count, [rays] UMBEL_DEVICE_LAMBDA(size_t i) { return rays.keeps(i); }, kept, kept_count);
}
template <typename Exec, typename Rays>
void make_rays(Exec& exec, const Rays& rays, const uint32_t* kept, uint32_t count, Ray* out) {
  exec.for_each(count, [=] UMBEL_DEVICE_LAMBDA(size_t i) { out[i] = rays.ray(kept[i]); });
}

/// The rays that hit anything, and how many.
template <typename Exec>
void select_hits(Exec& exec, const uint32_t* primitives, uint32_t count, uint32_t* hits,
                 uint32_t* hit_count) {
  exec.select(
      count, [=] UMBEL_DEVICE_LAMBDA(size_t i) { return primitives[i] != umbel::kNone; }, hits,
      hit_count);
}

/// The greatest distance of places from one along an axis.
template <typename Exec>
void reach_from(Exec& exec, const Vec3d& place, const PathVertex* vertices, uint32_t count,
                double* reach) {
  exec.reduce(
      count, 0.0,
      [=] UMBEL_DEVICE_LAMBDA(size_t i) {
        const Vec3d way = difference(wide(vertices[i].point), place);
        const double xy = std::fmax(std::fabs(way.x), std::fabs(way.y));
        return std::fmax(xy, std::fabs(way.z));
      },
      [] UMBEL_DEVICE_LAMBDA(double a, double b) { return a < b ? b : a; }, reach);
}

/// A number that is the same only if what rays have hit is: `t` and primitives, or, of shadow rays,
/// whether they hit anything.
template <typename Exec>
void digest_of_hits(Exec& exec, const PathHits& hits, const uint8_t* any, uint32_t count,
                    uint64_t* digest) {
  exec.reduce(
      count, uint64_t{0},
      [=] UMBEL_DEVICE_LAMBDA(size_t i) {
        const uint64_t found =
            any ? any[i] : uint64_t{std::bit_cast<uint32_t>(hits.t[i])} << 32 | hits.primitives[i];
        return umbel::mix64(found ^ umbel::mix64(i));
      },
      [] UMBEL_DEVICE_LAMBDA(uint64_t a, uint64_t b) { return a + b; }, digest);
}

}  // namespace bench
