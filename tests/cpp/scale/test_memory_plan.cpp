// What a build in units takes, by how many vertices triangles have.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "io/source/mesh_source.hpp"
#include "scale/build_asset.hpp"

namespace umbel::scale {
namespace {

// Every triangle with vertices of its own.
Mesh soup_of(const Mesh& mesh) {
  Mesh soup;
  for (const Triangle& t : mesh.triangles) {
    const auto first = static_cast<uint32_t>(soup.positions.size());
    for (const uint32_t v : t) soup.positions.push_back(mesh.positions[v]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  return soup;
}

Mesh leaves(uint32_t count) {
  Mesh mesh;
  for (uint32_t i = 0; i < count; ++i) {
    const auto x = static_cast<float>(2 * i);
    for (const Vec3& p : {Vec3{x, 0, 0}, Vec3{x + 1, 0, 0}, Vec3{x, 1, 0}, Vec3{x + 1, 1, 0}})
      mesh.positions.push_back(p);
    mesh.triangles.push_back({4 * i, 4 * i + 1, 4 * i + 2});
    mesh.triangles.push_back({4 * i + 2, 4 * i + 1, 4 * i + 3});
  }
  return mesh;
}

VertexShare share_of(const Mesh& mesh, uint64_t vertices = 0) {
  return vertex_share(io::MeshSource(mesh.view(), {0, 0, 0}, "mesh"), vertices);
}

uint64_t least_of(const VertexShare& share) {
  return plan_memory(uint64_t{1} << 40, 1, uint64_t{4} << 20, {}, {}, share).least;
}

TEST(MemoryPlan, SharesOfVerticesAreFound) {
  const Mesh surface = shapes::sphere(5);
  EXPECT_NEAR(share_of(surface).given, 0.5, 0.1);
  EXPECT_NEAR(share_of(surface).distinct, 0.5, 0.1);
  const Mesh soup = soup_of(surface);
  EXPECT_EQ(share_of(soup).given, 3);
  EXPECT_NEAR(share_of(soup).distinct, 0.5, 0.1);
  EXPECT_EQ(share_of(leaves(1000)).distinct, 2);
  EXPECT_EQ(share_of(leaves(1000), 1000).distinct, 0.5);
  EXPECT_EQ(share_of(Mesh{}).given, VertexShare{}.given);
}

// In random order, in which triangles side by side share nothing.
Mesh shuffled(Mesh mesh) {
  std::mt19937 random(5);
  std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
  return soup_of(mesh);
}

TEST(MemoryPlan, AShuffledSoupIsAsSmallAsItsSurface) {
  const double surface = share_of(shuffled(shapes::sphere(8))).distinct;
  EXPECT_LT(surface, 1.0);
  EXPECT_GT(surface, 0.45);
  // What is connected to nothing stays so.
  EXPECT_NEAR(share_of(shuffled(leaves(200'000))).distinct, 2, 0.8);
  EXPECT_EQ(share_of(shapes::soup(600'000, 3)).distinct, 3);
}

TEST(MemoryPlan, OtherOrdersThanRandomOnesDoNotMislead) {
  // The same twice, one half behind the other; and where all triangles have one vertex in common.
  Mesh twice = soup_of(shapes::soup(300'000, 3));
  const Mesh half = twice;
  twice.positions.insert(twice.positions.end(), half.positions.begin(), half.positions.end());
  for (const Triangle& t : half.triangles)
    twice.triangles.push_back({t[0] + 900'000, t[1] + 900'000, t[2] + 900'000});
  EXPECT_GT(share_of(twice).distinct, 1.5);
  Mesh fan = soup_of(shapes::soup(600'000, 3));
  for (size_t v = 0; v < fan.positions.size(); v += 3) fan.positions[v] = {0, 0, 0};
  EXPECT_GT(share_of(fan).distinct, 1.9);
}

// Measured with units of four million triangles, in processes of their own.
TEST(MemoryPlan, WhatWasMeasuredFits) {
  constexpr uint64_t kMiB = 1 << 20, kDriver = 160 * kMiB;
  EXPECT_GE(least_of({0.5, 0.5}), kDriver + 237 * kMiB);
  EXPECT_GE(least_of({3, 0.5}), kDriver + 691 * kMiB);
  EXPECT_GE(least_of({2, 2}), kDriver + 1810 * kMiB);
  EXPECT_GE(least_of({3, 2}), kDriver + 1891 * kMiB);
  EXPECT_LT(least_of({0.5, 0.5}), 700'000'000u);
}

TEST(MemoryPlan, TooLittleIsRefusedWithWhatWouldDo) {
  try {
    plan_memory(uint64_t{1} << 30, 1, uint64_t{4} << 20, {}, {}, {2, 2});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("unit_triangles"), std::string::npos);
  }
}

}  // namespace
}  // namespace umbel::scale
