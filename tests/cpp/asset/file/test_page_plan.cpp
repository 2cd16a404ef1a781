// Pages have all groups, parents in front, and are filled.
#include <gtest/gtest.h>

#include <random>

#include "asset/file/page.hpp"
#include "asset/file/page_plan.hpp"

namespace umbel::asset {
namespace {

std::vector<std::vector<GroupEntry>> random_groups() {
  std::mt19937 random(5);
  std::vector<std::vector<GroupEntry>> meshes(3);
  const uint32_t levels[] = {6, 1, 9};
  for (uint32_t m = 0; m < 3; ++m)
    for (uint32_t level = 0; level < levels[m]; ++level)
      for (uint32_t g = 0; g < (600u >> level) + 1; ++g) {
        GroupEntry& entry = meshes[m].emplace_back();
        entry.group.level = level;
        entry.chunk_bytes = 8 * (100 + random() % 1500);
      }
  meshes[2][17].chunk_bytes = 100000;
  return meshes;
}

TEST(PagePlan, has_every_group_once_and_coarser_ones_first) {
  auto meshes = random_groups();
  const PagePlan plan = plan_pages(meshes, 32768);
  std::vector<std::vector<int>> seen(meshes.size());
  for (size_t m = 0; m < meshes.size(); ++m) seen[m].resize(meshes[m].size());
  uint32_t next = 0;
  std::vector<uint32_t> level(meshes.size(), kNone);
  for (uint32_t p = 0; p < plan.pages.size(); ++p) {
    EXPECT_EQ(plan.pages[p].offset, next);
    next += plan.pages[p].count;
    for (uint32_t i = 0; i < plan.pages[p].count; ++i) {
      const GroupName& name = plan.order[plan.pages[p].offset + i];
      const GroupEntry& entry = meshes[name.mesh][name.group];
      ++seen[name.mesh][name.group];
      EXPECT_EQ(entry.page, p);
      EXPECT_LE(entry.group.level, level[name.mesh]);
      level[name.mesh] = entry.group.level;
    }
  }
  EXPECT_EQ(next, plan.order.size());
  for (const auto& of_mesh : seen)
    for (const int times : of_mesh) EXPECT_EQ(times, 1);
}

TEST(PagePlan, fills_pages_and_gives_large_groups_one_of_their_own) {
  auto meshes = random_groups();
  const PagePlan plan = plan_pages(meshes, 32768);
  uint64_t all = 0;
  for (const Range& page : plan.pages) {
    uint64_t bytes = kPageHeaderBytes;
    for (uint32_t i = 0; i < page.count; ++i) {
      const GroupName& name = plan.order[page.offset + i];
      bytes += kGroupRecordBytes + meshes[name.mesh][name.group].chunk_bytes;
    }
    EXPECT_TRUE(bytes <= 32768 || page.count == 1);
    all += bytes;
  }
  EXPECT_GT(static_cast<double>(all), 0.9 * 32768 * static_cast<double>(plan.pages.size()));
}

TEST(PagePlan, of_nothing_is_empty) {
  EXPECT_EQ(plan_pages({}, 0).page_bytes, 40u << 10);
  std::vector<std::vector<GroupEntry>> meshes(2);
  EXPECT_TRUE(plan_pages(meshes, 4096).pages.empty());
}

}  // namespace
}  // namespace umbel::asset
