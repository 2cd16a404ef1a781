// The hysteresis of a residency, given in C, and what it spares a camera that moves to and fro.

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>
#include <thread>

#include "asset/scratch.hpp"
#include "umbel/asset.hpp"
#include "umbel/umbel.h"

namespace umbel {
namespace {

using testing::Scratch;

umbel_stream_view view_from(float angle) {
  const float eye[] = {1.8f * std::sin(angle), 0.1f, 1.8f * std::cos(angle)};
  umbel_stream_view view{};
  EXPECT_EQ(umbel_lod_view_camera(eye, 1, 1080, 0.5f, &view.view), UMBEL_OK);
  return view;
}

/// Loads and evictions of all steps.
struct Traffic {
  uint64_t loaded = 0, evicted = 0;

  /// Steps until nothing is on its way any more.
  void settle(umbel_residency* residency, const umbel_stream_view& view, double& seconds) {
    uint64_t asked = 0, come = 0;
    umbel_stream_step step;
    umbel_stream_step_init(&step);
    for (int i = 0; i < 2000; ++i) {
      ASSERT_EQ(umbel_residency_step(residency, &view, 1, seconds += 0.001, &step), UMBEL_OK);
      asked += step.requested;
      come += step.loaded + step.cancelled;
      loaded += step.loaded;
      evicted += step.evicted;
      if (asked == come && step.requested == 0 && step.caught_up) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
};

/// What a camera loads that goes from one side to the other ten times, with half of the pages in
/// memory.
Traffic traffic_to_and_fro(const umbel_asset* asset, float hysteresis) {
  umbel_asset_info info;
  umbel_asset_info_init(&info);
  EXPECT_EQ(umbel_asset_get_info(asset, &info), UMBEL_OK);
  umbel_residency_config config;
  umbel_residency_config_init(&config);
  config.budget_bytes = info.file_bytes / 2;
  config.hysteresis = hysteresis;
  umbel_residency* residency = nullptr;
  EXPECT_EQ(umbel_residency_create(asset, &config, &residency), UMBEL_OK);
  Traffic traffic;
  double seconds = 0;
  for (int i = 0; i < 20; ++i) traffic.settle(residency, view_from(i % 2 ? 0.3f : -0.3f), seconds);
  umbel_residency_free(residency);
  return traffic;
}

TEST(CResidency, hysteresis_spares_a_camera_that_moves_to_and_fro_its_reloads) {
  const Scratch scratch;
  lod::Config built;
  built.position_step = 1.0f / 4096;
  AssetConfig config;
  config.page_bytes = 8192;
  write_asset(scratch / "a.umbel", lod::build(shapes::blob(6, 2).view(), built), "{}", {}, config);
  umbel_asset* asset = nullptr;
  ASSERT_EQ(umbel_asset_open((scratch / "a.umbel").string().c_str(), &asset), UMBEL_OK);
  const Traffic without = traffic_to_and_fro(asset, 1);
  const Traffic with = traffic_to_and_fro(asset, 1.5f);
  EXPECT_GE(without.evicted, 15u);
  EXPECT_LT(4 * with.evicted, without.evicted);
  EXPECT_LT(with.loaded + 10, without.loaded);
  umbel_asset_free(asset);
}

}  // namespace
}  // namespace umbel
