#include <gtest/gtest.h>

#include "bvh/every_config.hpp"
#include "bvh/oracle.hpp"

namespace umbel {
namespace {

using namespace testing;

std::vector<Vec3> points_around(const MeshView& mesh, size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  const Aabb box = bounds(mesh);
  std::vector<Vec3> points;
  while (points.size() < count) {
    const auto between = [&](float low, float high) {
      return low - (high - low) / 2 + 2 * unit(random) * (high - low);
    };
    points.push_back({between(box.min.x, box.max.x), between(box.min.y, box.max.y),
                      between(box.min.z, box.max.z)});
    points.push_back(mesh.positions[mesh.triangles[random() % mesh.triangles.size()][0]]);
  }
  return points;
}

void expect_closest(const MeshView& mesh, const Bvh& tree, const Vec3& p) {
  const ClosestPoint found = tree.closest_point(p);
  const double distance = std::sqrt(closest_distance2(mesh, p));
  ASSERT_NE(found.primitive, kNone);
  const Triangle& t = mesh.triangles[found.primitive];
  const Vec3d a = to_double(mesh.positions[t[0]]), b = to_double(mesh.positions[t[1]]),
              c = to_double(mesh.positions[t[2]]);
  const double size = std::max({length(a), length(b), length(c), length(to_double(p))});
  ASSERT_NEAR(found.distance, distance, 1e-6 * distance + 1e-12 * size);
  // Where it says, on the triangle that it says.
  const Vec3d on = a + (b - a) * double(found.u) + (c - a) * double(found.v);
  ASSERT_LE(length(on - to_double(found.point)), 1e-6 * size);
  ASSERT_GE(found.u, 0);
  ASSERT_GE(found.v, 0);
  ASSERT_LE(found.u + found.v, 1 + 1e-6f);
  ASSERT_NEAR(length(to_double(found.point) - to_double(p)), distance, 1e-6 * size);
}

TEST(BvhClosestPoint, equals_brute_force_for_every_width) {
  const Mesh meshes[] = {
      shapes::blob(2, 1), shapes::soup(200, 2),
      shapes::grid(8, 8), shapes::fan(50),
      shapes::sphere(0),  transformed(shapes::torus(12, 8), 1, {500, 500, -300})};
  for (const Mesh& mesh : meshes)
    for (const uint32_t width : {2u, 4u, 8u})
      for (const bool compact : {false, true}) {
        BvhConfig config;
        config.width = width, config.compact = compact;
        const Bvh tree = Bvh::build(mesh.view(), config);
        for (const Vec3& p : points_around(mesh.view(), 200, 3))
          expect_closest(mesh.view(), tree, p);
      }
}

TEST(BvhClosestPoint, works_at_any_scale) {
  for (const float scale : {1e-37f, 1e-30f, 1e-15f, 1e-5f, 1e5f, 1e15f, 1e30f, 1e37f}) {
    const Mesh mesh = transformed(shapes::blob(2, 1), scale);
    const Bvh tree = Bvh::build(mesh.view());
    for (const Vec3& p : points_around(mesh.view(), 60, 4)) expect_closest(mesh.view(), tree, p);
    // A far-away point, and one that is close to nothing but the origin.
    expect_closest(mesh.view(), tree, {1, 2, 3});
    expect_closest(mesh.view(), tree, {0, 0, 0});
  }
}

TEST(BvhClosestPoint, is_found_where_triangles_are_smaller_than_the_distance_s_rounding) {
  // Beside a triangle of common size, behind the others from where the points are.
  for (int exponent = -40; exponent >= -64; --exponent) {
    Mesh mesh = transformed(shapes::blob(2, 1), std::ldexp(1.0f, exponent));
    const size_t tiny = mesh.triangles.size();
    const auto first = uint32_t(mesh.positions.size());
    for (const Vec3& corner : {Vec3{5, 0, 0}, Vec3{5, 1, 0}, Vec3{5, 0, 1}})
      mesh.positions.push_back(corner);
    mesh.triangles.push_back({first, first + 1, first + 2});
    for (const bool compact : {false, true}) {
      BvhConfig config;
      config.compact = compact;
      const Bvh tree = Bvh::build(mesh.view(), config);
      for (const Vec3& p : points_around(shapes::sphere(0).view(), 50, 5)) {
        const double distance = length(to_double(p));
        ASSERT_NEAR(tree.closest_point(p).distance, distance, 1e-6);
        ASSERT_EQ(tree.overlaps(Sphere{p, float(distance) + 1e-6f}).size(), tiny);
      }
    }
  }
}

TEST(BvhClosestPoint, of_equals_the_lowest_triangle_is_taken_by_every_tree) {
  Mesh mesh = shapes::sphere(2);
  mesh.triangles.insert(mesh.triangles.end(), mesh.triangles.begin(), mesh.triangles.end());
  BvhConfig first;
  first.width = 2;
  const Bvh reference = Bvh::build(mesh.view(), first);
  for (const BvhConfig& config : every_config()) {
    const Bvh tree = Bvh::build(mesh.view(), config);
    for (const Vec3& p : points_around(mesh.view(), 100, 5)) {
      const ClosestPoint a = reference.closest_point(p), b = tree.closest_point(p);
      ASSERT_EQ(a.primitive, b.primitive) << bvh::name(config.tree.builder) << " " << config.width;
      ASSERT_EQ(a.point, b.point);
      ASSERT_EQ(a.distance, b.distance);
      ASSERT_LT(a.primitive, mesh.triangles.size() / 2);
    }
  }
}

TEST(BvhClosestPoint, batches_equal_single_points_for_any_threads) {
  const Mesh mesh = shapes::blob(4, 2);
  const Bvh tree = Bvh::build(mesh.view());
  // More than are sorted, and fewer.
  for (const size_t count : {10000u, 100u}) {
    std::vector<Vec3> points = points_around(mesh.view(), count, 6);
    points[7].y = std::numeric_limits<float>::quiet_NaN();
    points[8].z = std::numeric_limits<float>::infinity();
    for (const uint32_t threads : {1u, 2u, 0u})
      for (const float limit : {std::numeric_limits<float>::infinity(), 0.1f}) {
        std::vector<ClosestPoint> results(points.size());
        tree.closest_point(points, results, limit, threads);
        for (size_t i = 0; i < points.size(); ++i) {
          const ClosestPoint one = tree.closest_point(points[i], limit);
          ASSERT_EQ(results[i].primitive, one.primitive);
          ASSERT_EQ(results[i].distance, one.distance);
          ASSERT_EQ(results[i].point, one.point);
        }
      }
  }
}

TEST(BvhClosestPoint, nothing_is_found_beyond_the_distance_asked_for) {
  const Mesh mesh = shapes::grid(4, 4);
  const Bvh tree = Bvh::build(mesh.view());
  const Vec3 p{0.5f, 0.5f, 0.25f};
  EXPECT_EQ(tree.closest_point(p, 0.2499f).primitive, kNone);
  EXPECT_EQ(tree.closest_point(p, 0.25f).distance, 0.25f);
  EXPECT_EQ(tree.closest_point(Vec3{0.5f, 0.5f, 0}, 0).distance, 0);
  EXPECT_EQ(tree.closest_point(p, -1).primitive, kNone);
  EXPECT_EQ(tree.closest_point(p, std::numeric_limits<float>::quiet_NaN()).primitive, kNone);
  EXPECT_EQ(tree.closest_point(Vec3{std::nanf(""), 0, 0}).primitive, kNone);
}

TEST(BvhClosestPoint, lengths_that_differ_are_refused) {
  const Bvh tree;
  std::vector<Vec3> points(3);
  std::vector<ClosestPoint> results(2);
  std::vector<float> distances(4);
  EXPECT_THROW(tree.closest_point(points, results), Error);
  EXPECT_THROW(tree.signed_distance(points, distances), Error);
}

TEST(BvhClosestPoint, degenerate_triangles_are_the_segments_and_points_they_look_like) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {5, 5, 5}};
  mesh.triangles = {{0, 1, 2}, {3, 3, 3}, {0, 2, 0}};
  const Bvh tree = Bvh::build(mesh.view());
  EXPECT_EQ(tree.closest_point(Vec3{2, 1, 0}).distance, 1);
  EXPECT_EQ(tree.closest_point(Vec3{2, 1, 0}).point, (Vec3{2, 0, 0}));
  EXPECT_EQ(tree.closest_point(Vec3{4, 0, 0}).distance, 1);
  EXPECT_EQ(tree.closest_point(Vec3{5, 5, 7}).distance, 2);
}

TEST(BvhClosestPoint, real_meshes_equal_brute_force) {
  size_t read = 0;
  for (const char* name :
       {"dragon_11k_res4.ply", "nasty_synth_needles_20k.ply", "cad_gears_19k.ply",
        "nasty_mpi_180.ply", "nasty_synth_all_degenerate.ply", "nasty_synth_dragon_tiny.ply",
        "nasty_synth_dragon_ecef_f32.ply", "dragon_871k.ply"}) {
    const auto mesh = read_mesh(name);
    if (!mesh) continue;
    ++read;
    const Bvh tree = Bvh::build(mesh->view());
    const size_t count = mesh->triangles.size() > 100000 ? 6 : 30;
    for (const Vec3& p : points_around(mesh->view(), count, 7))
      expect_closest(mesh->view(), tree, p);
  }
  if (read == 0) GTEST_SKIP() << "no meshes";
}

TEST(BvhClosestPoint, a_triangle_is_as_close_as_the_closest_of_many_of_its_points) {
  std::mt19937 random(8);
  std::uniform_real_distribution<float> unit(-1, 1);
  for (int run = 0; run < 300; ++run) {
    Vec3 p[4];
    for (Vec3& v : p) v = {unit(random), unit(random), unit(random)};
    if (run % 3 == 1) p[2] = {p[1].x + 1e-6f * unit(random), p[1].y, p[1].z};  // a needle
    if (run % 3 == 2) p[2] = {(p[0].x + p[1].x) / 2, (p[0].y + p[1].y) / 2, (p[0].z + p[1].z) / 2};
    const double found = std::sqrt(closest_on_triangle(p[3], p[0], p[1], p[2]).distance2);
    double best = std::numeric_limits<double>::infinity();
    constexpr int kSteps = 60;
    for (int i = 0; i <= kSteps; ++i)
      for (int j = 0; i + j <= kSteps; ++j) {
        const Vec3d a = to_double(p[0]);
        const Vec3d q = a + (to_double(p[1]) - a) * (double(i) / kSteps) +
                        (to_double(p[2]) - a) * (double(j) / kSteps);
        best = std::min(best, length(q - to_double(p[3])));
      }
    ASSERT_LE(found, best + 1e-12);
    ASSERT_GE(found, best - 0.05);
  }
}

}  // namespace
}  // namespace umbel
