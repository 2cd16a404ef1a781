#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "asset/scratch.hpp"
#include "mesh/vertex_bits.hpp"
#include "scale/route_exits.hpp"
#include "scale/undecided_edges.hpp"

namespace umbel::scale {
namespace {

auto sorted(const std::vector<PositionEdge>& edges) {
  std::vector<std::pair<std::array<uint32_t, 3>, std::array<uint32_t, 3>>> bits;
  for (const PositionEdge& edge : edges)
    bits.emplace_back(value_bits(edge.from), value_bits(edge.to));
  std::sort(bits.begin(), bits.end());
  return bits;
}

TEST(UndecidedEdges, ManyAreDecidedAsFewAre) {
  const testing::Scratch scratch;
  std::mt19937 random(1);
  const auto point = [&] { return Vec3{static_cast<float>(random() % 60), 0, -0.0f}; };
  std::vector<PositionEdge> edges;
  // Some buckets are written more than once.
  for (size_t i = 0; i < 100'000; ++i) edges.push_back({point(), point()});
  const auto expected = sorted(non_manifold_edges(edges));
  EXPECT_FALSE(expected.empty());
  for (const uint64_t most : {200'000u, 40'000u, 3'000u}) {
    UndecidedEdges undecided(scratch / "edges", edges.size(), most);
    for (size_t i = 0; i < edges.size(); i += 1000)
      undecided.add(std::span(edges).subspan(i, 1000));
    EXPECT_EQ(sorted(undecided.non_manifold()), expected) << most;
  }
  EXPECT_FALSE(std::filesystem::exists(scratch / "edges"));
}

}  // namespace
}  // namespace umbel::scale
