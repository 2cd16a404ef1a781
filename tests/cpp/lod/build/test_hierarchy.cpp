#include <gtest/gtest.h>

#include "lod/build/hierarchy.hpp"
#include "lod/select/refine.hpp"
#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

using testing::Extent;
using testing::Random;

/// From the smallest subnormal floats to the largest, at the origin and far from it.
std::vector<Extent> extents() {
  return {{1, {0, 0, 0}},         {1, {1e3f, -2e3f, 5e2f}},     {0.25, {6.4e6f, 1e5f, -3e6f}},
          {1e15, {0, 0, 0}},      {1e15, {1e17f, 0, -1e16f}},   {1e-15, {0, 0, 0}},
          {1e-15, {1e-9f, 0, 0}}, {1e-20, {0, 0, 0}},           {1e-30, {0, 0, 0}},
          {1e-38, {0, 0, 0}},     {1e-43, {0, 0, 0}},           {1e30, {0, 0, 0}},
          {1e37, {-3e37f, 0, 0}}, {1e-3, {7e37f, 7e37f, 7e37f}}};
}

TEST(Hierarchy, every_group_is_one_leaf_below_the_root) {
  for (const uint32_t groups : {1u, 2u, 7u, 8u, 9u, 63u, 64u, 65u, 500u, 4097u}) {
    const Tables tables = testing::random_tables(groups, groups, {});
    std::vector<uint32_t> leaves(tables.groups.size(), 0);
    std::vector<uint32_t> parents(tables.nodes.size(), 0);
    for (const Node& node : tables.nodes) {
      if (node.group != kNone) {
        ++leaves[node.group];
        EXPECT_EQ(node.children.count, 0u);
        EXPECT_EQ(node.sphere, tables.groups[node.group].sphere);
        EXPECT_EQ(node.error, tables.groups[node.group].error);
      } else {
        EXPECT_GE(node.children.count, 2u);
        EXPECT_LE(node.children.count, 8u);
      }
      for (uint32_t i = 0; i < node.children.count; ++i) {
        EXPECT_GT(node.children.offset + i, static_cast<uint32_t>(&node - tables.nodes.data()));
        ++parents[node.children.offset + i];
      }
    }
    EXPECT_EQ(std::count(leaves.begin(), leaves.end(), 1u), std::ssize(leaves));
    EXPECT_EQ(parents[0], 0u);
    EXPECT_EQ(std::count(parents.begin() + 1, parents.end(), 1u), std::ssize(parents) - 1);
  }
}

TEST(Hierarchy, no_groups_make_no_nodes) { EXPECT_TRUE(build_hierarchy(Tables{}).empty()); }

TEST(Hierarchy, a_single_group_is_its_own_root) {
  Tables tables;
  tables.levels = {{0, 1}};
  tables.groups.resize(1);
  tables.groups[0].error = std::numeric_limits<float>::infinity();
  const std::vector<Node> nodes = build_hierarchy(tables);
  ASSERT_EQ(nodes.size(), 1u);
  EXPECT_EQ(nodes[0].group, 0u);
}

TEST(Hierarchy, spheres_and_errors_contain_those_below) {
  for (const Extent& extent : extents()) {
    const Tables tables = testing::random_tables(5, 300, extent);
    for (const Node& node : tables.nodes)
      for (uint32_t i = 0; i < node.children.count; ++i) {
        const Node& child = tables.nodes[node.children.offset + i];
        EXPECT_GE(node.error, child.error);
        if (std::isinf(node.error)) continue;
        const double x = double{node.sphere.center.x} - child.sphere.center.x;
        const double y = double{node.sphere.center.y} - child.sphere.center.y;
        const double z = double{node.sphere.center.z} - child.sphere.center.z;
        EXPECT_GE(double{node.sphere.radius},
                  std::sqrt(x * x + y * y + z * z) + double{child.sphere.radius});
      }
  }
}

TEST(Hierarchy, a_node_that_need_not_be_refined_has_no_child_that_must_be) {
  Random random(1);
  for (const Extent& extent : extents()) {
    const Tables tables = testing::random_tables(11, 200, extent);
    size_t decided = 0;
    for (int i = 0; i < 3000; ++i) {
      const View view = testing::random_camera(random, tables, extent);
      for (const Node& node : tables.nodes) {
        if (must_refine(node.sphere, node.error, view)) continue;
        ++decided;
        for (uint32_t k = 0; k < node.children.count; ++k) {
          const Node& child = tables.nodes[node.children.offset + k];
          ASSERT_FALSE(must_refine(child.sphere, child.error, view))
              << "scale " << extent.scale << ", eye " << view.eye.x << " " << view.eye.y << " "
              << view.eye.z << ", threshold " << view.threshold;
        }
      }
    }
    EXPECT_GT(decided, 0u) << extent.scale;
  }
}

// Where the margins of enclosing_node are needed most: one child gives the node both its error
// and its reach, the eye stands on the line through both centres, from just outside the sphere to
// very far, and the threshold is the last one at which the node need not be refined.
TEST(Hierarchy, a_node_hides_nothing_even_where_it_is_tight) {
  Random random(6);
  for (const Extent& extent : extents()) {
    for (int i = 0; i < 20000; ++i) {
      Node children[2] = {};
      for (Node& child : children) child.sphere = testing::random_sphere(random, extent);
      children[0].error = static_cast<float>(random.log_between(1e-3, 1) * extent.scale);
      const Node node = enclosing_node(children, 2);
      const Vec3 &c = children[0].sphere.center, &o = node.sphere.center;
      double x = double{c.x} - o.x, y = double{c.y} - o.y, z = double{c.z} - o.z;
      const double length = std::sqrt(x * x + y * y + z * z);
      if (length == 0) continue;
      const double far = double{node.sphere.radius} * (1 + random.log_between(1e-7, 1e6)) / length;
      const Vec3 eye{static_cast<float>(o.x + far * x), static_cast<float>(o.y + far * y),
                     static_cast<float>(o.z + far * z)};
      if (!std::isfinite(eye.x) || !std::isfinite(eye.y) || !std::isfinite(eye.z)) continue;
      const float distance = distance_outside(node.sphere, eye);
      if (distance == 0) continue;
      View view = testing::camera(eye, std::nextafter(node.error / distance, 0.0f));
      if (!std::isfinite(view.threshold)) continue;
      for (int k = 0; k < 3 && must_refine(node.sphere, node.error, view); ++k)
        view.threshold = std::nextafter(view.threshold, std::numeric_limits<float>::max());
      if (must_refine(node.sphere, node.error, view)) continue;
      ASSERT_FALSE(must_refine(children[0].sphere, children[0].error, view))
          << "scale " << extent.scale << ", distance " << far;
    }
  }
}

TEST(Hierarchy, cuts_equal_those_of_flat_selection) {
  Random random(2);
  for (const Extent& extent : extents()) {
    const Tables tables = testing::random_tables(17, 90, extent);
    size_t sizes = 0;
    for (int i = 0; i < 4000; ++i) {
      const View view = testing::random_camera(random, tables, extent);
      const std::vector<uint32_t> cut = select(tables, view);
      ASSERT_EQ(cut, select_hierarchy(tables, view))
          << "scale " << extent.scale << ", eye " << view.eye.x << " " << view.eye.y << " "
          << view.eye.z << ", threshold " << view.threshold;
      sizes += cut.size();
    }
    EXPECT_GT(sizes, 0u);
  }
}

TEST(Hierarchy, cuts_by_error_and_level_equal_those_of_flat_selection) {
  Random random(3);
  for (const Extent& extent : extents()) {
    const Tables tables = testing::random_tables(23, 200, extent);
    for (const Group& group : tables.groups) {
      ASSERT_EQ(select(tables, view_error(group.error)),
                select_hierarchy(tables, view_error(group.error)));
      const float below = std::max(0.0f, std::nextafter(group.error, 0.0f));
      ASSERT_EQ(select(tables, view_error(below)), select_hierarchy(tables, view_error(below)));
    }
    for (uint32_t level = 0; level < 5; ++level)
      ASSERT_EQ(select(tables, view_level(level)), select_hierarchy(tables, view_level(level)));
  }
}

TEST(Hierarchy, cuts_of_real_dags_equal_those_of_flat_selection) {
  Random random(4);
  for (const Mesh& mesh : {shapes::blob(5, 2), shapes::terrain(90, 90, 3)}) {
    const Dag dag = build(mesh.view(), testing::small_config());
    for (int i = 0; i < 5000; ++i) {
      const View view = testing::random_camera(random, dag.tables, {});
      ASSERT_EQ(select(dag.tables, view), select_hierarchy(dag.tables, view));
    }
  }
}

TEST(Hierarchy, lengths_are_those_of_double_precision_at_every_scale) {
  Random random(5);
  for (int i = 0; i < 200000; ++i) {
    const double scale = random.log_between(1e-37, 1e37);
    const Vec3 p = random.point();
    const float x = static_cast<float>(p.x * scale), y = static_cast<float>(p.y * scale);
    const float z = static_cast<float>(p.z * scale * random.log_between(1e-9, 1));
    const double exact = std::sqrt(double{x} * x + double{y} * y + double{z} * z);
    ASSERT_NEAR(vector_length(x, y, z) / exact, 1.0, 0x1p-22) << scale;
  }
}

}  // namespace
}  // namespace umbel::lod
