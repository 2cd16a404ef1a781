// Chooses a camera: outside, so that the mesh just fills the picture, or inside if the scene is a
// room.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "trace/camera.hpp"
#include "trace/sampler.hpp"
#include "trace/scene_data.hpp"

namespace umbel::trace {
namespace {

struct Real3 {
  double x, y, z;
};

Real3 real(const Vec3& v) { return {v.x, v.y, v.z}; }
double dot(const Real3& a, const Real3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// Level axes: the first is where azimuth 0 looks from, the second where 90 degrees does.
struct Horizon {
  Vec3 front, side, up;
};

Horizon horizon_of(const Vec3& given_up) {
  const Vec3 up = normalized(given_up, {0, 1, 0});
  // +Z is the front of what stands on the XZ plane (glTF), -Y of what stands on the XY plane.
  const Vec3 guess = std::abs(up.z) > 0.9f ? Vec3{0, -1, 0} : Vec3{0, 0, 1};
  const Vec3 front = normalized(guess - up * umbel::dot(guess, up), basis_around(up).x);
  return {front, cross(up, front), up};
}

void check_size(uint32_t width, uint32_t height) {
  if (width == 0 || height == 0)
    throw Error(ErrorCode::kInvalidArgument, "a picture must be at least 1 pixel wide and high");
}

void check_viewpoint(const Viewpoint& v) {
  const auto refuse = [](const std::string& sentence) {
    throw Error(ErrorCode::kInvalidArgument, sentence);
  };
  if (!std::isfinite(v.azimuth)) refuse("the azimuth must be a number of degrees");
  if (!(v.elevation >= -89.0f && v.elevation <= 89.0f))
    refuse("the elevation must be from -89 to 89 degrees");
  if (!(v.fov_y > 0.0f && v.fov_y < kPi))
    refuse("the field of view must be between 0 and 180 degrees");
  if (!(v.margin >= 0.0f && v.margin <= 0.9f)) refuse("the margin must be from 0 to 0.9");
}

/// How far points reach into the four half-spaces beside the view, and along it.
struct Reach {
  double right, left, top, bottom, nearest;
};

template <typename Visit>
void each_corner(const MeshView& mesh, const Visit& visit) {
  for (const Triangle& t : mesh.triangles)
    for (const uint32_t v : t) visit(mesh.positions[v]);
}

Camera fit_points(const MeshView& mesh, const Horizon& horizon, uint32_t width, uint32_t height,
                  const Viewpoint& view) {
  const double azimuth = view.azimuth * std::numbers::pi / 180;
  const double elevation = view.elevation * std::numbers::pi / 180;
  const auto level = horizon.front * static_cast<float>(std::cos(azimuth)) +
                     horizon.side * static_cast<float>(std::sin(azimuth));
  const Vec3 back = normalized(level * static_cast<float>(std::cos(elevation)) +
                                   horizon.up * static_cast<float>(std::sin(elevation)),
                               horizon.front);
  const Vec3 right = normalized(cross(horizon.up, back), horizon.side);
  const Real3 r = real(right), u = real(cross(back, right)), b = real(back);
  const double free = 1.0 - view.margin;
  const double tan_y = std::tan(view.fov_y / 2.0) * free;
  const double tan_x = std::tan(view.fov_y / 2.0) * width / height * free;

  // In the camera's axes a point (x, y, z) is in the picture if |x - cx| <= tan_x (cz - z).
  constexpr double kLow = std::numeric_limits<double>::lowest();
  Reach reach{kLow, kLow, kLow, kLow, kLow};
  double deepest = std::numeric_limits<double>::max();
  each_corner(mesh, [&](const Vec3& point) {
    const Real3 p = real(point);
    const double x = dot(p, r), y = dot(p, u), z = dot(p, b);
    reach.right = std::max(reach.right, x + tan_x * z);
    reach.left = std::max(reach.left, -x + tan_x * z);
    reach.top = std::max(reach.top, y + tan_y * z);
    reach.bottom = std::max(reach.bottom, -y + tan_y * z);
    reach.nearest = std::max(reach.nearest, z);
    deepest = std::min(deepest, z);
  });
  const double size = std::max(reach.nearest - deepest, 1e-30);
  const double cx = (reach.right - reach.left) / 2, cy = (reach.top - reach.bottom) / 2;
  const double cz =
      std::max({(reach.right + reach.left) / (2 * tan_x), (reach.top + reach.bottom) / (2 * tan_y),
                reach.nearest + 0.01 * size});
  const double tz = (reach.nearest + deepest) / 2;
  const auto on_axis = [&](double z) {
    return Vec3{static_cast<float>(r.x * cx + u.x * cy + b.x * z),
                static_cast<float>(r.y * cx + u.y * cy + b.y * z),
                static_cast<float>(r.z * cx + u.z * cy + b.z * z)};
  };
  Camera camera;
  camera.position = on_axis(cz);
  camera.target = on_axis(tz);
  camera.up = horizon.up;
  camera.fov_y = view.fov_y;
  if (camera.position == camera.target) camera.position = camera.target + back;
  return camera;
}

/// Free distances from a point in directions around it.
struct Around {
  double median = 0;    ///< of those that end
  double facing = 0;    ///< share of the ends that show their front
  double enclosed = 0;  ///< share that end
};

Around look_around(const Scene::Data& scene, const Vec3& point, const Horizon& horizon) {
  constexpr uint32_t kRays = 256;
  std::vector<float> distances;
  uint32_t facing = 0;
  for (uint32_t i = 0; i < kRays; ++i) {
    // Level and slightly tilted directions: a room may have no roof.
    const float height = 0.8f * unit_float(reverse_bits(i)) - 0.4f;
    const float angle = 2.0f * kPi * static_cast<float>(i) / kRays;
    const float r = std::sqrt(1.0f - height * height);
    Ray ray;
    ray.origin = point;
    ray.direction = horizon.front * (r * std::cos(angle)) + horizon.side * (r * std::sin(angle)) +
                    horizon.up * height;
    const SceneHit hit = scene.intersect(ray);
    if (!hit.hit()) continue;
    distances.push_back(hit.t);
    const Triangle& t = scene.triangles[hit.primitive].corners;
    const Vec3 normal = cross(normalized(scene.positions[t[1]] - scene.positions[t[0]], {0, 0, 0}),
                              normalized(scene.positions[t[2]] - scene.positions[t[0]], {0, 0, 0}));
    if (umbel::dot(normal, ray.direction) < 0.0f) ++facing;
  }
  Around around;
  if (distances.empty()) return around;
  const auto middle = distances.begin() + static_cast<ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  around.median = *middle;
  around.facing = static_cast<double>(facing) / static_cast<double>(distances.size());
  around.enclosed = static_cast<double>(distances.size()) / kRays;
  return around;
}

struct Candidate {
  Vec3 position{0, 0, 0}, direction{0, 0, 0};
  double score = -1;
};

/// The direction from one position in which a cone of rays reaches furthest.
void try_position(const Scene::Data& scene, const Vec3& position, const Horizon& horizon, float far,
                  Candidate& best) {
  constexpr uint32_t kDirections = 48, kHalf = 4;
  std::array<double, kDirections> reach{};
  double nearest = far;
  for (uint32_t i = 0; i < kDirections; ++i) {
    const float angle = 2.0f * kPi * static_cast<float>(i) / kDirections;
    for (const float tilt : {-0.12f, 0.0f, 0.2f}) {
      Ray ray;
      ray.origin = position;
      ray.direction = normalized(
          horizon.front * std::cos(angle) + horizon.side * std::sin(angle) + horizon.up * tilt,
          horizon.front);
      const SceneHit hit = scene.intersect(ray);
      const double t = hit.hit() ? std::min(hit.t, far) : 0.5 * far;
      reach[i] += std::sqrt(t / far) / 3;
      if (tilt == 0.0f && hit.hit()) nearest = std::min<double>(nearest, hit.t);
    }
  }
  for (uint32_t i = 0; i < kDirections; ++i) {
    double sum = reach[i];
    for (uint32_t k = 1; k <= kHalf; ++k)
      sum += reach[(i + k) % kDirections] + reach[(i + kDirections - k) % kDirections];
    // Too close to a wall is bad, whatever the view.
    const double score = sum / (2 * kHalf + 1) * std::min(1.0, nearest / (0.03 * far));
    if (score <= best.score) continue;
    const float angle = 2.0f * kPi * static_cast<float>(i) / kDirections;
    best = {position, horizon.front * std::cos(angle) + horizon.side * std::sin(angle), score};
  }
}

Vec3 lerp3(const Aabb& box, const Vec3& t) {
  const Vec3 size = box.max - box.min;
  return box.min + size * t;
}

/// The longest view from positions in the middle of the scene, at several heights.
Camera camera_inside(const Scene::Data& scene, const Horizon& horizon, float far) {
  Candidate best;
  constexpr std::array<float, 7> kAcross{0.12f, 0.25f, 0.38f, 0.5f, 0.62f, 0.75f, 0.88f};
  // A little below the middle: rooms are seen from the height of people rather than of lamps.
  constexpr std::array<float, 3> kUp{0.25f, 0.35f, 0.45f};
  for (const float a : kAcross) {
    for (const float b : kAcross) {
      for (const float h : kUp) {
        const Vec3 t = std::abs(horizon.up.z) > 0.9f   ? Vec3{a, b, h}
                       : std::abs(horizon.up.x) > 0.9f ? Vec3{h, a, b}
                                                       : Vec3{a, h, b};
        try_position(scene, lerp3(scene.bounds, t), horizon, far, best);
      }
    }
  }
  Camera camera;
  camera.position = best.position;
  camera.target = best.position + best.direction * (0.3f * far) + horizon.up * (0.015f * far);
  camera.up = horizon.up;
  camera.fov_y = 65.0f * kPi / 180.0f;
  return camera;
}

MeshView view_of(const Scene::Data& scene, std::vector<Triangle>& triangles) {
  triangles.reserve(scene.triangles.size());
  for (const TriangleRecord& record : scene.triangles) triangles.push_back(record.corners);
  return {.positions = scene.positions,
          .triangles = triangles,
          .normals = {},
          .tangents = {},
          .uvs = {},
          .colors = {},
          .materials = {}};
}

}  // namespace

Camera fit_camera(const MeshView& mesh, const Vec3& up, uint32_t width, uint32_t height,
                  const Viewpoint& viewpoint) {
  check_size(width, height);
  check_viewpoint(viewpoint);
  if (!is_finite(up) || is_black(up))
    throw Error(ErrorCode::kInvalidArgument, "up is no direction");
  validate(mesh);
  if (mesh.triangles.empty()) return {};
  return fit_points(mesh, horizon_of(up), width, height, viewpoint);
}

Camera auto_camera(const Scene& scene, uint32_t width, uint32_t height,
                   const Viewpoint& viewpoint) {
  check_size(width, height);
  check_viewpoint(viewpoint);
  const Scene::Data& data = scene.data();
  if (data.triangles.empty()) return {};
  const Horizon horizon = horizon_of(data.up);
  const auto diagonal =
      static_cast<float>(length(to_double(data.bounds.max) - to_double(data.bounds.min)));
  const Around around = look_around(data, center(data.bounds), horizon);
  // Inside a solid walls show their backs, and inside a thick model they are near.
  if (around.enclosed > 0.95 && around.facing > 0.5 && around.median > 0.1 * diagonal)
    return camera_inside(data, horizon, diagonal);
  std::vector<Triangle> triangles;
  return fit_points(view_of(data, triangles), horizon, width, height, viewpoint);
}

}  // namespace umbel::trace
