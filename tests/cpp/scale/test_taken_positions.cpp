// Units make no position that any other has or had.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "asset/scratch.hpp"
#include "scale/taken_positions.hpp"
#include "scale/units.hpp"

namespace umbel::scale::testing {
namespace {

std::vector<Vec3> points(uint32_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-1, 1);
  std::vector<Vec3> result;
  for (uint32_t i = 0; i < count; ++i)
    result.push_back({coordinate(random), coordinate(random), coordinate(random)});
  return result;
}

size_t contained(const TakenPositions& taken, const std::vector<Vec3>& points) {
  return std::ranges::count_if(points, [&](const Vec3& p) { return taken.may_contain(p); });
}

TEST(TakenPositions, HasAllThatWasAddedAndLittleElse) {
  constexpr uint32_t kTriangles = 200'000;
  TakenPositions taken(kTriangles);
  const std::vector<Vec3> added = points(kTriangles / 2, 1), others = points(10'000, 2);
  taken.add(added);
  EXPECT_EQ(contained(taken, added), added.size());
  EXPECT_LT(contained(taken, others), others.size() / 2);
  EXPECT_LE(TakenPositions::bytes(kTriangles), kTriangles);
}

TEST(TakenPositions, ZeroHasNoSign) {
  TakenPositions taken(1000);
  taken.add(std::vector<Vec3>{{0.0f, -0.0f, 1}});
  EXPECT_TRUE(taken.may_contain({-0.0f, 0.0f, 1}));
}

TEST(TakenPositions, ComesBackFromAFile) {
  const umbel::testing::Scratch scratch;
  TakenPositions taken(1000);
  const std::vector<Vec3> added = points(300, 1);
  taken.add(added);
  taken.write(scratch / "taken");
  EXPECT_EQ(contained(TakenPositions::read(scratch / "taken"), added), added.size());
  EXPECT_EQ(contained(taken, added), added.size());
}

TEST(UnitPositions, AreAtHomeAndNotTaken) {
  const umbel::testing::Scratch scratch;
  const Units all = all_units(shapes::terrain(60, 60, 1), 1000, 100'000);
  ASSERT_GT(all.partition.units(), 2u);
  TakenPositions taken(7200);
  std::vector<Vec3> source;
  for (const UnitInput& unit : all.units)
    source.insert(source.end(), unit.mesh.positions.begin(), unit.mesh.positions.end());
  taken.add(source);
  taken.write(scratch / "taken");
  std::vector<uint32_t> owners(2000, 0);
  const std::vector<Vec3> others = points(2000, 3);
  for (uint32_t u = 0; u < all.partition.units(); ++u) {
    const UnitPositions unused(all.partition, u, scratch / "taken");
    for (const Vec3& p : source) EXPECT_FALSE(unused.contains(p));
    for (size_t i = 0; i < others.size(); ++i) owners[i] += unused.contains(others[i]) ? 1 : 0;
  }
  EXPECT_EQ(std::ranges::max(owners), 1u);
  EXPECT_GT(std::ranges::count(owners, 1u), 500);
}

}  // namespace
}  // namespace umbel::scale::testing
