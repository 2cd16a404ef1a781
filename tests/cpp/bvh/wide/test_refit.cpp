#include <gtest/gtest.h>

#include "asset/scratch.hpp"
#include "base/math.hpp"
#include "bvh/every_config.hpp"
#include "bvh/oracle.hpp"
#include "heap_peak.hpp"

namespace umbel {
namespace {

using namespace testing;

Mesh twisted(Mesh mesh, float turns) {
  for (Vec3& p : mesh.positions) {
    const float angle = p.z * turns * 6.2831853f;
    p = {p.x * std::cos(angle) - p.y * std::sin(angle),
         p.x * std::sin(angle) + p.y * std::cos(angle), p.z};
  }
  return mesh;
}

TEST(BvhRefit, queries_see_the_moved_mesh_with_every_builder_and_width) {
  const Mesh mesh = shapes::blob(2, 1), moved = twisted(shapes::blob(2, 2), 0.5f);
  const std::vector<Ray> rays = adversarial_rays(moved.view(), 140, 1);
  std::vector<Truth> truths;
  for (const Ray& ray : rays) truths.push_back(trace_all(moved.view(), ray));
  const Bvh fresh = Bvh::build(moved.view());
  for (const BvhConfig& config : every_config()) {
    Bvh tree = Bvh::build(mesh.view(), config);
    const RefitReport report = tree.refit(moved.view());
    EXPECT_GT(report.sah_cost, 0);
    EXPECT_EQ(report.sah_cost, tree.statistics().sah_cost);
    EXPECT_EQ(tree.bounds(), bounds(moved.view()));
    for (size_t i = 0; i < rays.size(); ++i) {
      const Hit hit = tree.intersect(rays[i]);
      ASSERT_TRUE(is_right(moved.view(), rays[i], truths[i], hit))
          << bvh::name(config.tree.builder);
      const ClosestPoint a = tree.closest_point(rays[i].origin);
      const ClosestPoint b = fresh.closest_point(rays[i].origin);
      ASSERT_EQ(a.primitive, b.primitive);
      ASSERT_EQ(a.distance, b.distance);
      ASSERT_EQ(tree.contains(rays[i].origin), fresh.contains(rays[i].origin));
    }
  }
}

TEST(BvhRefit, the_same_positions_keep_the_cost_and_the_bytes) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(3, 3), other = twisted(mesh, 1);
  for (const bool compact : {false, true}) {
    BvhConfig config;
    config.compact = compact;
    Bvh tree = Bvh::build(mesh.view(), config);
    tree.save((scratch / "before").string());
    const RefitReport same = tree.refit(mesh.view());
    EXPECT_DOUBLE_EQ(same.sah_cost, same.built_sah_cost);
    EXPECT_FALSE(same.rebuild_advised);
    const RefitReport away = tree.refit(other.view());
    EXPECT_GT(away.sah_cost, 1.05 * away.built_sah_cost);
    const RefitReport back = tree.refit(mesh.view());
    EXPECT_NEAR(back.sah_cost, back.built_sah_cost, 1e-9 * back.built_sah_cost);
    // All but the costs, which were rounded on the way, is as it was.
    tree.save((scratch / "after").string());
    const std::vector<char> a = read_bytes(scratch / "before"), b = read_bytes(scratch / "after");
    ASSERT_EQ(a.size(), b.size());
    EXPECT_TRUE(std::equal(a.begin() + 192, a.end(), b.begin() + 192));
  }
}

TEST(BvhRefit, a_rebuild_is_advised_once_the_tree_has_lost_half_its_quality) {
  const Mesh mesh = shapes::blob(4, 4);
  Bvh tree = Bvh::build(mesh.view());
  bool advised = false;
  for (const float turns : {0.1f, 1.0f, 5.0f, 20.0f}) {
    const RefitReport report = tree.refit(twisted(mesh, turns).view());
    EXPECT_EQ(report.rebuild_advised, report.sah_cost > 1.5 * report.built_sah_cost);
    advised |= report.rebuild_advised;
  }
  EXPECT_TRUE(advised);
}

TEST(BvhRefit, the_cost_is_near_that_of_the_same_binary_tree) {
  // The binary tree itself, refitted here by hand.
  const Mesh mesh = shapes::blob(3, 5), moved = twisted(mesh, 1);
  bvh::Bvh2 tree = bvh::build(mesh.view());
  Bvh wide = Bvh::widen(tree, mesh.view());
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    bvh::Node& node = tree.nodes[i];
    Aabb box;
    for (uint32_t k = 0; k < node.count; ++k)
      for (const uint32_t vertex : mesh.triangles[tree.primitives[node.first + k]])
        extend(box, moved.positions[vertex]);
    if (!node.is_leaf()) {
      extend(box, tree.nodes[node.first].box());
      extend(box, tree.nodes[node.first + 1].box());
    }
    node.min = box.min, node.max = box.max;
  }
  const double exact = bvh::sah_cost(tree), told = wide.refit(moved.view()).sah_cost;
  EXPECT_NEAR(told, exact, 0.25 * exact);
}

TEST(BvhRefit, any_number_of_threads_gives_the_same_bytes) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(5, 6), moved = twisted(mesh, 0.3f);
  std::vector<std::vector<char>> files;
  for (const uint32_t threads : {1u, 2u, 7u}) {
    Bvh tree = Bvh::build(mesh.view());
    BuildOptions options;
    options.threads = threads;
    tree.refit(moved.view(), options);
    tree.save((scratch / "t").string());
    files.push_back(read_bytes(scratch / "t"));
  }
  EXPECT_TRUE(files[0] == files[1]);
  EXPECT_TRUE(files[0] == files[2]);
}

TEST(BvhRefit, what_cannot_be_followed_is_refused_and_changes_nothing) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(2, 7);
  Bvh tree = Bvh::build(mesh.view());
  tree.save((scratch / "before").string());
  Mesh fewer = mesh;
  fewer.triangles.pop_back();
  EXPECT_THROW(tree.refit(fewer.view()), Error);
  Mesh nan = mesh;
  nan.positions[3].z = std::nanf("");
  EXPECT_THROW(tree.refit(nan.view()), Error);
  Mesh outside = mesh;
  outside.triangles[7][2] = 1u << 30;
  EXPECT_THROW(tree.refit(outside.view()), Error);
  tree.save((scratch / "after").string());
  EXPECT_TRUE(read_bytes(scratch / "before") == read_bytes(scratch / "after"));
  // A vertex that no triangle uses may be anything.
  Mesh unused = mesh;
  unused.positions.push_back({std::nanf(""), 0, 0});
  EXPECT_NO_THROW(tree.refit(unused.view()));
}

TEST(BvhRefit, changes_nothing_where_there_is_no_memory) {
  if (!FailingAllocation::works()) GTEST_SKIP() << "operator new is another's";
  const Mesh mesh = shapes::blob(4, 1), moved = twisted(shapes::blob(4, 2), 0.5f);
  const std::vector<Ray> rays = adversarial_rays(mesh.view(), 60, 1);
  BvhConfig config;
  config.width = 2;  // several blocks of nodes
  Bvh tree = Bvh::build(mesh.view(), config);
  const Bvh same = Bvh::build(mesh.view(), config);
  BuildOptions one_thread;
  one_thread.threads = 1;
  fail_each_allocation([&] { tree.refit(moved.view(), one_thread); },
                       [&] {
                         EXPECT_EQ(tree.bounds(), same.bounds());
                         for (const Ray& ray : rays)
                           ASSERT_EQ(tree.intersect(ray).t, same.intersect(ray).t);
                       });
  EXPECT_EQ(tree.bounds(), bounds(moved.view()));
}

TEST(BvhRefit, triangles_that_were_dropped_may_stay_invalid) {
  Mesh mesh = shapes::sphere(2);
  mesh.positions[5].x = std::nanf("");
  BvhConfig config;
  config.tree.invalid = bvh::InvalidTriangles::kDrop;
  Bvh tree = Bvh::build(mesh.view(), config);
  EXPECT_NO_THROW(tree.refit(transformed(mesh, 2).view()));
  EXPECT_EQ(tree.bounds().max.x, 2 * bounds(drop_invalid(mesh.view()).mesh.view()).max.x);
}

TEST(BvhRefit, a_mesh_that_collapses_to_a_point_and_returns_is_fine) {
  const Mesh mesh = shapes::blob(2, 8), point = transformed(mesh, 0);
  Bvh tree = Bvh::build(mesh.view());
  EXPECT_TRUE(std::isfinite(tree.refit(point.view()).sah_cost));
  EXPECT_EQ(tree.closest_point(Vec3{0, 0, 2}).distance, 2);
  const RefitReport back = tree.refit(mesh.view());
  EXPECT_NEAR(back.sah_cost, back.built_sah_cost, 1e-9 * back.built_sah_cost);
  EXPECT_TRUE(tree.intersect({{0, 0, 5}, 0, {0, 0, -1}}).hit());
}

}  // namespace
}  // namespace umbel
