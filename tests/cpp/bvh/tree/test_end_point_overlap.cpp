#include <gtest/gtest.h>

#include <set>

#include "bvh/oracle.hpp"

namespace umbel {
namespace {

using namespace testing;

/// Two triangles side by side, the box of the left one reaching half over the right one.
TEST(BvhEndPointOverlap, two_triangles_that_overlap_by_half) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {1, 0, 0}, {3, 0, 0}, {1, 2, 0}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  bvh::Bvh2 tree;
  tree.nodes = {
      {{0, 0, 0}, 1, {3, 2, 0}, 0}, {{0, 0, 0}, 0, {2, 2, 0}, 1}, {{1, 0, 0}, 1, {3, 2, 0}, 1}};
  tree.primitives = {0, 1};
  // Of triangle 1 the part with x <= 2 has area 1.5; of triangle 0 that with x >= 1 has area 0.5.
  const double expected = 2.0 * (1.5 + 0.5) / 4;
  EXPECT_NEAR(bvh::end_point_overlap(tree, mesh.view()), expected, 1e-12);
  EXPECT_NEAR(bvh::end_point_overlap(tree, mesh.view(), {1, 5}), 2.5 * expected, 1e-12);
}

TEST(BvhEndPointOverlap, nothing_overlaps_in_one_leaf_or_far_apart) {
  Mesh mesh = shapes::sphere(1);
  bvh::Bvh2 leaf;
  const Aabb box = bounds(mesh.view());
  for (uint32_t i = 0; i < mesh.triangles.size(); ++i) leaf.primitives.push_back(i);
  leaf.nodes = {{box.min, 0, box.max, static_cast<uint32_t>(leaf.primitives.size())}};
  EXPECT_EQ(bvh::end_point_overlap(leaf, mesh.view()), 0);
  EXPECT_EQ(bvh::end_point_overlap({}, MeshView{}), 0);
  Mesh apart;
  for (uint32_t i = 0; i < 50; ++i) {
    const auto x = static_cast<float>(3 * i);
    apart.positions.insert(apart.positions.end(), {{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}});
    apart.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  EXPECT_EQ(bvh::end_point_overlap(bvh::build(apart.view()), apart.view()), 0);
}

/// The definition: each triangle in small pieces, each piece against every node.
double by_pieces(const bvh::Bvh2& tree, const MeshView& mesh, int steps) {
  std::vector<std::set<uint32_t>> below(tree.nodes.size());
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    const bvh::Node& node = tree.nodes[i];
    for (uint32_t k = 0; k < node.count; ++k) below[i].insert(tree.primitives[node.first + k]);
    if (!node.is_leaf())
      for (const uint32_t child : {node.first, node.first + 1})
        below[i].insert(below[child].begin(), below[child].end());
  }
  double total = 0, overlap = 0;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3d a = to_double(mesh.positions[mesh.triangles[t][0]]);
    const Vec3d ab = to_double(mesh.positions[mesh.triangles[t][1]]) - a;
    const Vec3d ac = to_double(mesh.positions[mesh.triangles[t][2]]) - a;
    const double area = length(cross(ab, ac));
    total += area;
    for (int i = 0; i < steps; ++i)
      for (int j = 0; j < 2 * (steps - i) - 1; ++j) {
        // The centres of steps^2 equal triangles.
        const double u = (i + (j % 2 ? 2.0 : 1.0) / 3) / steps;
        const auto row = j / 2;
        const double v = (row + (j % 2 ? 2.0 : 1.0) / 3) / steps;
        const Vec3d p = a + ab * u + ac * v;
        for (size_t n = 0; n < tree.nodes.size(); ++n) {
          const bvh::Node& node = tree.nodes[n];
          if (p.x < node.min.x || p.x > node.max.x || p.y < node.min.y || p.y > node.max.y ||
              p.z < node.min.z || p.z > node.max.z || below[n].contains(t))
            continue;
          overlap += area / (steps * steps) * (node.is_leaf() ? 2.0 * node.count : 3.0);
        }
      }
  }
  return overlap / total;
}

TEST(BvhEndPointOverlap, equals_its_definition) {
  for (const Mesh& mesh : {shapes::soup(60, 1), shapes::blob(1, 2), shapes::tetrahedra(15)})
    for (const bvh::Builder builder : bvh::builders()) {
      bvh::Config config;
      config.builder = builder;
      const bvh::Bvh2 tree = bvh::build(mesh.view(), config);
      const double pieces = by_pieces(tree, mesh.view(), 30);
      EXPECT_NEAR(bvh::end_point_overlap(tree, mesh.view()), pieces, 0.03 * pieces + 0.02)
          << bvh::name(builder);
    }
}

TEST(BvhEndPointOverlap, does_not_depend_on_scale_or_threads) {
  const Mesh mesh = shapes::blob(3, 3);
  const double once = bvh::end_point_overlap(bvh::build(mesh.view()), mesh.view());
  EXPECT_GT(once, 0.1);
  for (const float scale : {0x1p-100f, 0x1p-50f, 0x1p50f, 0x1p100f}) {
    const Mesh scaled = transformed(mesh, scale);
    EXPECT_NEAR(bvh::end_point_overlap(bvh::build(scaled.view()), scaled.view()), once,
                1e-6 * once);
  }
  const bvh::Bvh2 tree = bvh::build(mesh.view());
  for (const uint32_t threads : {1u, 2u, 5u}) {
    BuildOptions options;
    options.threads = threads;
    EXPECT_EQ(bvh::end_point_overlap(tree, mesh.view(), {}, options), once);
  }
}

TEST(BvhEndPointOverlap, trees_and_meshes_that_do_not_fit_are_refused) {
  const Mesh mesh = shapes::sphere(1);
  bvh::Bvh2 tree = bvh::build(mesh.view());
  EXPECT_THROW(bvh::end_point_overlap(tree, MeshView{}), Error);
  bvh::Bvh2 circle = tree;
  circle.nodes[0].first = 0;
  EXPECT_THROW(bvh::end_point_overlap(circle, mesh.view()), Error);
  bvh::Bvh2 long_leaf = tree;
  long_leaf.nodes.back().count = 1000;
  EXPECT_THROW(bvh::end_point_overlap(long_leaf, mesh.view()), Error);
}

TEST(BvhEndPointOverlap, tells_its_progress_and_can_be_cancelled) {
  const Mesh mesh = shapes::blob(5, 3);
  const bvh::Bvh2 tree = bvh::build(mesh.view());
  std::vector<float> told;
  BuildOptions options;
  options.threads = 1;
  options.progress = [&](float fraction, std::string_view) {
    told.push_back(fraction);
    return true;
  };
  const double once = bvh::end_point_overlap(tree, mesh.view(), {}, options);
  EXPECT_EQ(once, bvh::end_point_overlap(tree, mesh.view()));
  EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
  EXPECT_EQ(told.front(), 0.0f);
  EXPECT_EQ(told.back(), 1.0f);
  EXPECT_GT(told.size(), 10u);
  options.progress = [](float fraction, std::string_view) { return fraction < 0.5f; };
  try {
    bvh::end_point_overlap(tree, mesh.view(), {}, options);
    FAIL() << "it was not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
}

TEST(BvhEndPointOverlap, meshes_without_area_have_none) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 0, 0}, {1, 1, 2}};
  EXPECT_EQ(bvh::end_point_overlap(bvh::build(mesh.view()), mesh.view()), 0);
}

}  // namespace
}  // namespace umbel
