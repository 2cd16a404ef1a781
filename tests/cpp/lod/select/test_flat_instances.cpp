// Instances whose transforms flatten their meshes: they have errors, but no camera in their space.
#include <gtest/gtest.h>

#include "lod/select/instances.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/lod.hpp"

namespace umbel::lod {
namespace {

constexpr Transform kFlat{{2, 0, 0, 1, 0, 0, 0, 0, 0, 0, 3, 0}};
constexpr Transform kNothing{{0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3}};

TEST(FlatInstances, have_the_error_of_their_largest_scale) {
  EXPECT_FLOAT_EQ(to_object(view_error(6), kFlat).error, 2);
  EXPECT_EQ(to_object(view_error(0), kFlat).error, 0);
  EXPECT_NEAR(largest_stretch(kFlat), 3, 1e-12);
}

TEST(FlatInstances, that_are_points_need_no_detail) {
  EXPECT_GT(to_object(view_error(1e-6f), kNothing).error, 1e20f);
  EXPECT_EQ(to_object(view_error(0), kNothing).error, 0);
}

TEST(FlatInstances, of_other_transforms_nothing_changes) {
  const Transform turned{{0, -2, 0, 1, 2, 0, 0, 0, 0, 0, 1, 0}};
  EXPECT_EQ(to_object(view_error(6), turned).error, 3);
  EXPECT_EQ(largest_stretch(turned), stretch(turned).most);
}

TEST(FlatInstances, are_no_place_for_a_camera) {
  EXPECT_THROW(to_object(view_camera({0, 0, 9}, 1.0f, 100, 1.0f), kFlat), Error);
  const Transform endless{{std::numeric_limits<float>::infinity()}};
  EXPECT_THROW(to_object(view_error(1), endless), Error);
  EXPECT_THROW(largest_stretch(endless), Error);
}

TEST(FlatInstances, are_refused_by_their_number) {
  const Dag dag = build(shapes::grid(8, 8).view(), testing::small_config());
  const View view = view_camera({0, 0, 9}, 1.0f, 100, 1.0f);
  std::vector<Transform> instances(40);
  instances[7] = instances[31] = kFlat;
  const auto expect_named = [](const auto& call) {
    try {
      call();
      ADD_FAILURE() << "not refused";
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).find("instance 7: a transform must be"), 0u)
          << error.what();
    }
  };
  expect_named([&] { select_instances(dag.tables, view, {}, instances); });
  const std::vector<uint32_t> costs = triangle_costs(dag.tables);
  expect_named([&] { view_for_budget(dag.tables, view, costs, 10, {}, instances); });
  expect_named([&] { select_for_budget(dag.tables, view, costs, 10, {}, instances); });
}

}  // namespace
}  // namespace umbel::lod
