// Rays, distances, refit and files of a triangle BVH; and a BVH over your own primitives.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <umbel/bvh_traverse.hpp>
#include <umbel/umbel.hpp>

namespace {

/// The visible fraction of the sky, by rays over the upper hemisphere.
float open_sky(const umbel::Bvh& bvh, const umbel::Vec3& point) {
  std::vector<umbel::Ray> rays;
  for (int i = 0; i < 16; ++i)
    for (int k = 0; k < 4; ++k) {
      const float around = 0.3926991f * static_cast<float>(i), up = 0.2f + 0.25f * float(k);
      const float flat = std::sqrt(1 - up * up);
      rays.push_back({point, 1e-4f, {flat * std::cos(around), flat * std::sin(around), up}});
    }
  std::vector<uint8_t> hidden(rays.size());
  bvh.occluded(rays, hidden);
  return float(std::count(hidden.begin(), hidden.end(), 0)) / float(hidden.size());
}

/// The sphere nearest to a point. The caller decides what happens at a leaf.
uint32_t nearest_sphere(const umbel::bvh::Bvh2& tree, const std::vector<umbel::Sphere>& spheres,
                        const umbel::Vec3& p) {
  const auto distance_to = [&](const umbel::Sphere& s) {
    return std::hypot(s.center.x - p.x, s.center.y - p.y, s.center.z - p.z) - s.radius;
  };
  uint32_t nearest = umbel::kNone;
  float least = std::numeric_limits<float>::max();
  umbel::bvh::traverse_ordered(
      tree,
      [&](const umbel::bvh::Node& node) {
        return std::hypot(std::max({node.min.x - p.x, p.x - node.max.x, 0.0f}),
                          std::max({node.min.y - p.y, p.y - node.max.y, 0.0f}),
                          std::max({node.min.z - p.z, p.z - node.max.z, 0.0f}));
      },
      [&](std::span<const uint32_t> primitives) {
        for (const uint32_t i : primitives)
          if (distance_to(spheres[i]) < least) least = distance_to(spheres[nearest = i]);
        return least;
      });
  return nearest;
}

void own_primitives() {
  std::vector<umbel::Sphere> spheres;
  std::vector<umbel::Aabb> boxes;
  for (int i = 0; i < 1000; ++i) {
    const float a = static_cast<float>(i);
    const umbel::Vec3 c{std::sin(12.9898f * a), std::sin(78.233f * a), std::sin(37.719f * a)};
    const float r = 0.01f;
    spheres.push_back({c, r});
    boxes.push_back({{c.x - r, c.y - r, c.z - r}, {c.x + r, c.y + r, c.z + r}});
  }
  const umbel::bvh::Bvh2 tree = umbel::bvh::build(boxes);
  std::printf("sphere %u is nearest to the origin\n", nearest_sphere(tree, spheres, {0, 0, 0}));
}

}  // namespace

int main() {
  umbel::Mesh mesh = umbel::shapes::terrain(200, 200, 1);
  umbel::BvhConfig config;
  config.tree = umbel::bvh::preset("quality");  // or "fast", "best"
  umbel::Bvh bvh = umbel::Bvh::build(mesh.view(), config);

  const umbel::Hit hit = bvh.intersect({{0.5f, 0.5f, 10}, 0, {0, 0, -1}});
  if (!hit.hit()) return 1;
  std::printf("triangle %u at t = %.3f\n", hit.primitive, double(hit.t));
  std::printf("%.0f %% of the sky is open there\n",
              100 * double(open_sky(bvh, {0.5f, 0.5f, 10 - hit.t})));
  std::printf("the nearest point is %.3f away\n",
              double(bvh.closest_point({0.5f, 0.5f, 1}).distance));

  for (umbel::Vec3& p : mesh.positions) p.z *= 2;
  const umbel::RefitReport report = bvh.refit(mesh.view());
  std::printf("SAH cost %.1f after the refit, %.1f before it%s\n", report.sah_cost,
              report.built_sah_cost, report.rebuild_advised ? ": rebuild" : "");

  bvh.save("terrain.umbvh");
  const umbel::Bvh loaded = umbel::Bvh::load("terrain.umbvh");
  std::printf("%u nodes from the file\n", loaded.statistics().nodes);
  own_primitives();
}
