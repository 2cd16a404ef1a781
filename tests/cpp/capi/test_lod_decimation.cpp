// A decimation of the caller's own, from C.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>

#include "capi/lod_call.hpp"

namespace umbel {
namespace {

using namespace lod_call;

struct Calls {
  int count = 0;
  size_t vertices = 0;
};

// The edges that one triangle has, in its direction.
std::vector<std::pair<uint32_t, uint32_t>> border_of(const umbel_lod_mesh& mesh) {
  std::set<std::pair<uint32_t, uint32_t>> edges;
  for (size_t i = 0; i < 3 * mesh.triangle_count; ++i)
    edges.insert({mesh.triangles[i], mesh.triangles[i % 3 == 2 ? i - 2 : i + 1]});
  std::vector<std::pair<uint32_t, uint32_t>> border;
  for (const auto& [a, b] : edges)
    if (edges.count({b, a}) == 0) border.emplace_back(a, b);
  return border;
}

// A fan from the border to a new vertex above, where that is few enough triangles.
int fan_around_a_new_vertex(umbel_lod_decimation* group, void* user) {
  auto& calls = *static_cast<Calls*>(user);
  ++calls.count;
  calls.vertices += group->mesh.position_count;
  const auto border = border_of(group->mesh);
  if (border.empty() || border.size() > group->target) return 0;
  for (const auto& [a, b] : border) {
    uint32_t* t = group->triangles + 3 * group->triangle_count++;
    t[0] = a;
    t[1] = b;
    t[2] = static_cast<uint32_t>(group->mesh.position_count);
  }
  const umbel_vec3& first = group->mesh.positions[border[0].first];
  const umbel_vec3& second = group->mesh.positions[border[border.size() / 2].first];
  group->added_positions[0] = {(first.x + second.x) / 2, (first.y + second.y) / 2, 0.25f};
  group->added_uvs[0] = {first.x, first.y};
  group->added_count = 1;
  group->error = 0.25f;
  return 1;
}

TEST(LodFromC, decimation_of_the_callers_own_may_add_vertices) {
  Mesh mesh = shapes::grid(40, 40);
  for (const Vec3& p : mesh.positions) mesh.uvs.push_back({p.x, p.y});
  umbel_lod_config config = small_config();
  Calls calls;
  config.decimate = fan_around_a_new_vertex;
  config.decimate_user = &calls;
  const auto lod = built(mesh, config, 1);
  EXPECT_GT(calls.count, 5);
  EXPECT_GT(calls.vertices, 500u);
  EXPECT_EQ(umbel_lod_verify(lod.get(), 16, 1, nullptr), UMBEL_OK) << umbel_last_error();
  umbel_lod_view view;
  umbel_lod_view_error(0.3f, &view);
  const CutMesh shown(lod.get(), view);
  const umbel_lod_mesh& arrays = shown.arrays;
  bool raised = false;
  for (size_t v = 0; v < arrays.position_count; ++v) raised |= arrays.positions[v].z == 0.25f;
  EXPECT_TRUE(raised);
}

TEST(LodFromC, a_decimation_is_told_why_it_was_refused_and_can_cancel) {
  const Mesh mesh = shapes::grid(40, 40);
  umbel_lod_config config = small_config();
  std::set<uint32_t> told;
  config.decimate_user = &told;
  config.decimate = [](umbel_lod_decimation* group, void* user) {
    static_cast<std::set<uint32_t>*>(user)->insert(group->refusal);
    EXPECT_EQ(group->refused_why != nullptr, group->refusal != UMBEL_LOD_NOT_REFUSED);
    EXPECT_LT(group->target, group->most);
    if (group->refusal == UMBEL_LOD_REFUSED_EDGES) {
      EXPECT_GT(group->refused_edge_count, 0u);
      EXPECT_LT(group->refused_edges[0], group->mesh.position_count);
      return 0;
    }
    // All triangles are too many; one alone does not have the border.
    const bool first = group->refusal == UMBEL_LOD_NOT_REFUSED;
    group->triangle_count = first ? group->mesh.triangle_count : 1;
    std::copy_n(group->mesh.triangles, 3 * group->triangle_count, group->triangles);
    return 1;
  };
  ASSERT_NE(built(mesh, config, 1), nullptr);
  EXPECT_TRUE(told.count(UMBEL_LOD_NOT_REFUSED) && told.count(UMBEL_LOD_REFUSED_TOO_MANY) &&
              told.count(UMBEL_LOD_REFUSED_EDGES));
  config.decimate = [](umbel_lod_decimation*, void*) { return UMBEL_LOD_DECIMATE_CANCEL; };
  const umbel_lod_mesh given = c_mesh(mesh);
  umbel_lod* lod = nullptr;
  EXPECT_EQ(umbel_lod_build(&given, &config, nullptr, &lod), UMBEL_ERROR_CANCELLED);
  EXPECT_EQ(lod, nullptr);
}

}  // namespace
}  // namespace umbel
