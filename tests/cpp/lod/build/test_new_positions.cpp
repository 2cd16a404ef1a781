// New positions are like no other.
#include <gtest/gtest.h>

#include <limits>

#include "lod/build/new_positions.hpp"

namespace umbel::lod {
namespace {

TEST(NewPositions, are_apart_whatever_the_size_and_the_step) {
  constexpr float kMost = std::numeric_limits<float>::max();
  for (const float x : {0.0f, 1.0f, -3.0f, 1e15f, -1e30f, kMost, -kMost})
    for (const float step : {0.0f, 0.25f, 0x1p-60f}) {
      Source source;
      source.mesh.positions = {{x, 0, 0}};
      AddedVertices added;
      for (int i = 0; i < 4; ++i) {
        added.mesh.positions.push_back({x, 0, 0});
        added.position_ids.push_back(kNone);
        added.components.push_back(kNone);
      }
      const float moved = NewPositions().set_apart(source, step, added);
      EXPECT_GT(moved, 0.0f) << x << " " << step;
      for (int i = 0; i < 4; ++i) {
        const float at = added.mesh.positions[i].x;
        EXPECT_TRUE(std::isfinite(at));
        EXPECT_NE(at, x) << step;
        if (step == 0.25f) {
          EXPECT_EQ(std::fmod(at, step), 0.0f) << x;
        }
        for (int j = 0; j < i; ++j) EXPECT_NE(at, added.mesh.positions[j].x) << x << " " << step;
      }
    }
}

}  // namespace
}  // namespace umbel::lod
