#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "asset/codec/twins.hpp"
#include "asset/file/format.hpp"
#include "umbel/lod.hpp"
#include "umbel/mesh.hpp"

namespace umbel::asset {
namespace {

/// Triangles of a sphere that share positions, but no vertices, in clusters; and what is known.
struct Creased {
  static constexpr uint32_t kClusters = 4, kTriangles = 80;
  static constexpr uint32_t kVertices = 3 * kTriangles;
  std::vector<std::vector<std::byte>> bytes;
  std::vector<std::vector<uint32_t>> twin;
  std::vector<int32_t> group;  // integers of all vertices in the order of their traversals
};

Creased encoded() {
  Creased made;
  const Mesh sphere = shapes::sphere(2);
  SharedVertices shared(size_t{Creased::kClusters} * Creased::kVertices);
  Twins twins(size_t{Creased::kClusters} * Creased::kVertices);
  std::vector<uint8_t> triangles(Creased::kVertices);
  for (uint32_t i = 0; i < Creased::kVertices; ++i) triangles[i] = static_cast<uint8_t>(i);
  for (uint32_t c = 0; c < Creased::kClusters; ++c) {
    BitWriter out(made.bytes.emplace_back());
    const Traversal traversal = encode_triangles(triangles, Creased::kVertices, {}, out);
    std::vector<uint32_t> ids;
    for (const uint8_t v : traversal.vertices) {
      ids.push_back(c * Creased::kVertices + v);
      const auto corner = ids.back();
      const Triangle& triangle = sphere.triangles[corner / 3];
      const Vec3 p = sphere.positions[triangle[corner % 3]];
      for (const float f : {p.x, p.y, p.z})
        made.group.push_back(static_cast<int32_t>(std::lround(1000 * f)));
    }
    const std::vector<uint32_t> equal = shared.encode(ids, traversal.border, out);
    made.twin.push_back(twins.encode(shared.borders(), equal, made.group, 3, out));
    out.finish();
  }
  return made;
}

TEST(Twins, are_all_found_and_read_back) {
  const Creased made = encoded();
  GroupBorders borders(size_t{Creased::kClusters} * Creased::kVertices);
  std::map<std::array<int32_t, 3>, uint32_t> seen;
  for (uint32_t c = 0; c < Creased::kClusters; ++c) {
    std::vector<uint8_t> triangles(Creased::kVertices);
    std::vector<Predictors> predictors(Creased::kVertices);
    std::vector<uint32_t> equal(Creased::kVertices), twin(Creased::kVertices);
    BitReader in(made.bytes[c]);
    decode_triangles(kVersionMajor, in, triangles, predictors,
                     borders.add_cluster(Creased::kVertices));
    borders.list_last();
    decode_shared(in, borders, equal);
    EXPECT_TRUE(decode_twins(in, borders, equal, twin));
    EXPECT_NO_THROW(in.finish());
    EXPECT_EQ(twin, made.twin[c]);
    for (uint32_t v = 0; v < Creased::kVertices; ++v) {
      const uint32_t at = c * Creased::kVertices + v;
      const auto position = [&](uint32_t vertex) {
        return std::array{made.group[3 * vertex], made.group[3 * vertex + 1],
                          made.group[3 * vertex + 2]};
      };
      const bool is_first = seen.emplace(position(at), at).second;
      EXPECT_EQ(twin[v] == kNone, is_first) << at;
      if (twin[v] == kNone) continue;
      EXPECT_LT(twin[v], at);
      EXPECT_EQ(position(twin[v]), position(at));
    }
  }
}

TEST(Twins, that_lie_along_borders_take_few_bits) {
  // Apart from the triangles, which start a region each: 3 + 3 + 3 bits, and what numbers them.
  const Creased made = encoded();
  size_t bytes = 0, twins = 0;
  for (const auto& cluster : made.bytes) bytes += cluster.size();
  for (const auto& cluster : made.twin)
    for (const uint32_t twin : cluster) twins += twin != kNone;
  EXPECT_GT(twins, size_t{3} * Creased::kClusters * Creased::kVertices / 4);
  EXPECT_LT(8 * bytes, 8 * twins + size_t{10} * Creased::kClusters * Creased::kTriangles);
}

}  // namespace
}  // namespace umbel::asset
