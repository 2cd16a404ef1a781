#include <gtest/gtest.h>

#include "bvh/every_config.hpp"
#include "bvh/oracle.hpp"

namespace umbel {
namespace {

using namespace testing;

/// [0, n]^3 of unit squares, two triangles each, closed.
Mesh cube(uint32_t n) {
  Mesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (const bool high : {false, true})
      for (uint32_t i = 0; i < n; ++i)
        for (uint32_t j = 0; j < n; ++j) {
          const auto base = static_cast<uint32_t>(mesh.positions.size());
          for (uint32_t k = 0; k < 4; ++k) {
            Vec3 p{};
            (&p.x)[axis] = high ? static_cast<float>(n) : 0.0f;
            (&p.x)[(axis + 1) % 3] = static_cast<float>(i + (k & 1));
            (&p.x)[(axis + 2) % 3] = static_cast<float>(j + (k >> 1));
            mesh.positions.push_back(p);
          }
          const Triangle a{base, base + 1, base + 3}, b{base, base + 3, base + 2};
          for (const Triangle& t : {a, b})
            mesh.triangles.push_back(high ? t : Triangle{t[0], t[2], t[1]});
        }
  return weld(mesh.view());
}

TEST(BvhContains, a_grid_of_points_through_every_vertex_and_edge_of_a_cube) {
  const Mesh mesh = cube(4);
  for (const uint32_t width : {2u, 4u, 8u}) {
    BvhConfig config;
    config.width = width;
    const Bvh tree = Bvh::build(mesh.view(), config);
    // Every half: rays along the axes meet vertices, edges and diagonals.
    for (int x = -2; x <= 10; ++x)
      for (int y = -2; y <= 10; ++y)
        for (int z = -2; z <= 10; ++z) {
          const auto on = [](int c) { return c == 0 || c == 8; };
          const auto in = [](int c) { return c > 0 && c < 8; };
          if (on(x) || on(y) || on(z)) continue;
          ASSERT_EQ(tree.contains(Vec3{x / 2.0f, y / 2.0f, z / 2.0f}), in(x) && in(y) && in(z))
              << x << " " << y << " " << z;
        }
  }
}

TEST(BvhContains, points_in_line_with_vertices_are_judged_by_the_winding_number) {
  const Mesh meshes[] = {shapes::sphere(2), shapes::torus(16, 10), shapes::blob(2, 5),
                         shapes::tetrahedra(30),
                         transformed(shapes::blob(2, 6), 1, {1000, -500, 300})};
  for (const Mesh& mesh : meshes) {
    const Bvh tree = Bvh::build(mesh.view());
    std::mt19937 random(1);
    const auto coordinate = [&](int axis) {
      return (&mesh.positions[random() % mesh.positions.size()].x)[axis];
    };
    size_t judged = 0;
    for (int i = 0; i < 400; ++i) {
      // Each coordinate is some vertex's, so that most axes' rays pass through something.
      const Vec3& one = mesh.positions[random() % mesh.positions.size()];
      Vec3 p = one;
      (&p.x)[i % 3] = coordinate(i % 3);
      if (i % 2) (&p.x)[(i + 1) % 3] = coordinate((i + 1) % 3);
      if (closest_distance2(mesh.view(), p) < 1e-10) continue;
      ++judged;
      ASSERT_EQ(tree.contains(p), std::abs(winding_number(mesh.view(), p)) > 0.5) << i;
    }
    EXPECT_GT(judged, 150u);
  }
}

TEST(BvhContains, every_builder_and_width_agree_at_every_scale) {
  for (const float scale : {1e-35f, 1e-15f, 1.0f, 1e15f, 1e35f}) {
    const Mesh mesh = transformed(shapes::blob(2, 9), scale);
    std::mt19937 random(2);
    std::uniform_real_distribution<float> unit(-1.2f, 1.2f);
    std::vector<Vec3> points(150);
    for (Vec3& p : points) p = {unit(random) * scale, unit(random) * scale, unit(random) * scale};
    std::vector<bool> truth;
    for (const Vec3& p : points) truth.push_back(winding_number(mesh.view(), p) > 0.5);
    for (const BvhConfig& config : every_config()) {
      const Bvh tree = Bvh::build(mesh.view(), config);
      for (size_t i = 0; i < points.size(); ++i)
        ASSERT_EQ(tree.contains(points[i]), truth[i])
            << bvh::name(config.tree.builder) << " " << scale;
    }
  }
}

TEST(BvhContains, a_wall_that_two_solids_share_does_not_hide_the_inside) {
  // Two cubes side by side, each with its own copy of the face between them.
  Mesh mesh = cube(2);
  const Mesh other = transformed(mesh, 1, {2, 0, 0});
  const auto base = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  for (const Triangle& t : other.triangles)
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  const Bvh tree = Bvh::build(mesh.view());
  for (int halves = -1; halves < 10; ++halves) {
    const float x = 0.5f * float(halves);
    if (x == 0 || x == 2 || x == 4) continue;
    EXPECT_EQ(tree.contains(Vec3{x, 1, 1}), x > 0 && x < 4) << x;
  }
}

TEST(BvhContains, batches_equal_single_points) {
  const Mesh mesh = shapes::blob(3, 4);
  const Bvh tree = Bvh::build(mesh.view());
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(-1.2f, 1.2f);
  std::vector<Vec3> points(6000);
  for (Vec3& p : points) p = {unit(random), unit(random), unit(random)};
  points[0].x = std::nanf("");
  std::vector<uint8_t> inside(points.size());
  std::vector<float> distances(points.size());
  tree.contains(points, inside);
  tree.signed_distance(points, distances);
  for (size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(inside[i] != 0, tree.contains(points[i]));
    ASSERT_EQ(distances[i], tree.signed_distance(points[i]));
    ASSERT_EQ(std::abs(distances[i]), tree.closest_point(points[i]).distance);
    ASSERT_EQ(distances[i] < 0, inside[i] != 0);
  }
  EXPECT_FALSE(tree.contains(Vec3{std::nanf(""), 0, 0}));
}

TEST(BvhContains, real_closed_meshes_are_judged_by_the_winding_number) {
  size_t read = 0;
  for (const char* name :
       {"dragon_871k.ply", "armadillo_86k.ply", "cad_brick_housing_24k.ply", "skull_100k.ply"}) {
    const auto mesh = read_mesh(name);
    if (!mesh) continue;
    ++read;
    const Bvh tree = Bvh::build(mesh->view());
    const Aabb box = tree.bounds();
    std::mt19937 random(4);
    std::uniform_real_distribution<float> unit(0, 1);
    for (int i = 0; i < 12; ++i) {
      const Vec3 p{box.min.x + (box.max.x - box.min.x) * unit(random),
                   box.min.y + (box.max.y - box.min.y) * unit(random),
                   box.min.z + (box.max.z - box.min.z) * unit(random)};
      const auto turns = std::lround(winding_number(mesh->view(), p));
      ASSERT_EQ(tree.contains(p), turns % 2 != 0) << name;
    }
  }
  if (read == 0) GTEST_SKIP() << "no meshes";
}

// ---- signs --------------------------------------------------------------------------------------

TEST(BvhOrientation, signs_equal_those_of_exact_integers) {
  std::mt19937 random(5);
  size_t zeros = 0;
  for (int run = 0; run < 20000; ++run) {
    // Near a line or a plane, as floats whose sums need more bits than doubles have.
    const int64_t unit = run % 2 ? 1 : 1 << 12;
    const auto next = [&] { return static_cast<int64_t>(random() % 9) - 4; };
    int64_t p[4][3];
    const int64_t large = int64_t{1} << 23;
    for (auto& v : p)
      for (int64_t& c : v) c = large * unit * (next() % 2) + next();
    const auto f = [](int64_t c) { return static_cast<float>(c); };
    Vec3 v[4];
    for (int i = 0; i < 4; ++i) {
      v[i] = {f(p[i][0]), f(p[i][1]), f(p[i][2])};
      for (int k = 0; k < 3; ++k) p[i][k] = static_cast<int64_t>((&v[i].x)[k]);
    }
    using Wide = __int128;
    const auto d = [&](int i, int k) { return Wide(p[i][k] - p[3][k]); };
    const Wide three = d(0, 2) * (d(1, 0) * d(2, 1) - d(2, 0) * d(1, 1)) +
                       d(1, 2) * (d(2, 0) * d(0, 1) - d(0, 0) * d(2, 1)) +
                       d(2, 2) * (d(0, 0) * d(1, 1) - d(1, 0) * d(0, 1));
    ASSERT_EQ(orientation::orient3d(v[0], v[1], v[2], v[3]), (three > 0) - (three < 0));
    ASSERT_EQ(orientation::detail::orient3d_exact(v[0], v[1], v[2], v[3]),
              (three > 0) - (three < 0));
    const Wide two = d(0, 0) * d(1, 1) - d(0, 1) * d(1, 0);
    ASSERT_EQ(orientation::orient2d({v[0].x, v[0].y}, {v[1].x, v[1].y}, {v[3].x, v[3].y}),
              (two > 0) - (two < 0));
    zeros += three == 0;
  }
  EXPECT_GT(zeros, 100u);
}

}  // namespace
}  // namespace umbel
