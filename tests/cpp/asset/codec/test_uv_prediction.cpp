#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "asset/codec/uv_prediction.hpp"

namespace umbel::asset {
namespace {

using Uv = std::array<int32_t, 2>;

/// Vertices with a position and texture coordinates, five integers each.
struct Vertices {
  std::vector<int32_t> integers;
  std::vector<Predictors> predictors;

  void add(const std::array<int32_t, 3>& position, const Uv& uv, Predictors from) {
    integers.insert(integers.end(), position.begin(), position.end());
    integers.insert(integers.end(), uv.begin(), uv.end());
    predictors.push_back(from);
  }
  Uv predicted(uint8_t vertex, bool is_mirrored = false) const {
    UvMap map;
    map_positions(integers.data(), 5, predictors, {&vertex, 1}, map);
    const Lanes uv = MappedUvs(map, is_mirrored)(vertex, integers.data() + 3, 5);
    return {static_cast<int32_t>(uv[0]), static_cast<int32_t>(uv[1])};
  }
};

/// A region's first triangle but for its third vertex: an edge along x.
Vertices edge(int32_t length, const Uv& from, const Uv& to) {
  Vertices made;
  made.add({0, 0, 0}, from, predictors_of(0, 0, 0));
  made.add({length, 0, 0}, to, predictors_of(0, 0, 0));
  return made;
}
Predictors third() { return {predictors_of(1, 1, 1).word | Predictors::kCloses}; }

TEST(UvPrediction, goes_on_with_the_map_of_a_flat_surface) {
  // u = x + 2 y, v = 3 y - x.
  Vertices flat = edge(100, {0, 0}, {100, -100});
  flat.add({30, 60, 0}, {150, 150}, third());
  flat.add({80, -50, 0}, {}, predictors_of(1, 0, 2));
  EXPECT_EQ(flat.predicted(3), (Uv{-20, -230}));
}

TEST(UvPrediction, unfolds_the_surface_about_the_edge) {
  Vertices folded = edge(100, {0, 0}, {100, -100});
  folded.add({30, 60, 0}, {150, 150}, third());
  folded.add({80, 0, 50}, {}, predictors_of(1, 0, 2));
  EXPECT_EQ(folded.predicted(3), (Uv{-20, -230}));
}

TEST(UvPrediction, takes_the_first_triangle_for_similar_to_its_chart) {
  Vertices first = edge(100, {1000, 2000}, {1000, 2200});
  first.add({25, 0, -50}, {}, third());
  EXPECT_EQ(first.predicted(2), (Uv{1100, 2050}));
  EXPECT_EQ(first.predicted(2, true), (Uv{900, 2050}));
}

TEST(UvPrediction, falls_back_where_there_is_no_map) {
  Vertices point = edge(0, {10, 20}, {30, 50});
  point.add({0, 0, 0}, {70, 60}, third());
  EXPECT_EQ(point.predicted(2), (Uv{30, 50}));  // the vertex before
  point.add({5, 5, 5}, {}, predictors_of(1, 0, 2));
  EXPECT_EQ(point.predicted(3), (Uv{-30, 10}));  // the parallelogram
  point.add({5, 5, 5}, {}, predictors_of(2, 2, 2));
  EXPECT_EQ(point.predicted(4), (Uv{70, 60}));  // a start
  // A triangle a hundred times as large as the one before.
  Vertices far = edge(10, {0, 0}, {10, 0});
  far.add({0, 10, 0}, {0, 10}, third());
  far.add({1000, -1000, 0}, {}, predictors_of(1, 0, 2));
  EXPECT_EQ(far.predicted(3), (Uv{10, -10}));
}

// A damaged file has any integers.
TEST(UvPrediction, takes_any_integers) {
  std::mt19937 random(11);
  constexpr std::array kSpecial{0, 1, -1, std::numeric_limits<int32_t>::max(),
                                std::numeric_limits<int32_t>::min()};
  for (int round = 0; round < 1000; ++round) {
    const auto any = [&] {
      return round % 2 ? kSpecial[random() % kSpecial.size()] : static_cast<int32_t>(random());
    };
    Vertices made;
    made.add({any(), any(), any()}, {any(), any()}, predictors_of(0, 0, 0));
    made.add({any(), any(), any()}, {any(), any()}, predictors_of(0, 0, 0));
    made.add({any(), any(), any()}, {any(), any()}, third());
    made.add({any(), any(), any()}, {any(), any()}, predictors_of(1, 0, 2));
    // Whatever they are, no more than 2^30 is added to the first one's, modulo 2^32.
    const auto is_near = [](int32_t a, int32_t b) {
      return static_cast<uint32_t>(a) - static_cast<uint32_t>(b) + (1u << 30) <= 1u << 31;
    };
    for (const auto& [vertex, first] : {std::pair<uint8_t, size_t>{2, 0}, {3, 1}})
      for (size_t c = 0; c < 2; ++c)
        EXPECT_TRUE(is_near(made.predicted(vertex)[c], made.integers[5 * first + 3 + c])) << round;
  }
}

}  // namespace
}  // namespace umbel::asset
