#include <gtest/gtest.h>

#include <bit>
#include <map>
#include <set>

#include "base/parallel.hpp"
#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

using testing::camera;
using testing::Random;

Group group_at(const Vec3& center, float radius, float error) {
  Group group{};
  group.sphere = {center, radius};
  group.error = error;
  return group;
}

const Dag& blob_dag() {
  static const Dag dag = build(shapes::blob(5, 7).view(), testing::small_config());
  return dag;
}

View random_view(Random& random, const Tables& tables, uint32_t i) {
  if (i % 3 == 0) return view_error(static_cast<float>(random.log_between(1e-6, 1)));
  if (i % 3 == 1) return view_level(random.below(8));
  return testing::random_camera(random, tables, {});
}

uint64_t triangles_of(const Tables& tables, const std::vector<uint32_t>& cut) {
  uint64_t triangles = 0;
  for (const uint32_t c : cut) triangles += tables.clusters[c].triangle_count;
  return triangles;
}

TEST(Select, a_group_is_refined_where_its_error_is_strictly_larger) {
  const Group group = group_at({0, 0, 0}, 1, 0.5f);
  EXPECT_FALSE(must_refine(group, view_error(0.5f)));
  EXPECT_TRUE(must_refine(group, view_error(0.49999997f)));
  // Five from the centre, four from the sphere.
  EXPECT_FALSE(must_refine(group, camera({3, 0, 4}, 0.125f)));
  EXPECT_TRUE(must_refine(group, camera({3, 0, 4}, 0.12499999f)));
}

TEST(Select, inside_its_sphere_a_group_is_refined_unless_its_error_is_zero) {
  for (const Vec3& eye : {Vec3{0, 0, 0}, Vec3{0.5f, 0, 0}, Vec3{1, 0, 0}}) {
    EXPECT_TRUE(must_refine(group_at({0, 0, 0}, 1, 1e-30f), camera(eye, 1e30f)));
    EXPECT_FALSE(must_refine(group_at({0, 0, 0}, 1, 0), camera(eye, 0)));
  }
}

TEST(Select, roots_are_always_refined) {
  const float infinity = std::numeric_limits<float>::infinity();
  const Group root = group_at({0, 0, 0}, 1, infinity);
  EXPECT_TRUE(must_refine(root, view_error(std::numeric_limits<float>::max())));
  EXPECT_TRUE(must_refine(root, view_error(infinity)));
  EXPECT_TRUE(must_refine(root, view_level(1000)));
  for (const float threshold : {0.0f, 1.0f, 1e38f, infinity})
    for (const Vec3& eye : {Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{3e38f, -3e38f, 3e38f}})
      EXPECT_TRUE(must_refine(root, camera(eye, threshold)));
}

TEST(Select, a_level_is_refined_from_that_level_up) {
  Group group = group_at({0, 0, 0}, 1, 0.5f);
  group.level = 3;
  EXPECT_TRUE(must_refine(group, view_level(3)));
  EXPECT_TRUE(must_refine(group, view_level(2)));
  EXPECT_FALSE(must_refine(group, view_level(4)));
}

TEST(Select, cuts_are_ascending_and_as_defined) {
  const Tables& tables = blob_dag().tables;
  Random random(1);
  for (uint32_t i = 0; i < 300; ++i) {
    const View view = random_view(random, tables, i);
    std::vector<uint32_t> expected;
    for (uint32_t c = 0; c < tables.clusters.size(); ++c) {
      const Cluster& cluster = tables.clusters[c];
      const bool coarse_enough = cluster.generating_group == kNone ||
                                 !must_refine(tables.groups[cluster.generating_group], view);
      if (must_refine(tables.groups[cluster.group], view) && coarse_enough) expected.push_back(c);
    }
    EXPECT_EQ(select(tables, view), expected);
  }
}

TEST(Select, threads_do_not_matter) {
  const Tables tables = testing::random_tables(3, 60000, {});
  Random random(9);
  for (int i = 0; i < 5; ++i) {
    const View view = testing::random_camera(random, tables, {});
    std::vector<uint32_t> one, many;
    with_threads(1, [&] { one = select(tables, view); });
    with_threads(8, [&] { many = select(tables, view); });
    EXPECT_EQ(one, many);
  }
}

// A generating group must never be refined without the groups of what it generated, or the cut
// has both. Eyes stand on the line through both centres, where the spheres leave least room, and
// thresholds are the last at which the coarser group need not be refined.
TEST(Select, no_group_is_refined_below_one_that_is_not) {
  const Tables& tables = blob_dag().tables;
  Random random(3);
  size_t tight = 0;
  for (const Cluster& cluster : tables.clusters) {
    if (cluster.generating_group == kNone) continue;
    const Group& fine = tables.groups[cluster.generating_group];
    const Group& coarse = tables.groups[cluster.group];
    if (std::isinf(coarse.error)) continue;
    const Vec3 &c = fine.sphere.center, &o = coarse.sphere.center;
    const double x = double{c.x} - o.x, y = double{c.y} - o.y, z = double{c.z} - o.z;
    const double length = std::sqrt(x * x + y * y + z * z);
    if (length == 0) continue;
    for (int i = 0; i < 100; ++i) {
      const double far = coarse.sphere.radius * (1 + random.log_between(1e-7, 1e6)) / length;
      View view = camera({static_cast<float>(o.x + far * x), static_cast<float>(o.y + far * y),
                          static_cast<float>(o.z + far * z)},
                         1e30f);
      // The smallest threshold at which the coarse group need not be refined, by bisection of the
      // bits of positive floats, which are in order.
      uint32_t low = 0, high = std::bit_cast<uint32_t>(view.threshold);
      while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        view.threshold = std::bit_cast<float>(middle);
        (must_refine(coarse, view) ? low : high) = middle;
      }
      view.threshold = std::bit_cast<float>(high);
      if (must_refine(coarse, view)) continue;  // the eye is inside, and always refines
      ++tight;
      ASSERT_FALSE(must_refine(fine, view)) << "group " << cluster.group << " from "
                                            << cluster.generating_group << ", distance " << far;
    }
  }
  EXPECT_GT(tight, 10000u);
}

TEST(Select, cut_of_closed_mesh_is_closed) {
  const Dag& dag = blob_dag();
  Random random(2);
  std::set<size_t> sizes;
  for (uint32_t i = 0; i < 60; ++i) {
    const std::vector<uint32_t> cut = select(dag.tables, random_view(random, dag.tables, i));
    sizes.insert(cut.size());
    const Mesh mesh = mesh_of_cut(dag.tables, testing::reader_of(dag), cut);
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    const std::vector<uint32_t> ids = position_ids(mesh.positions);
    for (const Triangle& t : mesh.triangles)
      for (int k = 0; k < 3; ++k) {
        const uint32_t a = ids[t[k]], b = ids[t[(k + 1) % 3]];
        ++edges[std::minmax(a, b)];
      }
    for (const auto& [edge, triangles] : edges) ASSERT_EQ(triangles, 2);
  }
  EXPECT_GT(sizes.size(), 10u);
}

TEST(Select, level_zero_is_the_source) {
  const Mesh mesh = shapes::blob(5, 7);
  const Dag& dag = blob_dag();
  const Mesh cut =
      mesh_of_cut(dag.tables, testing::reader_of(dag), select(dag.tables, view_level(0)));
  EXPECT_EQ(cut.triangles.size(), mesh.triangles.size());
  EXPECT_EQ(triangle_set_digest(cut.view()), triangle_set_digest(mesh.view()));
}

TEST(Select, empty_tables_give_empty_cuts) {
  const Tables tables;
  EXPECT_TRUE(select(tables, view_error(0)).empty());
  EXPECT_TRUE(select_hierarchy(tables, view_error(0)).empty());
  EXPECT_EQ(error_for_triangles(tables, 0), 0.0f);
  EXPECT_EQ(cut_error(tables, {}), 0.0f);
}

TEST(Select, error_for_triangles_is_the_smallest_that_fits) {
  for (const Tables& tables : {blob_dag().tables, testing::random_tables(8, 60, {})}) {
    std::set<float> candidates{0.0f};
    for (const Group& group : tables.groups)
      if (std::isfinite(group.error)) candidates.insert(group.error);
    std::map<float, uint64_t> triangles;
    for (const float error : candidates)
      triangles[error] = triangles_of(tables, select(tables, view_error(error)));
    for (const uint64_t most :
         {0ull, 1ull, 32ull, 100ull, 500ull, 1000ull, 3000ull, 5000ull, 20480ull, 1000000ull}) {
      float expected = *candidates.rbegin();
      for (const auto& [error, count] : triangles)
        if (count <= most) {
          expected = error;
          break;
        }
      EXPECT_EQ(error_for_triangles(tables, most), expected) << most;
    }
  }
}

TEST(Select, cut_error_is_that_of_the_coarsest_generating_group) {
  const Tables& tables = blob_dag().tables;
  EXPECT_EQ(cut_error(tables, select(tables, view_level(0))), 0.0f);
  for (const float error : {1e-5f, 1e-4f, 1e-3f, 1e-2f, 1e-1f}) {
    const std::vector<uint32_t> cut = select(tables, view_error(error));
    float expected = 0;
    for (const uint32_t c : cut)
      if (tables.clusters[c].generating_group != kNone)
        expected = std::max(expected, tables.groups[tables.clusters[c].generating_group].error);
    EXPECT_EQ(cut_error(tables, cut), expected);
    EXPECT_LE(cut_error(tables, cut), error);
  }
  const std::vector<uint32_t> outside{static_cast<uint32_t>(tables.clusters.size())};
  EXPECT_THROW(cut_error(tables, outside), Error);
}

TEST(Select, a_camera_refines_what_covers_more_pixels_than_asked) {
  // At distance 1, a picture 1000 pixels high spans 2 tan(45 degrees) = 2: 500 pixels a unit.
  const View view = view_camera({0, 0, 0}, 1.57079633f, 1000, 1);
  EXPECT_TRUE(must_refine(group_at({2, 0, 0}, 1, 0.00201f), view));
  EXPECT_FALSE(must_refine(group_at({2, 0, 0}, 1, 0.00199f), view));
  EXPECT_TRUE(must_refine(group_at({0, 11, 0}, 1, 0.0201f), view));
  EXPECT_FALSE(must_refine(group_at({0, 11, 0}, 1, 0.0199f), view));
}

TEST(Select, impossible_views_are_rejected) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_THROW(view_error(-1), Error);
  EXPECT_THROW(view_error(nan), Error);
  EXPECT_THROW(view_camera({nan, 0, 0}, 1, 100, 1), Error);
  EXPECT_THROW(view_camera({0, infinity, 0}, 1, 100, 1), Error);
  EXPECT_THROW(view_camera({0, 0, 0}, 0, 100, 1), Error);
  EXPECT_THROW(view_camera({0, 0, 0}, 3.2f, 100, 1), Error);
  EXPECT_THROW(view_camera({0, 0, 0}, nan, 100, 1), Error);
  EXPECT_THROW(view_camera({0, 0, 0}, 1, 0, 1), Error);
  EXPECT_THROW(view_camera({0, 0, 0}, 1, 100, -1), Error);
  EXPECT_THROW(view_camera({0, 0, 0}, 1, 100, infinity), Error);
  EXPECT_THROW(select({}, camera({nan, 0, 0}, 1)), Error);
  EXPECT_THROW(select_hierarchy({}, camera({0, 0, 0}, -1)), Error);
}

}  // namespace
}  // namespace umbel::lod
