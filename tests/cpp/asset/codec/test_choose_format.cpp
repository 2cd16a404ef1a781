// What is known of parts of the vertices tells as much as all of them.
#include <gtest/gtest.h>

#include <limits>

#include "asset/codec/choose_format.hpp"

namespace umbel::asset {
namespace {

Mesh vertices(uint32_t first, uint32_t count) {
  Mesh mesh;
  for (uint32_t i = first; i < first + count; ++i) {
    const auto f = static_cast<float>(i);
    mesh.positions.push_back({f * 0.25f, -f, 3});
    mesh.uvs.push_back({f * 40, -f});
    mesh.colors.push_back({0, i == 90 ? 2.0f : 0.5f, 1, 1});
    mesh.extra_values.insert(mesh.extra_values.end(), {f, f * f, f, 0, 0, 0});
  }
  mesh.normals.assign(count, Vec3{0, 0, 1});
  mesh.extras = {{ExtraKind::kUvs, 1}, {ExtraKind::kJoints, 0}};
  return mesh;
}

bool same(const VertexFormat& a, const VertexFormat& b) {
  if (a.attributes.size() != b.attributes.size()) return false;
  for (size_t i = 0; i < a.attributes.size(); ++i) {
    const AttributeFormat &f = a.attributes[i], &g = b.attributes[i];
    if (f.attribute != g.attribute || f.coding != g.coding || f.bits != g.bits ||
        f.step != g.step || f.set != g.set)
      return false;
  }
  return true;
}

TEST(ChooseFormat, of_parts_is_that_of_the_whole) {
  for (const float step : {0.0f, 0.25f, 1.0f})
    for (const AssetConfig& config : {AssetConfig{}, AssetConfig::exact()})
      for (const uint32_t count : {80u, 100u}) {
        VertexStatistics sum;
        for (uint32_t first = 0; first < count; first += 20)
          add(sum, vertex_statistics(vertices(first, 20), step));
        add(sum, VertexStatistics{});
        lod::Dag dag;
        dag.vertices = vertices(0, count);
        dag.config.position_step = step;
        EXPECT_TRUE(same(choose_format(sum, step, config), choose_format(dag, config)));
      }
}

TEST(ChooseFormat, follows_the_values) {
  const auto coding_of = [](const Mesh& mesh, uint32_t attribute, float step = 0) {
    for (const AttributeFormat& f :
         choose_format(vertex_statistics(mesh, step), step, {}).attributes)
      if (f.attribute == attribute) return f.coding;
    return Coding::kFloats;
  };
  EXPECT_EQ(coding_of(vertices(0, 50), kPositions, 0.25f), Coding::kGrid);
  EXPECT_EQ(coding_of(vertices(0, 50), kPositions, 1.0f), Coding::kFloats);
  EXPECT_EQ(coding_of(vertices(0, 50), kColors), Coding::kSrgb);
  EXPECT_EQ(coding_of(vertices(80, 20), kColors), Coding::kFloats);
  Mesh mesh = vertices(0, 50);
  EXPECT_EQ(coding_of(mesh, kUvs), Coding::kGrid);
  mesh.uvs[7].y = std::numeric_limits<float>::infinity();
  EXPECT_EQ(coding_of(mesh, kUvs), Coding::kFloats);
}

}  // namespace
}  // namespace umbel::asset
