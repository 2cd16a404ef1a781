#include <gtest/gtest.h>

#include <iterator>

#include "base/thread_teams.hpp"
#include "cluster/frame/frame_cases.hpp"
#include "cluster/frame/rebuild_worst.hpp"

namespace umbel {
namespace {

using namespace testing;

TEST(RebuildWorst, the_worst_are_rebuilt_and_the_others_stay) {
  const Mesh mesh = soup(9000, 8);
  // One end of the soup is stirred.
  Mesh stirred = mesh;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(-0.2f, 0.2f);
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.positions[3 * t].x > 0.4f) continue;
    const Vec3 by{unit(random), unit(random), unit(random)};
    for (size_t k = 0; k < 3; ++k) stirred.positions[3 * t + k] = mesh.positions[3 * t + k] + by;
  }
  for (const FrameClusterConfig& config : configs()) {
    if (config.max_vertices) continue;
    FrameClusterer c = clusters_of(mesh, config);
    const double refitted = c.refit(stirred.positions).area_ratio;
    std::set<std::vector<uint32_t>> before;
    const auto sets = [&](auto& into) {
      for (size_t k = 0; k < c.count(); ++k) {
        std::vector<uint32_t> items(c.items().begin() + c.offsets()[k],
                                    c.items().begin() + c.offsets()[k + 1]);
        std::sort(items.begin(), items.end());
        into.insert(items);
      }
    };
    sets(before);
    const auto budget = uint32_t(c.count() / 4);
    const double rebuilt = c.rebuild_worst(stirred.positions, budget).area_ratio;
    expect_sound(c, stirred, config);
    EXPECT_LT(rebuilt, refitted);
    std::set<std::vector<uint32_t>> after;
    sets(after);
    std::vector<std::vector<uint32_t>> gone;
    std::set_difference(before.begin(), before.end(), after.begin(), after.end(),
                        std::back_inserter(gone));
    EXPECT_LE(gone.size(), budget);
    EXPECT_GT(gone.size(), 0u);
    // With nothing to improve, nothing is done.
    FrameClusterer again = clusters_of(mesh, config);
    const auto items = copy(again.items());
    again.rebuild_worst(mesh.positions, 1000000);
    EXPECT_EQ(copy(again.items()), items);
  }
}

TEST(RebuildWorst, partial_rebuilds_by_teams_of_many_lanes_are_the_same) {
  const Mesh mesh = soup(600, 8), moved = deformed(mesh, 3);
  const auto rebuild = [&](auto exec, const FrameClusterConfig& config) {
    const auto n = uint32_t(mesh.triangles.size());
    const auto checked = cluster::CheckedFrameConfig::of(config, n);
    const uint32_t most = checked.most_clusters(n);
    std::vector<uint32_t> items[2], offsets[2], count[2];
    std::vector<Triangle> triangles[2];
    std::vector<Aabb> boxes[2];
    std::vector<uint64_t> now(most), at_build[2], total(2);
    cluster::FrameClusters view[2];
    for (int k = 0; k < 2; ++k) {
      items[k].resize(n), offsets[k].resize(most + 1), count[k].resize(1);
      triangles[k].resize(n), boxes[k].resize(most), at_build[k].resize(most);
      view[k] = {items[k].data(), triangles[k].data(), offsets[k].data(), boxes[k].data(),
                 count[k].data()};
    }
    const auto at = [](const Mesh& m) {
      return cluster::Positions{reinterpret_cast<const char*>(m.positions.data()), 12};
    };
    cluster::build_frame(exec, {at(mesh), mesh.triangles.data(), nullptr, n}, checked, view[0]);
    const cluster::AreaShares shares{now.data(), at_build[0].data(), total.data()};
    cluster::measure_area_growth(exec, view[0], most, shares, true);
    exec.for_each_team(
        most, cluster::RefitCluster{{at(moved), triangles[0].data(), nullptr, n}, view[0]});
    cluster::measure_area_growth(exec, view[0], most, shares, false);
    cluster::rebuild_worst(exec, at(moved), checked, view[0], shares, n, 3, view[1],
                           {now.data(), at_build[1].data(), total.data()});
    items[1].insert(items[1].end(), offsets[1].begin(), offsets[1].begin() + count[1][0] + 1);
    for (const uint64_t sum : total) items[1].push_back(uint32_t(sum ^ sum >> 32));
    return items[1];
  };
  for (const FrameClusterConfig& config : configs_for_teams())
    if (!config.max_vertices)
      ASSERT_EQ(rebuild(ThreadTeamExec(), config), rebuild(CpuExec(), config));
}

}  // namespace
}  // namespace umbel
