// Steps that select from a tree of instances.
#include <gtest/gtest.h>

#include <map>

#include "asset/forest.hpp"
#include "lod/select/cull.hpp"

namespace umbel {
namespace {

using testing::forest_asset;
using testing::Scratch;

constexpr uint32_t kTrees = 20000;

lod::View camera(const Vec3& eye, float pixels = 1) {
  return lod::view_camera(eye, 1.0f, 1080, pixels);
}

TEST(InstanceSelector, shows_every_instance_where_the_view_wants_no_error) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, kTrees));
  InstanceSelector selector(asset);
  const InstanceStep step = selector.settle(lod::view_error(0));
  EXPECT_EQ(step.shown, kTrees);
  EXPECT_EQ(step.stand_ins, 0u);
  EXPECT_EQ(step.refined, kTrees);
  uint64_t placements = 0;
  for (const InstanceRun& run : step.runs) placements += selector.placements(run).size();
  EXPECT_EQ(placements, step.shown);
}

TEST(InstanceSelector, shows_the_top_from_afar_without_reading) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, kTrees));
  InstanceSelector selector(asset);
  const InstanceStep step = selector.step(camera({0, 1e7f, 0}));
  EXPECT_TRUE(step.missing.empty());
  EXPECT_EQ(selector.bytes(), 0u);
  ASSERT_EQ(step.runs.size(), 1u);
  EXPECT_EQ(step.runs[0].node, kNone);
  EXPECT_TRUE(step.runs[0].is_coarsest);
  EXPECT_EQ(selector.placements(step.runs[0]).size(), asset.instances().size());
}

/// Each leaf is shown by itself or by one of those above it, once.
TEST(InstanceSelector, covers_all_once_whatever_is_loaded) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, kTrees));
  const auto& nodes = asset.instance_nodes();
  InstanceSelector selector(asset);
  const lod::View view = camera({100, 20, 100}, 0.5f);
  for (InstanceStep step = selector.step(view);; step = selector.step(view)) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> owners;  // who stands in these placements
    for (uint32_t n = 0; n < nodes.size(); ++n)
      for (uint32_t k = 0; k < nodes[n].children.count; ++k) {
        const uint32_t child = nodes[n].children.offset + k;
        owners[{n, nodes[child].stand_ins.offset}] = child;
      }
    uint64_t covered = 0;
    for (const InstanceRun& run : step.runs) {
      if (run.node == kNone)
        covered += nodes[0].instances;
      else if (nodes[run.node].children.count == 0)
        covered += run.placements.count;
      else
        covered += nodes[owners.at({run.node, run.placements.offset})].instances;
    }
    EXPECT_EQ(covered, kTrees);
    if (step.missing.empty()) break;
    selector.load(step.missing, 3);
  }
}

TEST(InstanceSelector, leaves_out_what_is_outside_and_nothing_else) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, kTrees));
  const Camera at{{100, 5, -50}, {200, 0, 200}, {0, 1, 0}, 0.4f};
  const auto planes = lod::frustum_planes(at, 1.5f);
  const lod::View view = camera(at.position, 0.01f);
  const auto visible = [&](std::span<const Plane> within) {
    InstanceSelector selector(asset);
    const InstanceStep step = selector.settle(view, within);
    std::map<std::array<float, 12>, bool> shown;
    for (const InstanceRun& run : step.runs)
      for (const Instance& instance : selector.placements(run)) {
        const auto& t = instance.transform.rows;
        // The spheres that are tested are larger than this.
        if (lod::is_outside(Sphere{{t[3], t[7], t[11]}, 1.2f}, planes)) continue;
        shown[t] = run.is_coarsest;
      }
    return shown;
  };
  const auto all = visible({}), culled = visible(planes);
  EXPECT_EQ(all.size(), culled.size());
  EXPECT_TRUE(all == culled);
  EXPECT_GT(culled.size(), 100u);
  InstanceSelector selector(asset);
  EXPECT_LT(selector.settle(view, planes).shown, kTrees / 2);
}

TEST(InstanceSelector, coarsest_clusters_are_fine_enough_where_it_says_so) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, kTrees));
  InstanceSelector selector(asset);
  const lod::View view = camera({300, 10, 300});
  const InstanceStep step = selector.settle(view);
  EXPECT_GT(step.refined, 0u);
  EXPECT_LT(step.refined, step.shown);
  std::vector<uint64_t> coarsest;
  for (uint32_t m = 0; m < 2; ++m)
    coarsest.push_back(asset.walk(lod::view_error(1e30f), [](const CutGroup&) {}, m).triangles);
  for (const InstanceRun& run : step.runs) {
    if (!run.is_coarsest) continue;
    const Instance& first = selector.placements(run).front();
    const lod::View own = lod::to_object(view, first.transform);
    const WalkReport found = asset.walk(own, [](const CutGroup&) {}, first.mesh);
    EXPECT_EQ(found.triangles, coarsest[first.mesh]);
  }
}

TEST(InstanceSelector, keeps_pages_within_its_budget) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, kTrees));
  InstanceSelector selector(asset, 300'000);
  selector.settle(lod::view_error(0));
  EXPECT_GT(selector.bytes(), 1'000'000u);  // what is shown stays
  for (int x = 0; x < 400; x += 40) selector.settle(camera({static_cast<float>(x), 0, 0}, 200));
  EXPECT_LT(selector.bytes(), 600'000u);
}

TEST(InstanceSelector, keeps_all_pages_where_its_budget_is_zero) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, kTrees));
  InstanceSelector all(asset, 0), none(asset, 1);
  for (InstanceSelector* selector : {&all, &none}) {
    selector->settle(lod::view_error(0));
    selector->step(camera({0, 1e7f, 0}));
  }
  EXPECT_GT(all.bytes(), 1'000'000u);
  EXPECT_EQ(none.bytes(), 0u);
}

TEST(InstanceSelector, refuses_levels_and_pages_that_are_not_there) {
  const Scratch scratch;
  const Asset asset(forest_asset(scratch, 1000));
  InstanceSelector selector(asset);
  EXPECT_THROW(selector.step(lod::view_level(1)), Error);
  const uint32_t node = 12345;
  EXPECT_THROW(selector.load({&node, 1}), Error);
  EXPECT_THROW(selector.placements({1, {0, 1}, true}), Error);
}

}  // namespace
}  // namespace umbel
