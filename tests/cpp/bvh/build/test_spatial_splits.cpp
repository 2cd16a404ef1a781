#include <gtest/gtest.h>

#include "base/math.hpp"
#include "bvh/build/clip_triangle.hpp"
#include "bvh/tree/box_node.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config spatial(float budget = 0.3f) {
  Config config;
  config.builder = Builder::kSpatial;
  config.spatial_budget = budget;
  return config;
}

/// Long thin triangles in all directions, whose boxes overlap everywhere.
Mesh needles(uint32_t count, uint32_t seed) {
  std::mt19937 random(seed);
  const auto next = [&] { return float(random() >> 8) * 0x1p-24f; };
  Mesh mesh;
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 a{next(), next(), next()}, b{next(), next(), next()};
    mesh.positions.insert(mesh.positions.end(), {a, b, {b.x + 0.01f, b.y, b.z}});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

struct NamedMesh {
  std::string name;
  Mesh mesh;
};

std::vector<NamedMesh> meshes() {
  std::vector<NamedMesh> all;
  for (const uint32_t n : {1u, 2u, 3u, 50u}) all.push_back({"few", needles(n, n)});
  all.push_back({"needles", needles(6000, 7)});
  all.push_back({"sphere", shapes::sphere(4)});
  all.push_back({"grid", shapes::grid(40, 40)});
  all.push_back({"fan", shapes::fan(5000)});
  Mesh identical = needles(1, 9), point = identical, line = needles(2000, 3);
  identical.triangles.assign(3000, identical.triangles[0]);
  point.positions.assign(3, Vec3{1, 2, 3});
  point.triangles.assign(3000, point.triangles[0]);
  for (Vec3& p : line.positions) p.y = p.z = 4;
  all.push_back({"identical", identical});
  all.push_back({"one point", point});
  all.push_back({"one line", line});
  return all;
}

uint32_t count_of(const Mesh& mesh) { return uint32_t(mesh.triangles.size()); }

TEST(Spatial, is_sound_within_its_limits_and_the_same_for_any_threads) {
  for (const NamedMesh& input : meshes()) {
    for (const float budget : {0.0f, 0.05f, 1.0f}) {
      SCOPED_TRACE(input.name + ", budget " + std::to_string(budget));
      Config config = spatial(budget);
      config.spatial_overlap = 0;
      const uint32_t n = count_of(input.mesh);
      const Bvh2 tree = build(input.mesh.view(), config, with_thread_count(1));
      ASSERT_NO_THROW(check(tree, n, true));
      EXPECT_LE(tree.primitives.size(), size_t(double(n) * (1 + double(budget))));
      for (const Node& node : tree.nodes) {
        ASSERT_LE(node.count, config.max_leaf_size);
        for (uint32_t k = 1; k < node.count; ++k)
          ASSERT_LT(tree.primitives[node.first + k - 1], tree.primitives[node.first + k]);
        if (node.is_leaf()) continue;
        Box4 box = Box4::from(tree.nodes[node.first].box());
        box.extend(Box4::from(tree.nodes[node.first + 1].box()));
        ASSERT_EQ(node_of(box, node.first, 0), node);
      }
      expect_same(tree, build(input.mesh.view(), config, with_thread_count(2)));
      expect_same(tree, build(input.mesh.view(), config, with_thread_count(8)));
    }
  }
}

TEST(Spatial, parts_of_a_triangle_cover_it) {
  const Mesh mesh = needles(3000, 1);
  Config config = spatial(1);
  config.spatial_overlap = 0;
  const Bvh2 tree = build(mesh.view(), config);
  std::vector<std::vector<Aabb>> parts(mesh.triangles.size());
  for (const Node& node : tree.nodes)
    for (uint32_t k = 0; k < node.count; ++k)
      parts[tree.primitives[node.first + k]].push_back(node.box());
  std::mt19937 random(2);
  const auto next = [&] { return double(random()) * 0x1p-32; };
  for (size_t t = 0; t < parts.size(); ++t) {
    for (int k = 0; k < 40; ++k) {
      double u = next(), v = next();
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const auto& [a, b, c] = mesh.triangles[t];
      const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
      const auto at = [&](float x, float y, float z) {
        return x + u * (y - double(x)) + v * (z - double(x));
      };
      const double x = at(p.x, q.x, r.x), y = at(p.y, q.y, r.y), z = at(p.z, q.z, r.z);
      const bool covered = std::any_of(parts[t].begin(), parts[t].end(), [&](const Aabb& box) {
        return box.min.x <= x && x <= box.max.x && box.min.y <= y && y <= box.max.y &&
               box.min.z <= z && z <= box.max.z;
      });
      ASSERT_TRUE(covered) << "triangle " << t;
    }
  }
}

TEST(Spatial, boxes_hold_triangles_whose_coordinates_underflow_beside_others) {
  for (const Vec3& size : {Vec3{1e20f, 1, 1e-20f}, Vec3{1e30f, 1e-10f, 1e-12f},
                           Vec3{1e-20f, 1e-41f, 1e-20f}, Vec3{1e-44f, 1e38f, 1e-30f}}) {
    Mesh mesh = needles(300, 4);
    for (Vec3& p : mesh.positions) p = {p.x * size.x, p.y * size.y, p.z * size.z};
    Config config = spatial(1);
    config.spatial_overlap = 0;
    config.max_leaf_size = 1;
    const Bvh2 tree = build(mesh.view(), config);
    std::vector<Aabb> parts(mesh.triangles.size());
    for (const Node& node : tree.nodes)
      for (uint32_t k = 0; k < node.count; ++k)
        extend(parts[tree.primitives[node.first + k]], node.box());
    const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
    for (size_t i = 0; i < boxes.size(); ++i) ASSERT_EQ(parts[i], boxes[i]) << "triangle " << i;
  }
}

TEST(Spatial, clipped_boxes_hold_both_sides) {
  std::mt19937 random(3);
  const auto next = [&] { return float(random() >> 8) * 0x1p-22f - 2; };
  for (int i = 0; i < 20000; ++i) {
    Mesh mesh;
    for (int k = 0; k < 3; ++k) mesh.positions.push_back({next(), next(), next()});
    mesh.triangles.push_back({0, 1, 2});
    const Corners corners(mesh.view(), 0);
    Box4 box = Box4::empty(), before, behind;
    for (const Float4 p : corners.at) box.extend({p, -p});
    const int axis = i % 3;
    const float plane = box.low[axis] + box.extents()[axis] * (next() + 2) / 4;
    clip_triangle(corners, box, axis, plane, before, behind);
    for (int k = 0; k < 20; ++k) {
      double u = (next() + 2) / 4.0, v = (next() + 2) / 4.0;
      if (u + v > 1) u = 1 - u, v = 1 - v;
      double p[3];
      for (int a = 0; a < 3; ++a)
        p[a] = corners.at[0][a] + u * (corners.at[1][a] - double(corners.at[0][a])) +
               v * (corners.at[2][a] - double(corners.at[0][a]));
      const Box4& side = p[axis] <= plane ? before : behind;
      for (int a = 0; a < 3; ++a) {
        ASSERT_LE(side.low[a], p[a]);
        ASSERT_GE(-side.negated_high[a], p[a]);
      }
    }
  }
}

TEST(Spatial, splits_long_triangles_where_that_pays) {
  // Beams through a cloud of small triangles.
  Mesh mesh = shapes::blob(4, 1);
  const Mesh beams = needles(100, 4);
  for (const Triangle& t : beams.triangles) {
    const auto first = uint32_t(mesh.positions.size());
    for (const uint32_t v : t) {
      const Vec3& p = beams.positions[v];
      mesh.positions.push_back({4 * p.x - 2, 4 * p.y - 2, 4 * p.z - 2});
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  Config sweep;
  sweep.builder = Builder::kSweep;
  const double whole = sah_cost(build(mesh.view(), sweep));
  double before = sah_cost(build(mesh.view(), spatial(0)));
  EXPECT_LT(before, 1.1 * whole);
  for (const float budget : {0.03f, 0.1f, 0.3f}) {
    const double cost = sah_cost(build(mesh.view(), spatial(budget)));
    EXPECT_LT(cost, before) << "budget " << budget;
    before = cost;
  }
  EXPECT_LT(before, 0.7 * whole);
}

TEST(Spatial, small_triangles_stay_whole) {
  const Mesh mesh = shapes::blob(4, 1);
  const Bvh2 tree = build(mesh.view(), spatial());
  EXPECT_LT(tree.primitives.size(), 1.1 * double(mesh.triangles.size()));
  Config sweep;
  sweep.builder = Builder::kSweep;
  EXPECT_LT(sah_cost(tree), 1.03 * sah_cost(build(mesh.view(), sweep)));
}

TEST(Spatial, keeps_the_depth) {
  Config config = spatial(1);
  config.max_depth = 14;
  config.spatial_overlap = 0;
  for (const NamedMesh& input : meshes()) {
    SCOPED_TRACE(input.name);
    const Bvh2 tree = build(input.mesh.view(), config);
    check(tree, count_of(input.mesh), true);
    EXPECT_LE(statistics(tree).max_depth, 14u);
  }
}

}  // namespace
}  // namespace umbel::bvh
