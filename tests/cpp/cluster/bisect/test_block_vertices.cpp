// Vertices on both sides of each split, counted one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "cluster/bisect/block_vertices.hpp"
#include "cluster/bisect/scaling.hpp"
#include "cluster/bisect/sweep_splits.hpp"

namespace umbel::cluster {
namespace {

// Triangles of random vertices, a few of them degenerate, of a mesh of `vertices`.
struct Soup {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  std::vector<uint32_t> all;

  Soup(uint32_t vertices, uint32_t count, uint32_t used, uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> coordinate(0.0f, 1.0f);
    std::uniform_int_distribution<uint32_t> any(0, used - 1);
    for (uint32_t v = 0; v < vertices; ++v)
      positions.push_back({coordinate(random), coordinate(random), coordinate(random)});
    const uint32_t step = vertices / used;
    for (uint32_t t = 0; t < count; ++t)
      triangles.push_back({any(random) * step, any(random) * step, any(random) * step});
    triangles[1][2] = triangles[1][0];
    all.resize(count);
    std::iota(all.begin(), all.end(), 0u);
  }
  Source source() const {
    MeshView view;
    view.positions = positions;
    view.triangles = triangles;
    return Source::of(view, 0.0f);
  }
  BlockItems items() const {
    BlockItems result;
    Box4* const boxes = result.prepare(static_cast<uint32_t>(all.size()));
    for (uint32_t i = 0; i < all.size(); ++i) boxes[i] = source().record(i).tagged(i);
    result.find_centers(source());
    result.sort();
    return result;
  }
  uint32_t vertices_of(const uint32_t* begin, const uint32_t* end) const {
    std::set<uint32_t> vertices;
    for (; begin != end; ++begin)
      vertices.insert(triangles[*begin].begin(), triangles[*begin].end());
    return static_cast<uint32_t>(vertices.size());
  }
};

// Small meshes' own indices are numbers, those of large ones are not.
const std::vector<uint32_t> kVertexCounts{100, 60000};

TEST(BlockVertices, both_sides_of_each_split_are_counted) {
  for (const uint32_t vertex_count : kVertexCounts) {
    const Soup soup(vertex_count, 200, 90, vertex_count);
    const Source source = soup.source();
    const BlockItems items = soup.items();
    BlockVertices vertices;
    vertices.load(source, soup.all.data(), 200);
    std::vector<uint32_t> left(201), right(201);
    for (const auto& [begin, end] : {std::pair{0u, 200u}, std::pair{50u, 120u}}) {
      // Not a node of the bisection, whose orders have the same items: each by itself.
      for (int axis = 0; axis < 3; ++axis) {
        const uint32_t* const order = items.order(axis) + begin;
        const uint32_t n = end - begin;
        vertices.number(items);
        vertices.count_sides(order, n, left.data(), right.data());
        for (uint32_t i = 0; i < n; ++i) {
          ASSERT_EQ(left[i], soup.vertices_of(order, order + i + 1));
          ASSERT_EQ(right[i], soup.vertices_of(order + i + 1, order + n));
        }
      }
    }
  }
}

// What a side weighs, as sweep_splits.cpp says.
struct Weights {
  float limit, usable, lost, most, item_price, vertex_price;

  float capacity(float c) const { return c * usable - lost * (c - std::sqrt(c)); }
  float operator()(uint32_t items, uint32_t vertices) const {
    const float i = static_cast<float>(items), v = static_cast<float>(vertices);
    float c = 1;
    while (c * most < i || (v > limit && capacity(c) < v)) c += 1;
    return i + item_price * std::max(c * most - i, 0.0f) +
           vertex_price * std::max(capacity(c) - v, 0.0f);
  }
};

TEST(SweepSplits, no_split_costs_less_than_the_one_that_is_found) {
  constexpr uint32_t kCount = 150;
  size_t differ = 0;
  for (uint32_t seed = 0; seed < 30; ++seed) {
    const Soup soup(seed % 2 ? 20000 : 140, kCount, 140, seed);
    const Source source = soup.source();
    BlockItems items = soup.items();
    BlockVertices vertices;
    vertices.load(source, soup.all.data(), kCount);
    ClusterConfig config;
    config.min_items = 8, config.max_items = 40, config.max_vertices = 48;
    config.underfill_cost = 0.3f, config.vertex_underfill_cost = 0.5f;
    SplitSweep sweep;
    sweep.load(source, soup.all.data(), kCount);
    const AxisSplit found =
        sweep.cheapest(items, &vertices, SplitConstraints(config), config.max_items, 0, kCount);
    // The same, one split at a time.
    const auto order = [&](int axis) { return items.order(axis); };
    const float whole = static_cast<float>(soup.vertices_of(order(0), order(0) + kCount));
    const auto on_left = [&](int a, uint32_t n) {
      return soup.vertices_of(order(a), order(a) + n);
    };
    const auto on_right = [&](int a, uint32_t n) {
      return soup.vertices_of(order(a) + n, order(a) + kCount);
    };
    const auto both = [&](int a) {
      return static_cast<float>(on_left(a, kCount / 2) + on_right(a, kCount / 2));
    };
    const float duplicates = std::min({both(0), both(1), both(2)}) - whole;
    const float per_item = whole / kCount, limit = 48;
    Weights weigh{limit, std::max(std::floor(limit / per_item + 1e-3f) * per_item, limit / 2),
                  0,     40,
                  0.6f,  0.5f * 3.0f * 2.0f / 3.0f * kCount / whole};
    const float halves = std::sqrt(whole / (2 * limit));
    weigh.lost = std::min(duplicates / ((2.0f - std::sqrt(2.0f)) * halves), 0.6f * weigh.usable);
    const Float4 pad = pad_for(items.bounds(0, kCount));
    float lowest = std::numeric_limits<float>::infinity();
    for (int a = 0; a < 3; ++a) {
      Box4 left = Box4::empty();
      for (uint32_t n = 1; n < kCount; ++n) {
        left.extend(items.boxes()[order(a)[n - 1]]);
        if (n < 8 || kCount - n < 8) continue;
        Box4 right = Box4::empty();
        for (uint32_t i = n; i < kCount; ++i) right.extend(items.boxes()[order(a)[i]]);
        const uint32_t l = on_left(a, n), r = on_right(a, n);
        const float doubled = (static_cast<float>(l + r) - whole) / per_item;
        lowest = std::min(lowest, left.half_area(pad) * (weigh(n, l) + doubled) +
                                      right.half_area(pad) * (weigh(kCount - n, r) + doubled));
      }
    }
    EXPECT_NEAR(found.cost, lowest, 1e-4f * lowest);
    EXPECT_EQ(found.left_vertices, on_left(found.axis, found.position));
    EXPECT_EQ(found.right_vertices, on_right(found.axis, found.position));
    differ += found.position != kCount / 2;
  }
  EXPECT_GT(differ, 0u);
}

}  // namespace
}  // namespace umbel::cluster
