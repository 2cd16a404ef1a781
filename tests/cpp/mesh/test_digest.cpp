#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "base/hash.hpp"
#include "umbel/mesh.hpp"

namespace umbel {
namespace {

uint64_t digest(const Mesh& mesh) { return triangle_set_digest(mesh.view()); }

TEST(Hash, xxh64_gives_the_published_values) {
  const auto hash = [](std::string_view text, uint64_t seed = 0) {
    return xxh64(text.data(), text.size(), seed);
  };
  EXPECT_EQ(hash(""), 0xEF46DB3751D8E999u);
  EXPECT_EQ(hash("a"), 0xD24EC4F1A98C6E5Bu);
  EXPECT_EQ(hash("abc"), 0x44BC2CF5AD770999u);
  EXPECT_EQ(hash("Nobody inspects the spammish repetition"), 0xFBCEA83C8A378BF1u);
  EXPECT_EQ(hash("abc", 42), 0x13C1D910702770E6u);
  EXPECT_EQ(hash("abcdefgh", 42), 0x22485CF81472CABCu);
  EXPECT_EQ(hash("abcdefghijklmnopqrstuvwxyzabcde", 42), 0x4CD3424DD027D098u);
  EXPECT_EQ(hash("abcdefghijklmnopqrstuvwxyzabcdef", 42), 0xF992306E6C67CD89u);
  EXPECT_EQ(hash("abcdefghijklmnopqrstuvwxyzabcdefg", 42), 0x33087980B10490ECu);
  EXPECT_EQ(hash("abcdefghijklmnopqrstuvwxyzabcdefghij", 42), 0xEFF384CDDD234DA3u);
  EXPECT_EQ(hash("abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyzabcdefghijkl", 42),
            0xF3413232E97EB1DDu);
  EXPECT_EQ(hash("abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyzabc"
                 "defghijklmnopqrstuvw",
                 42),
            0xDD20FD5DB0A3619Cu);
}

TEST(TriangleSetDigest, ignores_order_rotation_and_vertex_numbers) {
  const Mesh mesh = shapes::blob(3, 1);
  Mesh other = mesh;
  std::reverse(other.triangles.begin(), other.triangles.end());
  for (size_t i = 0; i < other.triangles.size(); ++i)
    std::rotate(other.triangles[i].begin(), other.triangles[i].begin() + i % 3,
                other.triangles[i].end());
  EXPECT_EQ(digest(mesh), digest(other));
  EXPECT_EQ(digest(mesh), digest(weld(other.view())));
}

TEST(TriangleSetDigest, ignores_rotation_of_degenerate_triangles) {
  Mesh mesh;
  mesh.positions = {{1, 2, 3}, {4, 5, 6}, {1, 2, 3}};
  mesh.triangles = {{0, 1, 2}};
  const uint64_t expected = digest(mesh);
  for (const Triangle& t : {Triangle{1, 2, 0}, Triangle{2, 0, 1}, Triangle{0, 1, 0}}) {
    mesh.triangles = {t};
    EXPECT_EQ(digest(mesh), expected);
  }
}

TEST(TriangleSetDigest, sees_every_change_of_the_set) {
  const Mesh mesh = shapes::blob(3, 1);
  const uint64_t whole = digest(mesh);
  Mesh other = mesh;
  other.triangles.pop_back();
  EXPECT_NE(digest(other), whole);
  other.triangles.push_back(other.triangles.front());  // one lost, one twice
  EXPECT_NE(digest(other), whole);
  other = mesh;
  std::swap(other.triangles[5][0], other.triangles[5][1]);  // turned over
  EXPECT_NE(digest(other), whole);
  other = mesh;
  other.positions[3].x = std::nextafter(other.positions[3].x, 2.0f);
  EXPECT_NE(digest(other), whole);
  EXPECT_EQ(digest(Mesh{}), 0u);
}

TEST(TriangleSetDigest, counts_minus_zero_as_zero) {
  Mesh a, b;
  a.triangles = b.triangles = {{0, 1, 2}};
  a.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  b.positions = {{-0.0f, 0, -0.0f}, {1, -0.0f, 0}, {0, 1, 0}};
  EXPECT_EQ(digest(a), digest(b));
}

TEST(Bounds, are_those_of_used_vertices) {
  Mesh mesh = shapes::grid(3, 3);
  mesh.positions.push_back({100, 100, 100});
  EXPECT_EQ(bounds(mesh.view()), (Aabb{{0, 0, 0}, {1, 1, 0}}));
  EXPECT_EQ(bounds(Mesh{}.view()), Aabb{});
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  ASSERT_EQ(boxes.size(), mesh.triangles.size());
  for (size_t i = 0; i < boxes.size(); ++i)
    for (uint32_t v : mesh.triangles[i]) {
      EXPECT_GE(mesh.positions[v].x, boxes[i].min.x);
      EXPECT_LE(mesh.positions[v].x, boxes[i].max.x);
      EXPECT_NEAR(boxes[i].max.y - boxes[i].min.y, 1.0f / 3, 1e-6f);
    }
  mesh.triangles[2][2] = 17;
  EXPECT_THROW(bounds(mesh.view()), Error);
  EXPECT_THROW(triangle_boxes(mesh.view()), Error);
  EXPECT_THROW(triangle_set_digest(mesh.view()), Error);
}

}  // namespace
}  // namespace umbel
