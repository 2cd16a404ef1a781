// Which region of a cluster comes next.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "asset/codec/region_seeds.hpp"

namespace umbel::asset {
namespace {

// Triangles that share no vertex, each at one place of a line.
struct Regions {
  std::vector<uint8_t> triangles;
  std::vector<int32_t> values;
  bool visited[256] = {}, known[256] = {};

  explicit Regions(const std::vector<int32_t>& places) {
    for (const int32_t place : places)
      for (int32_t k = 0; k < 3; ++k) {
        triangles.push_back(static_cast<uint8_t>(triangles.size()));
        values.insert(values.end(), {place, 7, place + k, 0, 0});
      }
  }
  // From region to region, each time on from the last corner.
  std::vector<uint32_t> order() {
    RegionSeeds seeds(triangles, values, static_cast<uint32_t>(triangles.size()));
    std::vector<uint32_t> result{0};
    while (3 * result.size() < triangles.size()) {
      const uint32_t t = result.back();
      visited[t] = known[3 * t] = known[3 * t + 1] = known[3 * t + 2] = true;
      result.push_back(seeds.next(static_cast<uint8_t>(3 * t + 2), visited, known, 8).triangle);
    }
    return result;
  }
};

TEST(RegionSeeds, the_next_region_is_the_one_that_takes_the_fewest_bits) {
  EXPECT_EQ(Regions({0, 9000, 100, 9100, 210}).order(), (std::vector<uint32_t>{0, 2, 4, 1, 3}));
}

TEST(RegionSeeds, it_begins_at_its_corner_that_is_most_like_the_last) {
  Regions regions({0, 500});
  const std::vector<int32_t> last = {3, 7, 498, 0, 0};
  std::copy(last.begin(), last.end(), regions.values.begin() + 10);
  std::copy(last.begin(), last.end(), regions.values.begin() + 20);
  RegionSeeds seeds(regions.triangles, regions.values, 6);
  regions.visited[0] = true;
  const RegionSeeds::Seed seed = seeds.next(2, regions.visited, regions.known, 8);
  EXPECT_EQ(seed.triangle, 1u);
  EXPECT_EQ(seed.corner, 1u);
}

TEST(RegionSeeds, a_known_vertex_costs_its_number) {
  Regions regions({0, 1000, 2000});
  regions.visited[0] = true;
  regions.known[6] = true;
  RegionSeeds seeds(regions.triangles, regions.values, 9);
  EXPECT_EQ(seeds.next(2, regions.visited, regions.known, 8).triangle, 2u);
  regions.known[6] = false;
  EXPECT_EQ(seeds.next(2, regions.visited, regions.known, 8).triangle, 1u);
}

TEST(RegionSeeds, differences_may_wrap) {
  constexpr int32_t kLowest = std::numeric_limits<int32_t>::min();
  EXPECT_EQ(Regions({kLowest, 0, kLowest + 300}).order(), (std::vector<uint32_t>{0, 2, 1}));
  Regions same({5, 5, 5});
  same.values.clear();
  EXPECT_EQ(same.order(), (std::vector<uint32_t>{0, 1, 2}));
}

}  // namespace
}  // namespace umbel::asset
