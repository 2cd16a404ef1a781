#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "asset/codec/connectivity.hpp"
#include "asset/file/format.hpp"
#include "asset/same_geometry.hpp"
#include "umbel/mesh.hpp"

namespace umbel::asset {
namespace {

using Triangles = std::vector<uint8_t>;

/// Triangles without regard to their order and to where each begins.
std::vector<std::array<uint8_t, 3>> sorted(const Triangles& triangles) {
  std::vector<std::array<uint8_t, 3>> all;
  for (size_t i = 0; i + 2 < triangles.size(); i += 3) {
    const std::array<uint8_t, 3> t{triangles[i], triangles[i + 1], triangles[i + 2]};
    all.push_back(umbel::testing::lowest_turn(t));
  }
  std::sort(all.begin(), all.end());
  return all;
}

/// Bits a triangle.
double expect_round_trip(const Triangles& triangles, uint32_t vertices) {
  std::vector<std::byte> bytes;
  BitWriter out(bytes);
  std::vector<int32_t> values;
  for (uint32_t v = 0; v < vertices; ++v)
    values.insert(values.end(), {int32_t(v * 7919 % 1000), -int32_t(v) * 0x01234567, 5});
  const Traversal traversal = encode_triangles(triangles, vertices, values, out);
  out.finish();
  BitReader in(bytes);
  Triangles decoded(triangles.size());
  std::vector<Predictors> predictors(vertices);
  std::vector<uint32_t> next(vertices, kNone), previous = next, last_to = next, last_from = next;
  decode_triangles(kVersionMajor, in, decoded, predictors, {next.data(), previous.data(), 1000});
  EXPECT_NO_THROW(in.finish());
  for (const BorderEdge& edge : traversal.border) {
    last_to[edge.from] = 1000u + edge.to;
    last_from[edge.to] = 1000u + edge.from;
  }
  EXPECT_EQ(next, last_to);
  EXPECT_EQ(previous, last_from);

  EXPECT_TRUE(decoded == traversal.triangles);
  std::vector<bool> seen(vertices);
  for (const uint8_t v : traversal.vertices) seen[v] = true;
  EXPECT_EQ(traversal.vertices.size(), vertices);
  EXPECT_TRUE(std::all_of(seen.begin(), seen.end(), [](bool s) { return s; }));
  for (uint32_t v = 0; v < vertices; ++v) {
    const Predictors& p = predictors[v];
    EXPECT_TRUE(p.a() == traversal.predictors[v].a() && p.b() == traversal.predictors[v].b() &&
                p.across() == traversal.predictors[v].across() &&
                p.closes_triangle() == traversal.predictors[v].closes_triangle());
    EXPECT_TRUE(v == 0 || (p.a() < v && p.b() < v && p.across() < v)) << v;
  }
  for (uint8_t& v : decoded) v = traversal.vertices[v];
  EXPECT_TRUE(sorted(decoded) == sorted(triangles));
  return triangles.empty() ? 0 : 24.0 * double(bytes.size()) / double(triangles.size());
}

Triangles local_triangles(const Mesh& mesh) {
  Triangles triangles;
  for (const Triangle& t : mesh.triangles)
    for (const uint32_t v : t) triangles.push_back(static_cast<uint8_t>(v));
  return triangles;
}

TEST(Connectivity, comes_back_for_shapes) {
  for (const Mesh& mesh : {shapes::grid(10, 10), shapes::sphere(1), shapes::torus(12, 10),
                           shapes::moebius(20, 3), shapes::fan(120), shapes::tetrahedra(30)})
    expect_round_trip(local_triangles(mesh), static_cast<uint32_t>(mesh.positions.size()));
}

TEST(Connectivity, takes_few_bits_for_a_smooth_surface) {
  const Mesh mesh = shapes::grid(11, 11);
  EXPECT_LT(expect_round_trip(local_triangles(mesh), static_cast<uint32_t>(mesh.positions.size())),
            2.9);
}

/// Pairs of triangles that have an edge in common.
Triangles quads(uint8_t count) {
  Triangles triangles;
  for (uint8_t q = 0; q < count; ++q)
    for (const int v : {0, 1, 2, 0, 2, 3}) triangles.push_back(static_cast<uint8_t>(4 * q + v));
  return triangles;
}

// A region begins with one bit for its vertices and three for its edges, and goes on with a word of
// two.
TEST(Connectivity, takes_few_bits_for_many_small_regions) {
  EXPECT_LT(expect_round_trip(quads(64), 256), 3.1);
}

TEST(Connectivity, marks_the_last_of_three_new_vertices) {
  std::vector<std::byte> bytes;
  BitWriter out(bytes);
  const Traversal traversal = encode_triangles(quads(2), 8, {}, out);
  for (uint32_t v = 0; v < 8; ++v)
    EXPECT_EQ(traversal.predictors[v].closes_triangle(), v % 4 == 2) << v;
}

TEST(Connectivity, comes_back_for_any_triangles) {
  std::mt19937 random(1);
  for (int round = 0; round < 500; ++round) {
    const uint32_t vertices = 1 + random() % (round % 2 ? 8 : 256);
    Triangles triangles(3 * (random() % 257));
    for (uint8_t& v : triangles) v = static_cast<uint8_t>(random() % vertices);
    expect_round_trip(triangles, vertices);
  }
}

TEST(Connectivity, comes_back_for_repeated_flipped_and_degenerate_triangles) {
  expect_round_trip({0, 1, 2, 0, 1, 2, 2, 1, 0, 0, 0, 1, 1, 1, 1}, 3);
  expect_round_trip({}, 5);
  expect_round_trip({4, 4, 4}, 5);
}

TEST(Connectivity, of_garbage_is_refused_or_in_range) {
  std::mt19937 random(2);
  size_t refused = 0;
  for (int round = 0; round < 5000; ++round) {
    std::vector<std::byte> bytes(random() % 200);
    for (std::byte& b : bytes) b = static_cast<std::byte>(random());
    Triangles triangles(3 * (1 + random() % 256));
    std::vector<Predictors> predictors(1 + random() % 256);
    BitReader in(bytes);
    std::vector<uint32_t> next(predictors.size(), 0), previous = next;
    try {
      decode_triangles(kVersionMajor, in, triangles, predictors, {next.data(), previous.data(), 0});
      for (const uint32_t v : next) ASSERT_LT(v, predictors.size());
      for (const uint8_t v : triangles) ASSERT_LT(v, predictors.size());
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      ++refused;
    }
  }
  EXPECT_GT(refused, 0u);
}

}  // namespace
}  // namespace umbel::asset
