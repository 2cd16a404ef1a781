#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "asset/forest.hpp"
#include "umbel/umbel.h"

namespace umbel {
namespace {

using testing::forest_asset;
using testing::Scratch;

struct OpenedForest {
  OpenedForest() {
    const std::string path = forest_asset(scratch, 5000).string();
    EXPECT_EQ(umbel_asset_open(path.c_str(), &asset), UMBEL_OK) << umbel_last_error();
    EXPECT_EQ(umbel_instance_selector_create(asset, 1 << 20, &selector), UMBEL_OK)
        << umbel_last_error();
  }
  ~OpenedForest() {
    umbel_instance_selector_free(selector);
    umbel_asset_free(asset);
  }
  OpenedForest(const OpenedForest&) = delete;
  OpenedForest& operator=(const OpenedForest&) = delete;

  std::vector<umbel_instance> listed() const {
    size_t count = 0;
    EXPECT_EQ(umbel_asset_get_instances(asset, nullptr, 0, &count), UMBEL_OK);
    std::vector<umbel_instance> all(count);
    EXPECT_EQ(umbel_asset_get_instances(asset, all.data(), count, &count), UMBEL_OK);
    return all;
  }
  umbel_instance_step settle(const umbel_lod_view& view) const {
    umbel_instance_step step;
    umbel_instance_step_init(&step);
    EXPECT_EQ(umbel_instance_selector_settle(selector, &view, nullptr, 0, &step), UMBEL_OK)
        << umbel_last_error();
    return step;
  }
  std::vector<umbel_instance_run> runs() const {
    size_t count = 0;
    EXPECT_EQ(umbel_instance_selector_runs(selector, nullptr, 0, &count), UMBEL_OK);
    std::vector<umbel_instance_run> all(count);
    EXPECT_EQ(umbel_instance_selector_runs(selector, all.data(), count, &count), UMBEL_OK);
    return all;
  }
  std::vector<umbel_instance> placements(const umbel_instance_run& run) const {
    std::vector<umbel_instance> all(run.placements.count);
    size_t count = 0;
    EXPECT_EQ(umbel_instance_selector_placements(selector, &run, all.data(), all.size(), &count),
              UMBEL_OK)
        << umbel_last_error();
    EXPECT_EQ(count, all.size());
    return all;
  }

  Scratch scratch;
  umbel_asset* asset = nullptr;
  umbel_instance_selector* selector = nullptr;
};

umbel_lod_view view_error(float error) {
  umbel_lod_view view{};
  EXPECT_EQ(umbel_lod_view_error(error, &view), UMBEL_OK);
  return view;
}

TEST(CInstanceTree, says_what_the_cpp_interface_says) {
  const OpenedForest c;
  const Asset asset(c.scratch / "forest.umbel");
  ASSERT_EQ(umbel_asset_has_instance_tree(c.asset), 1);
  EXPECT_EQ(umbel_instance_selector_instances(c.selector), 5000u);
  const std::vector<umbel_instance> listed = c.listed();
  ASSERT_EQ(listed.size(), asset.instances().size());
  EXPECT_EQ(std::memcmp(listed.data(), asset.instances().data(), listed.size() * sizeof listed[0]),
            0);
  InstanceSelector selector(asset);
  const Vec3 eye{100, 2, 100};
  umbel_lod_view camera{};
  ASSERT_EQ(umbel_lod_view_camera(&eye.x, 1, 1080, 1, &camera), UMBEL_OK);
  const umbel_instance_step said = c.settle(camera);
  const InstanceStep step = selector.settle(lod::view_camera(eye, 1, 1080, 1));
  EXPECT_EQ(said.shown, step.shown);
  EXPECT_EQ(said.refined, step.refined);
  EXPECT_EQ(said.stand_ins, step.stand_ins);
  EXPECT_EQ(said.missing_count, 0u);
  const std::vector<umbel_instance_run> runs = c.runs();
  ASSERT_EQ(runs.size(), step.runs.size());
  EXPECT_EQ(runs.size(), said.run_count);
  EXPECT_GT(said.refined, 0u);
  for (size_t i = 0; i < runs.size(); ++i) {
    EXPECT_EQ(runs[i].node, step.runs[i].node);
    EXPECT_EQ(runs[i].is_coarsest != 0, step.runs[i].is_coarsest);
    const std::vector<umbel_instance> some = c.placements(runs[i]);
    const auto known = selector.placements(step.runs[i]);
    ASSERT_EQ(some.size(), known.size());
    EXPECT_EQ(std::memcmp(some.data(), known.data(), known.size_bytes()), 0);
  }
}

TEST(CInstanceTree, step_reads_nothing_and_load_reads_what_is_missing) {
  const OpenedForest c;
  const umbel_lod_view view = view_error(0);
  umbel_instance_step step;
  umbel_instance_step_init(&step);
  size_t rounds = 0;
  for (;; ++rounds) {
    ASSERT_EQ(umbel_instance_selector_step(c.selector, &view, nullptr, 0, &step), UMBEL_OK);
    if (step.missing_count == 0) break;
    std::vector<uint32_t> nodes(step.missing_count);
    size_t count = 0;
    ASSERT_EQ(umbel_instance_selector_missing(c.selector, nodes.data(), nodes.size(), &count),
              UMBEL_OK);
    ASSERT_EQ(count, nodes.size());
    if (rounds == 0) {
      EXPECT_EQ(step.stand_ins, step.shown);
      EXPECT_EQ(step.shown, c.listed().size());
    }
    ASSERT_EQ(umbel_instance_selector_load(c.selector, nodes.data(), count), UMBEL_OK);
  }
  EXPECT_GT(rounds, 1u);
  EXPECT_EQ(step.shown, 5000u);
  EXPECT_EQ(step.stand_ins, 0u);
}

TEST(CInstanceTree, no_limit_keeps_what_was_read) {
  const OpenedForest c;
  const umbel_lod_view near = view_error(0), far = view_error(1e30f);
  for (const size_t max_bytes : {size_t{UMBEL_NO_LIMIT}, size_t{UMBEL_NONE}, SIZE_MAX, size_t{1}}) {
    umbel_instance_selector* selector = nullptr;
    ASSERT_EQ(umbel_instance_selector_create(c.asset, max_bytes, &selector), UMBEL_OK);
    umbel_instance_step step;
    umbel_instance_step_init(&step);
    EXPECT_EQ(umbel_instance_selector_settle(selector, &near, nullptr, 0, &step), UMBEL_OK);
    EXPECT_EQ(umbel_instance_selector_step(selector, &far, nullptr, 0, &step), UMBEL_OK);
    EXPECT_EQ(umbel_instance_selector_step(selector, &near, nullptr, 0, &step), UMBEL_OK);
    EXPECT_EQ(step.missing_count > 0, max_bytes == 1) << max_bytes;
    umbel_instance_selector_free(selector);
  }
}

TEST(CInstanceTree, views_and_planes_are_those_of_the_cpp_interface) {
  const Transform transform{{0, 0, 2, 5, 0, 2, 0, -1, -2, 0, 0, 3}};
  umbel_transform given;
  std::memcpy(&given, &transform, sizeof given);
  const Vec3 eye{1, 2, 3};
  umbel_lod_view view{}, made{};
  ASSERT_EQ(umbel_lod_view_camera(&eye.x, 1, 1080, 2, &view), UMBEL_OK);
  ASSERT_EQ(umbel_lod_view_in_instance(&view, &given, &made), UMBEL_OK);
  const lod::View known = lod::to_object(lod::view_camera(eye, 1, 1080, 2), transform);
  EXPECT_EQ((Vec3{made.eye.x, made.eye.y, made.eye.z}), known.eye);
  EXPECT_EQ(made.threshold, known.threshold);
  const umbel_plane plane{{0, 1, 0}, 4};
  umbel_plane moved{};
  ASSERT_EQ(umbel_lod_plane_in_instance(&plane, &given, &moved), UMBEL_OK);
  const Plane same = lod::to_object(Plane{{0, 1, 0}, 4}, transform);
  EXPECT_EQ((Vec3{moved.normal.x, moved.normal.y, moved.normal.z}), same.normal);
  EXPECT_EQ(moved.offset, same.offset);
}

TEST(CInstanceTree, transforms_that_are_not_finite_are_named) {
  umbel_transform moved{{1, 0, 0, NAN, 0, 1, 0, 0, 0, 0, 1, 0}};
  const umbel_lod_view view = view_error(1);
  umbel_lod_view made{};
  EXPECT_EQ(umbel_lod_view_in_instance(&view, &moved, &made), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(umbel_last_error(), "transform has a NaN or infinite value");
  moved.rows[3] = INFINITY;
  const umbel_plane plane{{0, 1, 0}, 4};
  umbel_plane out{};
  EXPECT_EQ(umbel_lod_plane_in_instance(&plane, &moved, &out), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(umbel_last_error(), "transform has a NaN or infinite value");
}

TEST(CInstanceTree, mistakes_get_a_sentence) {
  const OpenedForest c;
  size_t count = 0;
  const auto listed = c.listed().size();
  std::vector<umbel_instance> room(listed);
  EXPECT_EQ(umbel_asset_get_instances(c.asset, room.data(), listed - 1, &count),
            UMBEL_ERROR_CAPACITY);
  EXPECT_EQ(count, listed);
  const uint32_t nowhere = 1u << 30;
  EXPECT_EQ(umbel_instance_selector_load(c.selector, &nowhere, 1), UMBEL_ERROR_INVALID_ARGUMENT);
  const umbel_instance_run run{nowhere, {0, 1}, 0};
  EXPECT_EQ(umbel_instance_selector_placements(c.selector, &run, nullptr, 0, &count),
            UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_instance_step step{};
  const umbel_lod_view view = view_error(1);
  EXPECT_EQ(umbel_instance_selector_step(c.selector, &view, nullptr, 0, &step),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(umbel_last_error()).find("init function"), std::string::npos);
  umbel_instance_step_init(&step);
  EXPECT_EQ(umbel_instance_selector_step(nullptr, &view, nullptr, 0, &step),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_instance_selector_step(c.selector, nullptr, nullptr, 0, &step),
            UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_lod_view level{};
  ASSERT_EQ(umbel_lod_view_level(0, &level), UMBEL_OK);
  EXPECT_EQ(umbel_instance_selector_step(c.selector, &level, nullptr, 0, &step),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_asset_has_instance_tree(nullptr), 0);
  EXPECT_EQ(umbel_instance_selector_instances(nullptr), 0u);
  umbel_instance_selector_free(nullptr);
}

TEST(CInstanceTree, an_asset_without_one_is_refused) {
  const Scratch scratch;
  write_asset(scratch / "a.umbel", lod::build(shapes::sphere(2).view()));
  umbel_asset* asset = nullptr;
  ASSERT_EQ(umbel_asset_open((scratch / "a.umbel").string().c_str(), &asset), UMBEL_OK);
  EXPECT_EQ(umbel_asset_has_instance_tree(asset), 0);
  size_t count = 1;
  EXPECT_EQ(umbel_asset_get_instances(asset, nullptr, 0, &count), UMBEL_OK);
  EXPECT_EQ(count, 0u);
  umbel_instance_selector* selector = nullptr;
  EXPECT_EQ(umbel_instance_selector_create(asset, 0, &selector), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(selector, nullptr);
  EXPECT_STREQ(umbel_last_error(), "the asset has no tree of instances: it lists them");
  umbel_asset_free(asset);
}

}  // namespace
}  // namespace umbel
