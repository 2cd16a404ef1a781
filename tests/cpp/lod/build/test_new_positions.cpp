// New positions are like no other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "lod/build/new_positions.hpp"
#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

TEST(NewPositions, are_apart_whatever_the_size_and_the_step) {
  constexpr float kMost = std::numeric_limits<float>::max();
  for (const float x : {0.0f, 1.0f, -3.0f, 1e15f, -1e30f, kMost, -kMost})
    for (const float step : {0.0f, 0.25f, 0x1p-60f}) {
      Source source;
      source.mesh.positions = {{x, 0, 0}};
      source.position_ids = {0};
      AddedVertices added;
      for (int i = 0; i < 4; ++i) {
        added.mesh.positions.push_back({x, 0, 0});
        added.position_ids.push_back(kNone);
        added.components.push_back(kNone);
      }
      const float moved = NewPositions().set_apart(source, step, nullptr, added).value();
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

// Every other millionth along x.
class Stripes final : public UnusedPositions {
 public:
  bool contains(const Vec3& p) const override {
    return static_cast<int>(std::floor(p.x * 1e6f)) % 2 != 0;
  }
};

TEST(NewPositions, stay_where_others_have_none) {
  const Stripes stripes;
  Source source;
  NewPositions positions;
  std::vector<float> made;
  for (int group = 0; group < 50; ++group) {
    AddedVertices added;
    added.mesh.positions.push_back({0.5f, 0, 0});
    added.position_ids.push_back(kNone);
    added.components.push_back(kNone);
    ASSERT_TRUE(positions.set_apart(source, 0, &stripes, added)) << group;
    EXPECT_TRUE(stripes.contains(added.mesh.positions[0]));
    made.push_back(added.mesh.positions[0].x);
  }
  std::sort(made.begin(), made.end());
  EXPECT_EQ(std::unique(made.begin(), made.end()), made.end());
}

class Nowhere final : public UnusedPositions {
 public:
  bool contains(const Vec3& /*position*/) const override { return false; }
};

TEST(NewPositions, are_refused_where_there_is_no_room) {
  AddedVertices added;
  added.mesh.positions.push_back({0.5f, 0, 0});
  added.position_ids.push_back(kNone);
  added.components.push_back(kNone);
  const Nowhere nowhere;
  EXPECT_FALSE(NewPositions().set_apart(Source{}, 0, &nowhere, added));
}

// A group of any topology gets new positions, and may lose components after that.
TEST(NewPositions, of_any_topology_are_known_by_their_method) {
  Mesh mesh = shapes::sphere(3);
  const std::vector<Triangle> front = mesh.triangles;
  for (const auto& [a, b, c] : front) mesh.triangles.push_back({c, b, a});
  for (uint32_t i = 0; i < mesh.triangles.size(); ++i) mesh.materials.push_back(i % 2);
  testing::Random random(1);
  for (size_t v = 0; v < mesh.positions.size(); ++v)
    mesh.uvs.push_back({1e22f * static_cast<float>(random.uniform()),
                        1e22f * static_cast<float>(random.uniform())});
  for (const float ratio : {0.7f, 0.9f}) {
    Config config = testing::small_config();
    config.max_triangles = 64;
    config.min_group = 2;
    config.ratio = ratio;
    const Dag dag = build(mesh.view(), config);
    const VerifyReport report =
        verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh));
    EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
  }
}

}  // namespace
}  // namespace umbel::lod
