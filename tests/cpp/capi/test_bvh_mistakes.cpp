// Every mistake of a caller gives its result and a sentence, and hands out nothing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <stdexcept>

#include "capi/bvh_call.hpp"
#include "capi/newer.hpp"

namespace umbel {
namespace {

using namespace bvh_call;

/// What a failing call must replace by NULL.
// NOLINTNEXTLINE(performance-no-int-to-ptr): an address that nothing has
umbel_bvh* const kUnset = reinterpret_cast<umbel_bvh*>(uintptr_t{16});

struct GoodCall : Call {
  GoodCall() {
    EXPECT_EQ(build(), UMBEL_OK) << umbel_last_error();
    rays = random_rays(4, 1);
  }
  std::vector<Ray> rays;
  umbel_hit hits[8] = {};
  uint8_t flags[4] = {};
  uint32_t counts[4] = {};
  float distances[4] = {};
  umbel_closest_point closest[4] = {};
  umbel_vec3 points[4] = {};
};

// Over 60 lines: a list of mistakes.
TEST(CapiBvhMistakes, null_is_refused_by_name) {
  GoodCall c;
  umbel_bvh* const bvh = c.bvh.get();
  const umbel_ray* const rays = as_c(c.rays);
  const umbel_aabb box{};
  const umbel_sphere sphere{};
  const umbel_plane planes[6] = {};
  size_t count = 0;
  umbel_bvh* made = nullptr;
  Tree tree(c.mesh.triangle_count);
  umbel_bvh2_capacity capacity;
  umbel_bvh2_capacity_init(&capacity);
  umbel_bvh_statistics statistics;
  umbel_bvh_statistics_init(&statistics);
  const std::pair<std::function<umbel_result()>, const char*> calls[] = {
      {[&] { return umbel_bvh_config_preset(nullptr, "fast"); }, "config"},
      {[&] { return umbel_bvh_config_preset(&c.config, nullptr); }, "name"},
      {[&] { return umbel_bvh_config_builder(nullptr, "lbvh"); }, "config"},
      {[&] { return umbel_bvh_config_builder(&c.config, nullptr); }, "name"},
      {[&] { return umbel_bvh_build(nullptr, nullptr, nullptr, &made); }, "mesh"},
      {[&] { return umbel_bvh_build(&c.mesh, nullptr, nullptr, nullptr); }, "bvh"},
      {[&] { return umbel_bvh_from_bvh2(nullptr, &c.mesh, nullptr, nullptr, &made); }, "tree"},
      {[&] { return umbel_bvh_from_bvh2(&tree.tree, nullptr, nullptr, nullptr, &made); }, "mesh"},
      {[&] { return umbel_bvh_intersect(nullptr, rays, 4, nullptr, c.hits); }, "bvh"},
      {[&] { return umbel_bvh_intersect(bvh, nullptr, 4, nullptr, c.hits); }, "rays"},
      {[&] { return umbel_bvh_intersect(bvh, rays, 4, nullptr, nullptr); }, "hits"},
      {[&] { return umbel_bvh_occluded(nullptr, rays, 4, nullptr, c.flags); }, "bvh"},
      {[&] { return umbel_bvh_occluded(bvh, rays, 4, nullptr, nullptr); }, "results"},
      {[&] { return umbel_bvh_all_hits(nullptr, rays, 4, nullptr, 2, c.hits, c.counts); }, "bvh"},
      {[&] { return umbel_bvh_all_hits(bvh, rays, 4, nullptr, 2, nullptr, c.counts); }, "hits"},
      {[&] { return umbel_bvh_all_hits(bvh, rays, 4, nullptr, 2, c.hits, nullptr); }, "hit_counts"},
      {[&] { return umbel_bvh_closest_point(nullptr, c.points, 4, 1, 0, c.closest); }, "bvh"},
      {[&] { return umbel_bvh_closest_point(bvh, nullptr, 4, 1, 0, c.closest); }, "points"},
      {[&] { return umbel_bvh_closest_point(bvh, c.points, 4, 1, 0, nullptr); }, "results"},
      {[&] { return umbel_bvh_contains(nullptr, c.points, 4, 0, c.flags); }, "bvh"},
      {[&] { return umbel_bvh_contains(bvh, c.points, 4, 0, nullptr); }, "results"},
      {[&] { return umbel_bvh_signed_distance(nullptr, c.points, 4, 0, c.distances); }, "bvh"},
      {[&] { return umbel_bvh_signed_distance(bvh, c.points, 4, 0, nullptr); }, "results"},
      {[&] { return umbel_bvh_overlaps_box(nullptr, &box, nullptr, 0, &count); }, "bvh"},
      {[&] { return umbel_bvh_overlaps_box(bvh, nullptr, nullptr, 0, &count); }, "box"},
      {[&] { return umbel_bvh_overlaps_box(bvh, &box, nullptr, 0, nullptr); }, "count"},
      {[&] { return umbel_bvh_overlaps_box(bvh, &box, nullptr, 3, &count); }, "triangles"},
      {[&] { return umbel_bvh_overlaps_sphere(nullptr, &sphere, nullptr, 0, &count); }, "bvh"},
      {[&] { return umbel_bvh_overlaps_sphere(bvh, nullptr, nullptr, 0, &count); }, "sphere"},
      {[&] { return umbel_bvh_overlaps_frustum(nullptr, planes, nullptr, 0, &count); }, "bvh"},
      {[&] { return umbel_bvh_overlaps_frustum(bvh, nullptr, nullptr, 0, &count); }, "planes"},
      {[&] { return umbel_bvh_refit(nullptr, &c.mesh, nullptr, nullptr); }, "bvh"},
      {[&] { return umbel_bvh_refit(bvh, nullptr, nullptr, nullptr); }, "mesh"},
      {[&] { return umbel_bvh_save(nullptr, "x.umbvh"); }, "bvh"},
      {[&] { return umbel_bvh_save(bvh, nullptr); }, "path"},
      {[&] { return umbel_bvh_load(nullptr, &made); }, "path"},
      {[&] { return umbel_bvh_load("x.umbvh", nullptr); }, "bvh"},
      {[&] { return umbel_bvh_get_statistics(nullptr, &statistics); }, "bvh"},
      {[&] { return umbel_bvh_get_statistics(bvh, nullptr); }, "statistics"},
      {[&] { return umbel_bvh2_requirements(5, nullptr, nullptr); }, "capacity"},
      {[&] { return umbel_bvh2_build(nullptr, 5, nullptr, nullptr, &tree.tree); }, "boxes"},
      {[&] { return umbel_bvh2_build(&box, 1, nullptr, nullptr, nullptr); }, "tree"},
      {[&] { return umbel_bvh2_build_triangles(nullptr, nullptr, nullptr, &tree.tree); }, "mesh"},
      {[&] { return umbel_bvh2_get_statistics(nullptr, nullptr, nullptr); }, "tree"}};
  for (const auto& [call, name] : calls) {
    made = kUnset;
    expect_failure(call(), UMBEL_ERROR_INVALID_ARGUMENT, name);
    EXPECT_TRUE(made == nullptr || made == kUnset) << name;
    EXPECT_NE(std::string(umbel_last_error()).find("NULL"), std::string::npos)
        << umbel_last_error();
  }
  umbel_bvh_free(nullptr);
  umbel_bvh_config_init_sized(nullptr, 0);
}

TEST(CapiBvhMistakes, structs_that_were_not_initialised_are_refused) {
  GoodCall c;
  Tree tree(c.mesh.triangle_count);
  umbel_bvh* made = nullptr;
  umbel_ray_options options{};
  umbel_bvh_statistics statistics{};
  umbel_refit_report report{};
  umbel_bvh2_capacity capacity{};
  umbel_bvh2_statistics statistics2{};
  umbel_bvh2 raw{};
  umbel_bvh_config config = c.config;
  config.struct_size = 4;
  umbel_bvh_mesh mesh = c.mesh;
  mesh.struct_size = 1 << 20;
  umbel_build_options build_options{};
  const std::pair<std::function<umbel_result()>, const char*> calls[] = {
      {[&] { return umbel_bvh_build(&mesh, nullptr, nullptr, &made); }, "mesh->struct_size"},
      {[&] { return umbel_bvh_build(&c.mesh, &config, nullptr, &made); }, "config->struct_size"},
      {[&] { return umbel_bvh_build(&c.mesh, nullptr, &build_options, &made); },
       "options->struct_size"},
      {[&] { return umbel_bvh_config_preset(&config, "fast"); }, "config->struct_size"},
      {[&] { return umbel_bvh_intersect(c.bvh.get(), as_c(c.rays), 4, &options, c.hits); },
       "options->struct_size"},
      {[&] { return umbel_bvh_get_statistics(c.bvh.get(), &statistics); },
       "statistics->struct_size"},
      {[&] { return umbel_bvh_refit(c.bvh.get(), &c.mesh, nullptr, &report); },
       "report->struct_size"},
      {[&] { return umbel_bvh2_requirements(1, nullptr, &capacity); }, "capacity->struct_size"},
      {[&] { return umbel_bvh2_build_triangles(&c.mesh, nullptr, nullptr, &raw); },
       "tree->struct_size"},
      {[&] { return umbel_bvh2_get_statistics(&tree.tree, nullptr, &statistics2); },
       "statistics->struct_size"}};
  for (const auto& [call, name] : calls) expect_failure(call(), UMBEL_ERROR_INVALID_ARGUMENT, name);
}

TEST(CapiBvhMistakes, newer_callers_are_served_while_what_is_new_is_zero) {
  auto config = testing::newer(umbel_bvh_config_init_sized);
  EXPECT_EQ(config.known.width, 8u);
  Call call;
  umbel_bvh* made = nullptr;
  ASSERT_EQ(umbel_bvh_build(&call.mesh, &config.known, nullptr, &made), UMBEL_OK)
      << umbel_last_error();
  umbel_bvh_free(made);
  ASSERT_EQ(umbel_bvh_config_preset(&config.known, "fast"), UMBEL_OK);
  EXPECT_EQ(config.known.struct_size, sizeof config);
  config.fresh[1] = 1;
  expect_failure(umbel_bvh_build(&call.mesh, &config.known, nullptr, &made),
                 UMBEL_ERROR_UNSUPPORTED, "config");
  EXPECT_EQ(made, nullptr);

  struct NewerStatistics {
    umbel_bvh_statistics known;
    uint32_t fresh[2];
  };
  NewerStatistics found{};
  found.known.struct_size = sizeof found;
  found.fresh[1] = 17;
  ASSERT_EQ(call.build(), UMBEL_OK);
  ASSERT_EQ(umbel_bvh_get_statistics(call.bvh.get(), &found.known), UMBEL_OK);
  EXPECT_EQ(found.known.struct_size, sizeof found);
  EXPECT_EQ(found.known.triangle_count, call.source.triangles.size());
  EXPECT_EQ(found.fresh[1], 17u);
}

TEST(CapiBvhMistakes, names_that_there_are_not_list_those_that_there_are) {
  umbel_bvh_config config;
  umbel_bvh_config_init(&config);
  const umbel_bvh_config before = config;
  const std::pair<const char*, const char*> names[] = {{"quick", "lbvh"},
                                                       {"", "lbvh"},
                                                       {"kmeans-q9", "q1"},
                                                       {"aac-", "fast"},
                                                       {"sweep-q1", "kmeans"}};
  for (const auto& [name, listed] : names)
    expect_failure(umbel_bvh_config_builder(&config, name), UMBEL_ERROR_INVALID_ARGUMENT, listed);
  expect_failure(umbel_bvh_config_preset(&config, "kmeans"), UMBEL_ERROR_INVALID_ARGUMENT,
                 "fast, quality, best");
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): every byte must be as before
  EXPECT_EQ(std::memcmp(&config, &before, sizeof config), 0);
}

TEST(CapiBvhMistakes, meshes_that_no_tree_could_hold_are_refused) {
  const auto expect_refused = [](const std::function<void(Call&)>& spoil, umbel_result expected,
                                 const char* named) {
    Call call;
    spoil(call);
    expect_failure(call.build(), expected, named);
    EXPECT_EQ(call.bvh, nullptr);
    Tree tree(1);
    expect_failure(umbel_bvh2_build_triangles(&call.mesh, &call.config, nullptr, &tree.tree),
                   expected, named);
    EXPECT_EQ(tree.tree.node_count, 0u);
    tree.expect_untouched();
  };
  expect_refused([](Call& c) { c.mesh.positions = nullptr; }, UMBEL_ERROR_INVALID_ARGUMENT,
                 "mesh->positions");
  expect_refused([](Call& c) { c.mesh.triangles = nullptr; }, UMBEL_ERROR_INVALID_ARGUMENT,
                 "mesh->triangles");
  expect_refused([](Call& c) { c.mesh.triangle_count = SIZE_MAX / 8; },
                 UMBEL_ERROR_INVALID_ARGUMENT, "mesh->triangle_count");
  expect_refused([](Call& c) { c.mesh.position_count = size_t{1} << 32; },
                 UMBEL_ERROR_INVALID_ARGUMENT, "mesh->position_count");
  expect_refused([](Call& c) { c.source.triangles[7][2] = 99999; }, UMBEL_ERROR_INVALID_MESH,
                 "triangle 7");
  expect_refused([](Call& c) { c.mesh.position_count = 0; }, UMBEL_ERROR_INVALID_MESH,
                 "triangle 0");
  expect_refused([](Call& c) { c.source.positions[c.source.triangles[0][1]].y = kNan; },
                 UMBEL_ERROR_INVALID_MESH, "triangle 0, corner 1");
  expect_refused([](Call& c) { c.source.positions[c.source.triangles[0][0]].y = kInfinity; },
                 UMBEL_ERROR_INVALID_MESH, "triangle 0, corner 0");
  // Dropping helps against the last two, not against indices.
  Call call;
  call.source.positions[5].x = kNan;
  call.config.drop_invalid = 1;
  EXPECT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
  call.source.triangles[7][2] = 99999;
  expect_failure(call.build(), UMBEL_ERROR_INVALID_MESH, "triangle 7");
}

TEST(CapiBvhMistakes, boxes_that_are_none_are_refused) {
  Tree tree(3);
  umbel_aabb boxes[3] = {{{0, 0, 0}, {1, 1, 1}}, {{0, 0, 0}, {1, 1, 1}}, {{0, 0, 0}, {1, 1, 1}}};
  boxes[1].max.y = kNan;
  expect_failure(umbel_bvh2_build(boxes, 3, nullptr, nullptr, &tree.tree), UMBEL_ERROR_INVALID_MESH,
                 "box 1");
  boxes[1].max.y = -1;
  expect_failure(umbel_bvh2_build(boxes, 3, nullptr, nullptr, &tree.tree), UMBEL_ERROR_INVALID_MESH,
                 "box 1");
  boxes[1].max.y = 1;
  umbel_bvh_config config;
  umbel_bvh_config_init(&config);
  config.builder = UMBEL_BVH_SPATIAL;
  expect_failure(umbel_bvh2_build(boxes, 3, &config, nullptr, &tree.tree),
                 UMBEL_ERROR_INVALID_ARGUMENT, "triangles");
  tree.expect_untouched();
}

TEST(CapiBvhMistakes, sizes_that_cannot_be_are_refused) {
  GoodCall c;
  umbel_bvh2_capacity capacity;
  umbel_bvh2_capacity_init(&capacity);
  expect_failure(umbel_bvh2_requirements(SIZE_MAX, nullptr, &capacity),
                 UMBEL_ERROR_INVALID_ARGUMENT, "primitive_count");
  expect_failure(
      umbel_bvh_all_hits(c.bvh.get(), as_c(c.rays), 4, nullptr, SIZE_MAX / 8, c.hits, c.counts),
      UMBEL_ERROR_INVALID_ARGUMENT, "hits_per_ray");
  for (const float wrong : {-1.0f, kNan})
    expect_failure(umbel_bvh_closest_point(c.bvh.get(), c.points, 4, wrong, 0, c.closest),
                   UMBEL_ERROR_INVALID_ARGUMENT, "max_distance");
}

TEST(CapiBvhMistakes, trees_that_are_none_are_refused) {
  Call call;
  const auto expect_refused = [&](const std::function<void(Tree&)>& spoil, umbel_result expected,
                                  const char* named) {
    Tree tree(call.mesh.triangle_count);
    ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, nullptr, nullptr, &tree.tree), UMBEL_OK);
    spoil(tree);
    umbel_bvh* made = kUnset;
    expect_failure(umbel_bvh_from_bvh2(&tree.tree, &call.mesh, nullptr, nullptr, &made), expected,
                   named);
    EXPECT_EQ(made, nullptr);
  };
  expect_refused([](Tree& t) { t.tree.nodes = nullptr; }, UMBEL_ERROR_INVALID_ARGUMENT,
                 "tree->nodes");
  expect_refused([](Tree& t) { t.tree.primitives = nullptr; }, UMBEL_ERROR_INVALID_ARGUMENT,
                 "tree->primitives");
  expect_refused([](Tree& t) { t.tree.node_count = size_t{1} << 32; }, UMBEL_ERROR_INVALID_ARGUMENT,
                 "tree->node_count");
  expect_refused([](Tree& t) { t.tree.primitive_count = SIZE_MAX; }, UMBEL_ERROR_INVALID_ARGUMENT,
                 "tree->primitive_count");
  expect_refused([](Tree& t) { t.nodes[0].first = 0; }, UMBEL_ERROR_CORRUPT, "node 0");
  expect_refused([](Tree& t) { t.nodes[0].first = kNone; }, UMBEL_ERROR_CORRUPT, "node 0");
  expect_refused([](Tree& t) { t.nodes[1].max.x = kNan; }, UMBEL_ERROR_CORRUPT, "node");
  expect_refused([](Tree& t) { t.tree.primitive_count -= 1; }, UMBEL_ERROR_CORRUPT, "node");
  expect_refused([](Tree& t) { t.primitives[3] = kNone; }, UMBEL_ERROR_CORRUPT, "primitive");
  umbel_bvh2_statistics found;
  umbel_bvh2_statistics_init(&found);
  Tree tree(call.mesh.triangle_count);
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, nullptr, nullptr, &tree.tree), UMBEL_OK);
  tree.nodes[0].first = 0;
  expect_failure(umbel_bvh2_get_statistics(&tree.tree, nullptr, &found), UMBEL_ERROR_CORRUPT,
                 "node 0");
}

// A file with such costs would be refused when it is loaded.
TEST(CapiBvhMistakes, costs_that_are_none_are_refused_for_trees_that_are_there) {
  Call call;
  Tree tree(call.mesh.triangle_count);
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, nullptr, nullptr, &tree.tree), UMBEL_OK);
  const auto invalid = UMBEL_ERROR_INVALID_ARGUMENT;
  umbel_bvh2_statistics found;
  umbel_bvh2_statistics_init(&found);
  for (const float wrong : {0.0f, -1.0f, kNan, HUGE_VALF})
    for (float* const cost : {&call.config.traversal_cost, &call.config.intersection_cost}) {
      umbel_bvh_config_init(&call.config);
      *cost = wrong;
      umbel_bvh* made = kUnset;
      expect_failure(umbel_bvh_from_bvh2(&tree.tree, &call.mesh, &call.config, nullptr, &made),
                     invalid, "cost.");
      EXPECT_EQ(made, nullptr);
      expect_failure(umbel_bvh2_get_statistics(&tree.tree, &call.config, &found), invalid, "cost.");
      EXPECT_EQ(found.nodes, 0u);
    }
}

TEST(CapiBvhMistakes, a_tree_of_another_mesh_is_refused) {
  Call call;
  Tree tree(call.mesh.triangle_count);
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, nullptr, nullptr, &tree.tree), UMBEL_OK);
  umbel_bvh* made = nullptr;
  Call smaller(shapes::blob(2, 1));
  EXPECT_NE(umbel_bvh_from_bvh2(&tree.tree, &smaller.mesh, nullptr, nullptr, &made), UMBEL_OK);
  call.source.triangles[9][0] = 99999;
  expect_failure(umbel_bvh_from_bvh2(&tree.tree, &call.mesh, nullptr, nullptr, &made),
                 UMBEL_ERROR_INVALID_MESH, "triangle 9");
  call.source.triangles[9][0] = call.source.triangles[9][1];
  call.source.positions[call.source.triangles[9][1]].z = kNan;
  expect_failure(umbel_bvh_from_bvh2(&tree.tree, &call.mesh, nullptr, nullptr, &made),
                 UMBEL_ERROR_INVALID_MESH, "finite");
  EXPECT_EQ(made, nullptr);
}

TEST(CapiBvhMistakes, trees_that_lack_dropped_triangles_are_whole) {
  Call call;
  call.source.positions[5].x = kNan;
  call.config.drop_invalid = 1;
  Tree tree(call.mesh.triangle_count);
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, &call.config, nullptr, &tree.tree), UMBEL_OK);
  EXPECT_LT(tree.tree.primitive_count, call.mesh.triangle_count);
  umbel_bvh2_statistics found;
  umbel_bvh2_statistics_init(&found);
  EXPECT_EQ(umbel_bvh2_get_statistics(&tree.tree, nullptr, &found), UMBEL_OK) << umbel_last_error();
  umbel_bvh* made = nullptr;
  EXPECT_EQ(umbel_bvh_from_bvh2(&tree.tree, &call.mesh, &call.config, nullptr, &made), UMBEL_OK)
      << umbel_last_error();
  umbel_bvh_free(made);
  // Who did not ask for that gets no tree with holes.
  call.config.drop_invalid = 0;
  expect_failure(umbel_bvh_from_bvh2(&tree.tree, &call.mesh, &call.config, nullptr, &made),
                 UMBEL_ERROR_CORRUPT, "is not in the tree");
}

TEST(CapiBvhMistakes, refit_takes_the_triangles_of_the_build) {
  GoodCall c;
  std::vector<umbel_hit> before(4), after(4);
  umbel_bvh_intersect(c.bvh.get(), as_c(c.rays), 4, nullptr, before.data());
  Call other(shapes::blob(2, 1));
  expect_failure(umbel_bvh_refit(c.bvh.get(), &other.mesh, nullptr, nullptr),
                 UMBEL_ERROR_INVALID_ARGUMENT, "refit");
  c.source.positions[c.source.triangles[20][0]].x = kNan;
  expect_failure(umbel_bvh_refit(c.bvh.get(), &c.mesh, nullptr, nullptr), UMBEL_ERROR_INVALID_MESH,
                 "not finite");
  umbel_bvh_intersect(c.bvh.get(), as_c(c.rays), 4, nullptr, after.data());
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): every byte must be as before
  EXPECT_EQ(std::memcmp(before.data(), after.data(), 4 * sizeof before[0]), 0);
}

// ---- progress -----------------------------------------------------------------------------------

struct Heard {
  std::vector<float> fractions;
  int most = 1 << 30;
};

int listen(float fraction, const char* stage, void* user) {
  auto* heard = static_cast<Heard*>(user);
  EXPECT_STRNE(stage, "");
  heard->fractions.push_back(fraction);
  return int(heard->fractions.size()) < heard->most;
}

TEST(CapiBvhMistakes, progress_rises_to_one_and_may_cancel_any_builder) {
  for (const bvh::Builder builder : bvh::builders()) {
    Call call(shapes::blob(4, 1));
    call.config.builder = uint32_t(builder);
    Heard heard;
    call.options.progress = listen;
    call.options.progress_user = &heard;
    ASSERT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
    const std::string name(bvh::name(builder));
    ASSERT_FALSE(heard.fractions.empty()) << name;
    EXPECT_TRUE(std::is_sorted(heard.fractions.begin(), heard.fractions.end())) << name;
    EXPECT_EQ(heard.fractions.back(), 1.0f) << name;
    for (const int most : {1, 2}) {
      if (int(heard.fractions.size()) < most) continue;
      Heard cancelling;
      cancelling.most = most;
      call.options.progress_user = &cancelling;
      expect_failure(call.build(), UMBEL_ERROR_CANCELLED, "cancelled");
      EXPECT_EQ(call.bvh, nullptr) << name;
      Tree tree(1);
      cancelling.fractions.clear();
      expect_failure(
          umbel_bvh2_build_triangles(&call.mesh, &call.config, &call.options, &tree.tree),
          UMBEL_ERROR_CANCELLED, "cancelled");
      EXPECT_EQ(tree.tree.node_count, 0u);
    }
  }
}

TEST(CapiBvhMistakes, a_cancelled_refit_leaves_the_tree_as_it_was) {
  GoodCall c;
  std::vector<umbel_hit> before(4), after(4);
  umbel_bvh_intersect(c.bvh.get(), as_c(c.rays), 4, nullptr, before.data());
  for (Vec3& p : c.source.positions) p.x += 1;
  Heard heard;
  heard.most = 1;
  c.options.progress = listen;
  c.options.progress_user = &heard;
  expect_failure(umbel_bvh_refit(c.bvh.get(), &c.mesh, &c.options, nullptr), UMBEL_ERROR_CANCELLED,
                 "cancelled");
  umbel_bvh_intersect(c.bvh.get(), as_c(c.rays), 4, nullptr, after.data());
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): every byte must be as before
  EXPECT_EQ(std::memcmp(before.data(), after.data(), 4 * sizeof before[0]), 0);
}

int throwing(float, const char*, void*) { throw std::logic_error("thrown by the callback"); }

TEST(CapiBvhMistakes, no_exception_crosses_the_border) {
  Call call;
  call.options.progress = throwing;
  expect_failure(call.build(), UMBEL_ERROR_INTERNAL, "thrown by the callback");
}

// ---- files --------------------------------------------------------------------------------------

TEST(CapiBvhMistakes, files_that_are_none_are_refused) {
  const Folder folder;
  GoodCall c;
  umbel_bvh* made = kUnset;
  expect_failure(umbel_bvh_load(folder.file("missing.umbvh").c_str(), &made), UMBEL_ERROR_IO,
                 "missing.umbvh");
  EXPECT_EQ(made, nullptr);
  expect_failure(umbel_bvh_save(c.bvh.get(), folder.file("no/folder.umbvh").c_str()),
                 UMBEL_ERROR_IO, "folder.umbvh");
  EXPECT_TRUE(folder.is_empty());
  const std::string path = folder.file("mesh.umbvh");
  ASSERT_EQ(umbel_bvh_save(c.bvh.get(), path.c_str()), UMBEL_OK);
  std::ifstream in(path, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), {});
  const auto expect_corrupt = [&](const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
    expect_failure(umbel_bvh_load(path.c_str(), &made), UMBEL_ERROR_CORRUPT, "mesh.umbvh");
    EXPECT_EQ(made, nullptr);
  };
  expect_corrupt("");
  expect_corrupt(whole.substr(0, whole.size() - 1));
  expect_corrupt(whole + '\0');
  std::string flipped = whole;
  flipped[whole.size() / 2] ^= 1;
  expect_corrupt(flipped);
}

}  // namespace
}  // namespace umbel
