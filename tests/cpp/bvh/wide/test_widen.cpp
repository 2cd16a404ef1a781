// Wide trees: every triangle is in one leaf with its own corners, and inside every box above it.
#include <gtest/gtest.h>

#include <algorithm>

#include "base/parallel.hpp"
#include "bvh/wide/widen.hpp"
#include "umbel/mesh.hpp"

namespace umbel {
namespace {

bool holds(const Aabb& outer, const Aabb& inner) {
  const Aabb joined{min(outer.min, inner.min), max(outer.max, inner.max)};
  return joined == outer;
}

/// Checks all below a node; returns the box around the triangles there.
Aabb check_node(const BvhData& data, const Mesh& mesh, uint32_t node, uint32_t depth,
                std::vector<uint32_t>& seen) {
  Aabb all;
  for (uint32_t slot = 0; slot < data.width; ++slot) {
    const uint32_t link = data.link(node, slot);
    if (link == kNoChild) continue;
    Aabb box;
    if (BvhData::is_leaf(link)) {
      EXPECT_LE(depth + 1, data.max_depth);
      data.for_each_triangle(link, [&](const LeafTriangle& t) {
        const Triangle& triangle = mesh.triangles[t.primitive];
        EXPECT_EQ(t.p0, mesh.positions[triangle[0]]);
        EXPECT_EQ(t.p1, mesh.positions[triangle[1]]);
        EXPECT_EQ(t.p2, mesh.positions[triangle[2]]);
        for (const Vec3& p : {t.p0, t.p1, t.p2}) extend(box, p);
        seen.push_back(t.primitive);
      });
    } else {
      const uint32_t child = data.linked_node(link);
      EXPECT_EQ(data.node_link(child), link);
      EXPECT_GT(child, node) << "children come after their parent";
      box = check_node(data, mesh, child, depth + 1, seen);
    }
    EXPECT_TRUE(holds(data.box(node, slot), box));
    extend(all, box);
  }
  return all;
}

class Widen : public ::testing::TestWithParam<uint32_t> {};

TEST_P(Widen, every_triangle_is_in_one_leaf_and_in_the_boxes_above) {
  for (const Mesh& mesh : {shapes::blob(4, 1), shapes::soup(2000, 2), shapes::grid(1, 1)})
    for (const bool compact : {false, true}) {
      const bvh::Bvh2 tree = bvh::build(mesh.view());
      const BvhData data = widen_tree(tree, mesh.view(), {GetParam(), compact}, {});
      std::vector<uint32_t> seen;
      const Aabb box = check_node(data, mesh, 0, 0, seen);
      EXPECT_EQ(box, data.bounds);
      std::sort(seen.begin(), seen.end());
      ASSERT_EQ(seen.size(), mesh.triangles.size());
      for (uint32_t i = 0; i < seen.size(); ++i) ASSERT_EQ(seen[i], i);
    }
}

TEST_P(Widen, leaves_larger_than_a_pack_are_cut_up) {
  Mesh mesh = shapes::soup(250, 3);
  bvh::Bvh2 tree;
  const Aabb box = bounds(mesh.view());
  tree.nodes = {{box.min, 0, box.max, 250}};
  for (uint32_t i = 0; i < 250; ++i) tree.primitives.push_back(i);
  const BvhData data = widen_tree(tree, mesh.view(), {GetParam(), false}, {});
  std::vector<uint32_t> seen;
  check_node(data, mesh, 0, 0, seen);
  std::sort(seen.begin(), seen.end());
  EXPECT_EQ(seen, tree.primitives);
}

TEST_P(Widen, triangles_in_several_leaves_are_noted) {
  Mesh mesh = shapes::soup(2000, 2);
  // Large, so that their boxes overlap much.
  for (const Triangle& t : mesh.triangles)
    mesh.positions[t[2]] = mesh.positions[t[0]] * -1.0f + Vec3{1, 1, 1};
  bvh::Config config;
  EXPECT_EQ(widen_tree(bvh::build(mesh.view()), mesh.view(), {GetParam(), false}, {}).repeats, 0u);
  config.builder = bvh::Builder::kSpatial;
  const bvh::Bvh2 tree = bvh::build(mesh.view(), config);
  ASSERT_GT(tree.primitives.size(), mesh.triangles.size());
  EXPECT_EQ(widen_tree(tree, mesh.view(), {GetParam(), false}, {}).repeats, 1u);
}

TEST_P(Widen, the_result_does_not_depend_on_threads) {
  const Mesh mesh = shapes::blob(4, 1);
  const bvh::Bvh2 tree = bvh::build(mesh.view());
  for (const bool compact : {false, true}) {
    BvhData one, two;
    with_threads(1, [&] { one = widen_tree(tree, mesh.view(), {GetParam(), compact}, {}); });
    with_threads(2, [&] { two = widen_tree(tree, mesh.view(), {GetParam(), compact}, {}); });
    EXPECT_EQ(one.nodes, two.nodes);
    EXPECT_EQ(one.leaves, two.leaves);
    EXPECT_EQ(one.vertices.size(), two.vertices.size());
    EXPECT_EQ(one.max_depth, two.max_depth);
    EXPECT_EQ(one.leaf_count, two.leaf_count);
  }
}
TEST_P(Widen, trees_of_any_depth_are_taken) {
  // Each node is a leaf and all the rest.
  const Mesh mesh = shapes::soup(20000, 4);
  const Aabb box = bounds(mesh.view());
  bvh::Bvh2 chain;
  const auto count = static_cast<uint32_t>(mesh.triangles.size());
  chain.nodes.push_back({box.min, 1, box.max, 0});
  for (uint32_t i = 0; i < count; ++i) {
    chain.primitives.push_back(i);
    if (i + 1 == count) break;
    Aabb own;
    for (const uint32_t vertex : mesh.triangles[i]) extend(own, mesh.positions[vertex]);
    chain.nodes.push_back({own.min, i, own.max, 1});
    const bool is_last = i + 2 == count;
    chain.nodes.push_back({box.min, is_last ? i + 1 : 2 * i + 3, box.max, is_last ? 1u : 0u});
  }
  BvhConfig config;
  config.width = GetParam();
  const Bvh tree = Bvh::widen(chain, mesh.view(), config);
  const Bvh usual = Bvh::build(mesh.view());
  for (uint32_t i = 0; i < 50; ++i) {
    const Vec3& p = mesh.positions[i];
    const Ray ray{{p.x, p.y, p.z - 1}, 0, {0.1f, 0.2f, 1}};
    EXPECT_EQ(tree.intersect(ray), usual.intersect(ray));
    EXPECT_EQ(tree.closest_point(ray.origin).distance, usual.closest_point(ray.origin).distance);
    EXPECT_EQ(tree.overlaps(Sphere{p, 0.1f}), usual.overlaps(Sphere{p, 0.1f}));
  }
}

TEST_P(Widen, a_vertex_out_of_range_is_refused) {
  Mesh mesh = shapes::grid(4, 4);
  const bvh::Bvh2 tree = bvh::build(mesh.view());
  mesh.triangles[7][2] = 1000;
  EXPECT_THROW(widen_tree(tree, mesh.view(), {GetParam(), false}, {}), Error);
}

INSTANTIATE_TEST_SUITE_P(Widths, Widen, ::testing::Values(2u, 4u, 8u));

}  // namespace
}  // namespace umbel
