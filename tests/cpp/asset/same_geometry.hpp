// Comparing clusters that were stored: their triangles and vertices come back in another order, and
// their boxes a little larger.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

#include "base/math.hpp"
#include "umbel/lod.hpp"

namespace umbel::testing {

/// A triangle begun at the corner that makes it the lowest.
template <typename Corner>
std::array<Corner, 3> lowest_turn(const std::array<Corner, 3>& t) {
  return std::min({t, {t[1], t[2], t[0]}, {t[2], t[0], t[1]}});
}

/// The bits of all that a vertex has.
using Corner = std::vector<uint32_t>;

template <typename Vector>
void append(Corner& corner, const std::vector<Vector>& stream, size_t vertex) {
  if (stream.empty()) return;
  for (const uint32_t word :
       std::bit_cast<std::array<uint32_t, sizeof(Vector) / 4>>(stream[vertex]))
    corner.push_back(word);
}

/// The triangles without regard to their order and to where each begins.
inline std::vector<std::array<Corner, 3>> triangles_of(const lod::ClusterGeometry& g) {
  std::vector<std::array<Corner, 3>> triangles;
  for (size_t i = 0; i + 2 < g.triangles.size(); i += 3) {
    std::array<Corner, 3> triangle;
    for (size_t k = 0; k < 3; ++k) {
      const uint8_t v = g.triangles[i + k];
      append(triangle[k], g.positions, v);
      append(triangle[k], g.normals, v);
      append(triangle[k], g.tangents, v);
      append(triangle[k], g.uvs, v);
      append(triangle[k], g.colors, v);
      const size_t width = extra_width(g.extras);
      for (size_t i = v * width; i < (v + 1) * width; ++i)
        triangle[k].push_back(std::bit_cast<uint32_t>(g.extra_values[i]));
    }
    triangles.push_back(lowest_turn(triangle));
  }
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

inline void expect_same_clusters(const std::vector<lod::Cluster>& stored,
                                 const std::vector<lod::Cluster>& given) {
  ASSERT_EQ(stored.size(), given.size());
  Aabb all;
  for (const lod::Cluster& cluster : given) {
    all.min = min(all.min, cluster.box.min);
    all.max = max(all.max, cluster.box.max);
  }
  const Vec3 step = (all.max - all.min) * (1.001f / 65535);
  for (size_t i = 0; i < given.size(); ++i) {
    lod::Cluster same = stored[i];
    const Aabb outer = same.box, inner = given[i].box;
    same.box = inner;
    EXPECT_EQ(same, given[i]) << i;
    EXPECT_EQ(min(outer.min, inner.min), outer.min) << i;
    EXPECT_EQ(max(outer.max, inner.max), outer.max) << i;
    EXPECT_EQ(max(outer.min, inner.min - step), outer.min) << i;
    EXPECT_EQ(min(outer.max, inner.max + step), outer.max) << i;
  }
}

}  // namespace umbel::testing
