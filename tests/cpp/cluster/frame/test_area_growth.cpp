#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "cluster/frame/area_growth.hpp"
#include "cluster/frame/frame_cases.hpp"

namespace umbel {
namespace {

using namespace testing;

TEST(AreaGrowth, refit_keeps_clusters_and_bounds_them) {
  const Mesh mesh = soup(9000, 6);
  for (const FrameClusterConfig& config : configs()) {
    FrameClusterer c = clusters_of(mesh, config);
    const auto items = copy(c.items());
    const AreaGrowth rest = c.refit(mesh.positions);
    EXPECT_EQ(rest.area_ratio, rest.area_ratio_at_build);
    EXPECT_EQ(rest.growth(), 1.0);
    const Mesh moved = deformed(mesh, 2);
    const AreaGrowth growth = c.refit(moved.positions);
    expect_sound(c, moved, config);
    EXPECT_EQ(copy(c.items()), items);
    Aabb all;
    double sum = 0;
    for (const Aabb& box : c.boxes()) {
      sum += half_area(box);
      extend(all, box);
    }
    EXPECT_NEAR(growth.area_ratio, sum / half_area(all), 1e-5 * growth.area_ratio);
    EXPECT_EQ(growth.area_ratio_at_build, rest.area_ratio);
  }
}

TEST(AreaGrowth, boxes_without_a_size_count_as_the_whole) {
  constexpr uint64_t kWhole = cluster::AreaShares::kWhole;
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  // As devices make them of any positions: a cube, half of it, a point, what is infinite, what is
  // no number, nothing.
  std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}, {{0, 0, 0}, {1, 1, 0}}, {{1, 1, 1}, {1, 1, 1}}};
  const auto shares_of = [](std::vector<Aabb> of) {
    const auto count = uint32_t(of.size());
    std::vector<uint64_t> now(count), at_build(count), total(2);
    uint32_t n = count;
    CpuExec exec;
    cluster::measure_area_growth(exec, {nullptr, nullptr, nullptr, of.data(), &n}, count,
                                 {now.data(), at_build.data(), total.data()}, true);
    EXPECT_EQ(total[0], std::accumulate(now.begin(), now.end(), uint64_t(0)));
    return now;
  };
  EXPECT_EQ(shares_of(boxes), (std::vector<uint64_t>{kWhole, kWhole / 3, 0}));
  boxes.push_back({});
  EXPECT_EQ(shares_of(boxes), (std::vector<uint64_t>{kWhole, kWhole / 3, 0, 0}));
  boxes.push_back({{-inf, 0, 0}, {inf, 0, 0}});
  boxes.push_back({{inf, inf, inf}, {inf, inf, inf}});
  boxes.push_back({{nan, 0, 0}, {nan, 1, 1}});
  const std::vector<uint64_t> shares = shares_of(boxes);
  for (size_t i = 0; i < shares.size(); ++i) EXPECT_LE(shares[i], kWhole) << i;
  for (size_t i = 4; i < shares.size(); ++i) EXPECT_EQ(shares[i], kWhole) << i;
}

TEST(AreaGrowth, scaling_alone_is_no_area_growth) {
  const Mesh mesh = soup(2000, 6);
  FrameClusterer c = clusters_of(mesh, {});
  Mesh larger = mesh;
  for (Vec3& p : larger.positions) p = p * 8.0f;
  EXPECT_DOUBLE_EQ(c.refit(larger.positions).growth(), 1.0);
}

TEST(RebuildPolicy, decides_by_threshold_period_and_budget) {
  using Action = RebuildPolicy::Action;
  RebuildPolicy policy;
  policy.threshold = 1.5;
  policy.least_period = 4;
  policy.most_period = 20;
  const AreaGrowth little{2.9, 2.0}, much{3.0, 2.0};
  EXPECT_EQ(policy.decide(little, 10), Action::kKeep);
  EXPECT_EQ(policy.decide(much, 3), Action::kKeep);
  EXPECT_EQ(policy.decide(much, 4), Action::kRebuild);
  EXPECT_EQ(policy.decide(little, 20), Action::kRebuild);
  policy.budget = 0.1;
  EXPECT_EQ(policy.decide(much, 4), Action::kRebuildWorst);
}

}  // namespace
}  // namespace umbel
