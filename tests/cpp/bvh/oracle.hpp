// Brute force in double precision, to compare hierarchies with, and rays that are hard to trace.
//
// A ray that passes a triangle's border by less than single precision can tell may be said to hit
// it or to miss it, and a triangle seen on edge has no sharp distance. So the oracle sorts the
// triangles on a ray's line into those that are hit for certain (well inside, at an angle) and
// those that are possible (within a tolerance of the border). An answer is right if
//   - what it hits is possible, and lies where the answer says, within the tolerance, and
//   - nothing that is hit for certain lies clearly before it.
// The tolerance is a few units of the last place of the largest coordinate that the test works
// with: the distance from the ray's origin to the triangle's farthest corner. The tolerance of t
// grows where the triangle is seen at a low angle, and where it is thin.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "data_folder.hpp"
#include "query/triangle_geometry.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::testing {

/// A binary PLY file of float x y z first in each vertex and triangles as `list uchar int`;
/// nothing where there is none, or one of another kind.
inline std::optional<Mesh> read_mesh(const std::string& name) {
  std::ifstream file(data_folder() / name, std::ios::binary);
  if (!file) return std::nullopt;
  size_t vertices = 0, faces = 0, stride = 0;
  bool in_vertices = false;
  for (std::string line; std::getline(file, line) && line != "end_header";) {
    if (line.starts_with("element")) in_vertices = line.starts_with("element vertex");
    if (line.starts_with("element vertex")) vertices = std::stoul(line.substr(15));
    if (line.starts_with("element face")) faces = std::stoul(line.substr(13));
    if (!in_vertices || !line.starts_with("property")) continue;
    if (line.starts_with("property double")) return std::nullopt;
    stride += line.starts_with("property float") ? 4 : 1;
  }
  Mesh mesh;
  std::vector<char> bytes(vertices * stride + faces * 13);
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file) return std::nullopt;
  mesh.positions.resize(vertices);
  mesh.triangles.resize(faces);
  for (size_t i = 0; i < vertices; ++i) std::memcpy(&mesh.positions[i], &bytes[i * stride], 12);
  for (size_t i = 0; i < faces; ++i)
    std::memcpy(&mesh.triangles[i], &bytes[vertices * stride + i * 13 + 1], 12);
  return mesh;
}

inline Mesh transformed(Mesh mesh, float scale, const Vec3& offset = {0, 0, 0}) {
  for (Vec3& p : mesh.positions)
    p = {p.x * scale + offset.x, p.y * scale + offset.y, p.z * scale + offset.z};
  return mesh;
}

/// The instruction sets of this machine.
inline std::vector<Simd> simd_paths() {
  std::vector<Simd> paths;
  const Mesh mesh = shapes::grid(1, 1);
  for (const Simd simd : {Simd::kPortable, Simd::kAvx2, Simd::kAvx512}) {
    BvhConfig config;
    config.simd = simd;
    try {
      Bvh::build(mesh.view(), config);
      paths.push_back(simd);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUnsupported);
    }
  }
  return paths;
}

/// One triangle against one ray.
struct Crossing {
  double t, tolerance;  ///< of t
  bool is_possible, is_certain;
};

inline Crossing cross_triangle(const Ray& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2) {
  const Vec3d o = to_double(ray.origin), d = to_double(ray.direction);
  const double speed = length(d);
  const Vec3d a = to_double(p0) - o, b = to_double(p1) - o, c = to_double(p2) - o;
  const double reach = std::sqrt(std::max({dot(a, a), dot(b, b), dot(c, c)}));
  const double tolerance = 32 * 6e-8 * reach;
  const Vec3d unit = d * (1 / speed);
  // The corners as seen along the ray, and the distance of its line to each edge.
  const Vec3d normal = cross(b - a, c - a);
  const double size = length(normal);
  const double slope = size > 0 ? std::abs(dot(normal, unit)) / size : 0;
  if (slope > 0) {
    const double t = dot(normal, a) / dot(normal, unit);
    const TrianglePoint nearest = closest_on_triangle(a - unit * t, b - unit * t, c - unit * t);
    const double u = nearest.u, v = nearest.v, w = 1 - u - v;
    const auto height = [&](const Vec3d& p, const Vec3d& q) { return size / length(q - p); };
    const double inside = std::min({u * height(c, a), v * height(a, b), w * height(b, c)});
    // Where a triangle is so thin that its weights are uncertain, so is the place along it.
    const double edge = std::max({length(b - a), length(c - b), length(a - c)});
    const double depths[3] = {dot(a, unit), dot(b, unit), dot(c, unit)};
    const double depth =
        std::max({depths[0], depths[1], depths[2]}) - std::min({depths[0], depths[1], depths[2]});
    const double slide = std::min(1.0, tolerance * edge / (size * slope)) * depth;
    const double spread = tolerance / slope;
    const bool is_possible = nearest.distance2 <= 4 * spread * spread;
    const bool is_certain =
        nearest.distance2 <= 1e-20 * reach * reach && slope > 1e-2 && inside > 2 * spread;
    return {t / speed, (spread + tolerance + slide) / speed, is_possible, is_certain};
  }
  return {0, std::numeric_limits<double>::infinity(), true, false};
}

/// What brute force says of one ray.
struct Truth {
  double nearest_certain = std::numeric_limits<double>::infinity();
  double tolerance = 0;
};

inline Truth trace_all(const MeshView& mesh, const Ray& ray) {
  Truth truth;
  for (const Triangle& triangle : mesh.triangles) {
    const Crossing x = cross_triangle(ray, mesh.positions[triangle[0]], mesh.positions[triangle[1]],
                                      mesh.positions[triangle[2]]);
    const double t_max = std::min(ray.t_max, std::numeric_limits<float>::max());
    const bool in_interval = x.t - x.tolerance > ray.t_min && x.t + x.tolerance < t_max;
    if (!x.is_certain || !in_interval ||
        x.t + x.tolerance >= truth.nearest_certain + truth.tolerance)
      continue;
    truth = {x.t, x.tolerance};
  }
  return truth;
}

/// That `hit` is a right answer to `ray`.
inline ::testing::AssertionResult is_right(const MeshView& mesh, const Ray& ray, const Truth& truth,
                                           const Hit& hit) {
  if (!hit.hit()) {
    if (std::isinf(truth.nearest_certain)) return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << "missed what is at t = " << truth.nearest_certain;
  }
  if (hit.primitive >= mesh.triangles.size())
    return ::testing::AssertionFailure() << "no triangle " << hit.primitive;
  if (!(hit.t >= ray.t_min && hit.t <= ray.t_max && std::isfinite(hit.t)))
    return ::testing::AssertionFailure() << "t = " << hit.t << " is not in the interval";
  const Triangle& triangle = mesh.triangles[hit.primitive];
  const Vec3 &p0 = mesh.positions[triangle[0]], &p1 = mesh.positions[triangle[1]],
             &p2 = mesh.positions[triangle[2]];
  const Crossing x = cross_triangle(ray, p0, p1, p2);
  if (!x.is_possible)
    return ::testing::AssertionFailure() << "triangle " << hit.primitive << " is not on the ray";
  if (std::abs(hit.t - x.t) > 4 * x.tolerance + 1e-6 * std::abs(x.t))
    return ::testing::AssertionFailure() << "t = " << hit.t << ", but it is " << x.t;
  if (hit.t > truth.nearest_certain + 4 * truth.tolerance + 1e-6 * std::abs(truth.nearest_certain))
    return ::testing::AssertionFailure()
           << "t = " << hit.t << ", but there is a hit at " << truth.nearest_certain;
  return ::testing::AssertionSuccess();
}

/// Rays of every awkward kind, through and beside `mesh`, which is not empty.
inline std::vector<Ray> adversarial_rays(const MeshView& mesh, size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1, 1);
  const Aabb box = bounds(mesh);
  const Vec3 middle{(box.min.x + box.max.x) / 2, (box.min.y + box.max.y) / 2,
                    (box.min.z + box.max.z) / 2};
  const float extent = std::max({box.max.x - box.min.x, box.max.y - box.min.y,
                                 box.max.z - box.min.z, std::numeric_limits<float>::min()});
  const auto anywhere = [&](float reach) {
    return Vec3{middle.x + unit(random) * extent * reach, middle.y + unit(random) * extent * reach,
                middle.z + unit(random) * extent * reach};
  };
  const auto triangle = [&]() -> const Triangle& {
    return mesh.triangles[random() % mesh.triangles.size()];
  };
  const auto corner = [&] { return mesh.positions[triangle()[random() % 3]]; };
  const auto to = [](const Vec3& from, const Vec3& at) {
    return Vec3{at.x - from.x, at.y - from.y, at.z - from.z};
  };
  const auto between = [](const Vec3& a, const Vec3& b) {
    return Vec3{(a.x + b.x) / 2, (a.y + b.y) / 2, (a.z + b.z) / 2};
  };
  std::vector<Ray> rays;
  while (rays.size() < count) {
    Ray ray{anywhere(1.5f),
            0,
            {unit(random), unit(random), unit(random)},
            std::numeric_limits<float>::infinity()};
    const Triangle& t = triangle();
    const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    switch (rays.size() % 14) {
      case 0:
        break;
      case 1:
        ray.direction = to(ray.origin, anywhere(0.5f));
        break;  // into the box
      case 2:
        ray.direction = to(ray.origin, corner());
        break;  // at a vertex
      case 3:
        ray.direction = to(ray.origin, between(a, b));
        break;   // at an edge
      case 4: {  // along an axis
        ray.origin = anywhere(1);
        ray.direction = {0, 0, 0};
        (&ray.direction.x)[random() % 3] = random() % 2 ? 1.0f : -1.0f;
        break;
      }
      case 5: {  // along an axis, through a vertex
        const size_t axis = random() % 3;
        ray.origin = corner();
        (&ray.origin.x)[axis] -= 2 * extent;
        ray.direction = {0, 0, 0};
        (&ray.direction.x)[axis] = 1;
        break;
      }
      case 6:
        ray.origin = a, ray.direction = to(a, b);
        break;  // along an edge
      case 7:
        ray.origin = between(a, b), ray.direction = to(b, c);
        break;  // in the plane
      case 8:
        ray.origin = between(between(a, b), c);
        break;  // from the surface
      case 9:
        (&ray.direction.x)[random() % 3] = random() % 2 ? 0.0f : -0.0f;
        break;
      case 10: {  // an interval
        ray.direction = to(ray.origin, anywhere(0.5f));
        ray.t_min = (unit(random) + 1) / 2;
        ray.t_max = ray.t_min + (unit(random) + 1) / 2;
        break;
      }
      case 11: {  // directions near the ends of what floats can say
        constexpr float kScales[] = {1e-30f, 1e30f, 5e-39f};  // t overflows for some at the last
        const float s = kScales[random() % 3];
        ray.direction = {ray.direction.x * s, ray.direction.y * s, ray.direction.z * s};
        break;
      }
      case 12: {  // grazing: almost in the plane of a triangle
        const Vec3 target = between(between(a, b), c);
        ray.direction = to(ray.origin, target);
        ray.origin = between(a, c);
        ray.direction = to(a, b);
        ray.direction.x += 1e-4f * extent * unit(random);
        break;
      }
      default: {  // between edges of two triangles
        const Triangle& other = triangle();
        ray.origin = between(a, b);
        ray.direction = to(ray.origin, between(mesh.positions[other[1]], mesh.positions[other[2]]));
        break;
      }
    }
    if (ray.direction.x == 0 && ray.direction.y == 0 && ray.direction.z == 0) ray.direction.z = 1;
    rays.push_back(ray);
  }
  return rays;
}

/// Rays at the unit sphere that meet it where t is no float.
inline std::vector<Ray> rays_whose_t_overflows() {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  std::vector<Ray> rays;
  for (const float speed : {1e-40f, 1e-45f, 5e-39f}) {
    rays.push_back({{0.01f, 0.02f, -3}, 0, {0, 0, speed}});
    rays.push_back({{0.01f, 0.02f, -3}, kInf, {0, 0, speed}});
    rays.push_back({{0.01f, 0.02f, 3}, -kInf, {0, 0, speed}});
  }
  return rays;
}

/// The squared distance from a point to a mesh.
inline double closest_distance2(const MeshView& mesh, const Vec3& point) {
  double best = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles)
    best = std::min(best, closest_on_triangle(point, mesh.positions[t[0]], mesh.positions[t[1]],
                                              mesh.positions[t[2]])
                              .distance2);
  return best;
}

/// The winding number of a closed mesh around a point: solid angles (van Oosterom & Strackee 1983),
/// which shares nothing with the parity that it judges.
inline double winding_number(const MeshView& mesh, const Vec3& point) {
  const Vec3d p = to_double(point);
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = to_double(mesh.positions[t[0]]) - p, b = to_double(mesh.positions[t[1]]) - p,
                c = to_double(mesh.positions[t[2]]) - p;
    const double la = length(a), lb = length(b), lc = length(c);
    sum += std::atan2(dot(a, cross(b, c)),
                      la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return sum / (2 * 3.14159265358979323846);
}

}  // namespace umbel::testing
