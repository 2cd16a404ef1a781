// Kd-trees from C, beside the C++ interface, and a caller's mistakes.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>

#include "capi/bvh_call.hpp"
#include "umbel/kdtree.hpp"
#include "umbel/umbel_kdtree.h"

namespace umbel {
namespace {

using namespace bvh_call;
using kdtree::KdTree;

struct FreeTree {
  void operator()(umbel_kdtree* tree) const { umbel_kdtree_free(tree); }
};

struct KdCall : Call {
  explicit KdCall(Mesh given = shapes::blob(3, 1)) : Call(std::move(given)) {
    umbel_kdtree_config_init(&how);
  }
  umbel_result build_tree() {
    umbel_kdtree* made = nullptr;
    const umbel_result result = umbel_kdtree_build(&mesh, &how, &options, &made);
    tree.reset(made);
    return result;
  }
  umbel_kdtree_config how;
  std::unique_ptr<umbel_kdtree, FreeTree> tree;
};

umbel_kdtree_statistics statistics_of(const umbel_kdtree* tree) {
  umbel_kdtree_statistics found;
  umbel_kdtree_statistics_init(&found);
  EXPECT_EQ(umbel_kdtree_get_statistics(tree, &found), UMBEL_OK) << umbel_last_error();
  return found;
}

TEST(CapiKdTree, defaults_are_those_of_cpp) {
  umbel_kdtree_config config;
  umbel_kdtree_config_init(&config);
  const kdtree::KdTreeConfig cpp;
  EXPECT_EQ(config.struct_size, sizeof config);
  EXPECT_EQ(config.builder, uint32_t{UMBEL_KDTREE_EXACT});
  EXPECT_EQ(config.traversal_cost, cpp.tree.cost.traversal);
  EXPECT_EQ(config.intersection_cost, cpp.tree.cost.intersection);
  EXPECT_EQ(config.empty_bonus, cpp.tree.empty_bonus);
  EXPECT_EQ(config.bad_refines, cpp.tree.bad_refines);
  EXPECT_EQ(config.max_references, cpp.tree.max_references);
  EXPECT_EQ(config.bins, cpp.tree.bins);
  EXPECT_EQ(config.traversal, uint32_t{UMBEL_KDTREE_STACK});
  struct {
    umbel_kdtree_config known;
    uint32_t fresh[4];
  } newer;
  umbel_kdtree_config_init_sized(&newer.known, sizeof newer);
  EXPECT_EQ(newer.known.struct_size, sizeof newer);
  EXPECT_EQ(newer.known.bins, cpp.tree.bins);
  umbel_kdtree_config_init_sized(nullptr, 0);
}

TEST(CapiKdTree, every_query_answers_as_cpp_does_by_every_builder_and_traversal) {
  const std::vector<Ray> rays = random_rays(300, 3);
  const size_t n = rays.size();
  std::vector<umbel_vec3> points;
  for (const Ray& ray : rays) points.push_back(vec(ray.origin));
  for (const uint32_t builder : {UMBEL_KDTREE_EXACT, UMBEL_KDTREE_BINNED})
    for (const uint32_t traversal :
         {UMBEL_KDTREE_STACK, UMBEL_KDTREE_ROPES, UMBEL_KDTREE_SHORT_STACK}) {
      KdCall call;
      call.how.builder = builder, call.how.traversal = traversal;
      ASSERT_EQ(call.build_tree(), UMBEL_OK) << umbel_last_error();
      kdtree::KdTreeConfig config;
      config.tree.builder = static_cast<kdtree::Builder>(builder);
      config.traversal = static_cast<kdtree::Traversal>(traversal);
      const KdTree truth = KdTree::build(call.source.view(), config);
      std::vector<umbel_hit> hits(n), all(4 * n);
      std::vector<uint8_t> shadows(n), inside(n);
      std::vector<uint32_t> counts(n);
      std::vector<umbel_closest_point> closest(n);
      std::vector<float> distances(n);
      const umbel_kdtree* tree = call.tree.get();
      ASSERT_EQ(umbel_kdtree_intersect(tree, as_c(rays), n, nullptr, hits.data()), UMBEL_OK);
      ASSERT_EQ(umbel_kdtree_occluded(tree, as_c(rays), n, nullptr, shadows.data()), UMBEL_OK);
      ASSERT_EQ(umbel_kdtree_all_hits(tree, as_c(rays), n, nullptr, 4, all.data(), counts.data()),
                UMBEL_OK);
      ASSERT_EQ(umbel_kdtree_closest_point(tree, points.data(), n, 0.5f, 1, closest.data()),
                UMBEL_OK);
      ASSERT_EQ(umbel_kdtree_contains(tree, points.data(), n, 1, inside.data()), UMBEL_OK);
      ASSERT_EQ(umbel_kdtree_signed_distance(tree, points.data(), n, 2, distances.data()),
                UMBEL_OK);
      size_t found = 0;
      for (size_t i = 0; i < n; ++i) {
        ASSERT_TRUE(same(hits[i], truth.intersect(rays[i]))) << i;
        ASSERT_EQ(shadows[i] != 0, truth.occluded(rays[i])) << i;
        Hit several[4];
        ASSERT_EQ(counts[i], truth.all_hits(rays[i], several)) << i;
        for (uint32_t k = 0; k < counts[i]; ++k) ASSERT_TRUE(same(all[4 * i + k], several[k]));
        ASSERT_EQ(closest[i].primitive, truth.closest_point(rays[i].origin, 0.5f).primitive);
        ASSERT_EQ(inside[i] != 0, truth.contains(rays[i].origin));
        ASSERT_EQ(distances[i], truth.signed_distance(rays[i].origin));
        found += hits[i].primitive != UMBEL_NONE;
      }
      EXPECT_GT(found, 20u);
      EXPECT_LT(found, n);
      const umbel_kdtree_statistics s = statistics_of(tree);
      const kdtree::Statistics expected = truth.statistics();
      EXPECT_EQ(s.nodes, expected.nodes);
      EXPECT_EQ(s.leaves, expected.leaves);
      EXPECT_EQ(s.empty_leaves, expected.empty_leaves);
      EXPECT_EQ(s.max_depth, expected.max_depth);
      EXPECT_EQ(s.references, expected.references);
      EXPECT_EQ(s.sah_cost, expected.sah_cost);
      EXPECT_EQ(s.tests, expected.tests);
      EXPECT_EQ(s.bytes, expected.bytes);
      EXPECT_EQ(s.triangle_count, call.source.triangles.size());
      EXPECT_EQ(s.bounds.max.y, truth.bounds().max.y);
    }
}

TEST(CapiKdTree, overlaps_are_asked_for_in_two_calls) {
  KdCall call;
  ASSERT_EQ(call.build_tree(), UMBEL_OK) << umbel_last_error();
  const KdTree truth = KdTree::build(call.source.view());
  const umbel_kdtree* tree = call.tree.get();
  const umbel_aabb box{{0, 0, 0}, {1, 1, 1}};
  const umbel_sphere sphere{{0.5f, 0.5f, 0.5f}, 0.5f};
  const umbel_plane planes[6] = {{{1, 0, 0}, 0},  {{0, 1, 0}, 0},  {{0, 0, 1}, 0},
                                 {{-1, 0, 0}, 1}, {{0, -1, 0}, 1}, {{0, 0, -1}, 1}};
  Frustum frustum;
  std::memcpy(&frustum, planes, sizeof planes);
  const auto check = [](const auto& ask, const std::vector<uint32_t>& expected) {
    ASSERT_GT(expected.size(), 5u);
    size_t count = 0;
    ASSERT_EQ(ask(nullptr, 0, &count), UMBEL_OK);
    ASSERT_EQ(count, expected.size());
    std::vector<uint32_t> found(count, kNone);
    expect_failure(ask(found.data(), count - 1, &count), UMBEL_ERROR_CAPACITY, "triangles");
    ASSERT_EQ(ask(found.data(), count, &count), UMBEL_OK);
    EXPECT_EQ(found, expected);
  };
  check([&](uint32_t* t, size_t n,
            size_t* c) { return umbel_kdtree_overlaps_box(tree, &box, t, n, c); },
        truth.overlaps(Aabb{{0, 0, 0}, {1, 1, 1}}));
  check([&](uint32_t* t, size_t n,
            size_t* c) { return umbel_kdtree_overlaps_sphere(tree, &sphere, t, n, c); },
        truth.overlaps(Sphere{{0.5f, 0.5f, 0.5f}, 0.5f}));
  check([&](uint32_t* t, size_t n,
            size_t* c) { return umbel_kdtree_overlaps_frustum(tree, planes, t, n, c); },
        truth.overlaps(frustum));
}

TEST(CapiKdTree, files_load_as_they_were_and_traversal_can_be_changed) {
  const Folder folder;
  KdCall call;
  ASSERT_EQ(call.build_tree(), UMBEL_OK);
  const std::string path = folder.file("mesh.umkd");
  ASSERT_EQ(umbel_kdtree_save(call.tree.get(), path.c_str()), UMBEL_OK) << umbel_last_error();
  umbel_kdtree* loaded = nullptr;
  ASSERT_EQ(umbel_kdtree_load(path.c_str(), UMBEL_KDTREE_ROPES, &loaded), UMBEL_OK)
      << umbel_last_error();
  const std::unique_ptr<umbel_kdtree, FreeTree> owned(loaded);
  EXPECT_GT(statistics_of(loaded).bytes, statistics_of(call.tree.get()).bytes);  // the ropes
  const std::vector<Ray> rays = random_rays(200, 9);
  std::vector<umbel_hit> a(rays.size()), b(rays.size());
  ASSERT_EQ(umbel_kdtree_intersect(call.tree.get(), as_c(rays), rays.size(), nullptr, a.data()),
            UMBEL_OK);
  for (const uint32_t traversal : {UMBEL_KDTREE_SHORT_STACK, UMBEL_KDTREE_STACK}) {
    ASSERT_EQ(umbel_kdtree_set_traversal(loaded, traversal), UMBEL_OK);
    ASSERT_EQ(umbel_kdtree_intersect(loaded, as_c(rays), rays.size(), nullptr, b.data()), UMBEL_OK);
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]), 0);
  }
}

TEST(CapiKdTree, empty_meshes_answer_every_query) {
  KdCall call{Mesh{}};
  ASSERT_EQ(call.build_tree(), UMBEL_OK) << umbel_last_error();
  const std::vector<Ray> rays = random_rays(2, 1);
  umbel_hit hits[2];
  ASSERT_EQ(umbel_kdtree_intersect(call.tree.get(), as_c(rays), 2, nullptr, hits), UMBEL_OK);
  EXPECT_EQ(hits[1].primitive, UMBEL_NONE);
  const umbel_kdtree_statistics s = statistics_of(call.tree.get());
  EXPECT_EQ(s.nodes, 0u);
  EXPECT_GT(s.bounds.min.x, s.bounds.max.x);
}

TEST(CapiKdTree, every_field_of_the_config_arrives) {
  const std::pair<void (*)(umbel_kdtree_config&), const char*> cases[] = {
      {[](umbel_kdtree_config& c) { c.builder = 2; }, "builder"},
      {[](umbel_kdtree_config& c) { c.traversal_cost = 0; }, "cost.traversal"},
      {[](umbel_kdtree_config& c) { c.intersection_cost = kNan; }, "cost.intersection"},
      {[](umbel_kdtree_config& c) { c.empty_bonus = 1; }, "empty_bonus"},
      {[](umbel_kdtree_config& c) { c.max_depth = 65; }, "max_depth"},
      {[](umbel_kdtree_config& c) { c.bad_refines = 65; }, "bad_refines"},
      {[](umbel_kdtree_config& c) { c.max_references = 0; }, "max_references"},
      {[](umbel_kdtree_config& c) { c.bins = 3; }, "bins"},
      {[](umbel_kdtree_config& c) { c.traversal = 3; }, "traversal"},
      {[](umbel_kdtree_config& c) { c.simd = 4; }, "simd is 4"},
      {[](umbel_kdtree_config& c) { c.struct_size = 4; }, "config->struct_size"}};
  for (const auto& [spoil, name] : cases) {
    KdCall call;
    spoil(call.how);
    expect_failure(call.build_tree(), UMBEL_ERROR_INVALID_ARGUMENT, name);
    EXPECT_EQ(call.tree, nullptr);
  }
  KdCall call;
  call.source.positions[0].x = kNan;
  expect_failure(call.build_tree(), UMBEL_ERROR_INVALID_MESH, "vertex");
  call.how.drop_invalid = 1;
  EXPECT_EQ(call.build_tree(), UMBEL_OK) << umbel_last_error();
  const uint64_t bytes = statistics_of(call.tree.get()).bytes;
  call.how.compact = 1;
  EXPECT_EQ(call.build_tree(), UMBEL_OK) << umbel_last_error();
  EXPECT_LT(statistics_of(call.tree.get()).bytes, bytes);
}

TEST(CapiKdTree, null_is_refused_by_name) {
  KdCall c;
  ASSERT_EQ(c.build_tree(), UMBEL_OK);
  umbel_kdtree* const tree = c.tree.get();
  const std::vector<Ray> rays = random_rays(1, 1);
  const umbel_vec3 point{};
  const umbel_aabb box{};
  const umbel_sphere sphere{};
  umbel_hit hit;
  uint8_t flag;
  uint32_t number;
  float distance;
  size_t count;
  umbel_closest_point closest;
  umbel_kdtree* made = nullptr;
  umbel_kdtree_statistics statistics;
  umbel_kdtree_statistics_init(&statistics);
  const std::pair<std::function<umbel_result()>, const char*> calls[] = {
      {[&] { return umbel_kdtree_build(nullptr, nullptr, nullptr, &made); }, "mesh"},
      {[&] { return umbel_kdtree_build(&c.mesh, nullptr, nullptr, nullptr); }, "tree"},
      {[&] { return umbel_kdtree_set_traversal(nullptr, 0); }, "tree"},
      {[&] { return umbel_kdtree_save(nullptr, "x.umkd"); }, "tree"},
      {[&] { return umbel_kdtree_save(tree, nullptr); }, "path"},
      {[&] { return umbel_kdtree_load(nullptr, 0, &made); }, "path"},
      {[&] { return umbel_kdtree_load("x.umkd", 0, nullptr); }, "tree"},
      {[&] { return umbel_kdtree_get_statistics(nullptr, &statistics); }, "tree"},
      {[&] { return umbel_kdtree_get_statistics(tree, nullptr); }, "statistics"},
      {[&] { return umbel_kdtree_intersect(nullptr, as_c(rays), 1, nullptr, &hit); }, "tree"},
      {[&] { return umbel_kdtree_intersect(tree, nullptr, 1, nullptr, &hit); }, "rays"},
      {[&] { return umbel_kdtree_occluded(tree, as_c(rays), 1, nullptr, nullptr); }, "results"},
      {[&] { return umbel_kdtree_all_hits(tree, as_c(rays), 1, nullptr, 1, nullptr, &number); },
       "hits"},
      {[&] { return umbel_kdtree_closest_point(tree, nullptr, 1, 1, 0, &closest); }, "points"},
      {[&] { return umbel_kdtree_contains(nullptr, &point, 1, 0, &flag); }, "tree"},
      {[&] { return umbel_kdtree_signed_distance(nullptr, &point, 1, 0, &distance); }, "tree"},
      {[&] { return umbel_kdtree_overlaps_box(nullptr, &box, nullptr, 0, &count); }, "tree"},
      {[&] { return umbel_kdtree_overlaps_sphere(tree, &sphere, nullptr, 0, nullptr); }, "count"},
      {[&] { return umbel_kdtree_overlaps_frustum(tree, nullptr, nullptr, 0, &count); }, "planes"}};
  for (const auto& [call, name] : calls) {
    expect_failure(call(), UMBEL_ERROR_INVALID_ARGUMENT, name);
    EXPECT_EQ(made, nullptr) << name;
  }
  expect_failure(umbel_kdtree_set_traversal(tree, 3), UMBEL_ERROR_INVALID_ARGUMENT, "traversal");
  const Folder folder;
  expect_failure(umbel_kdtree_load(folder.file("none.umkd").c_str(), 0, &made), UMBEL_ERROR_IO,
                 "none.umkd");
  umbel_kdtree_free(nullptr);
}

TEST(CapiKdTree, builds_report_progress_and_can_be_cancelled) {
  KdCall call(shapes::blob(5, 1));
  struct Seen {
    int calls = 0, most = 1 << 30;
    float last = 0;
    bool falls = false;
  } seen;
  call.options.threads = 1;
  call.options.progress_user = &seen;
  call.options.progress = [](float fraction, const char*, void* user) {
    Seen& s = *static_cast<Seen*>(user);
    s.falls |= fraction < s.last;
    s.last = fraction;
    return ++s.calls < s.most ? 1 : 0;
  };
  ASSERT_EQ(call.build_tree(), UMBEL_OK);
  EXPECT_EQ(seen.last, 1.0f);
  EXPECT_FALSE(seen.falls);
  EXPECT_GT(seen.calls, 5);
  seen = {0, seen.calls / 2, 0, false};
  expect_failure(call.build_tree(), UMBEL_ERROR_CANCELLED, "cancelled");
  EXPECT_EQ(call.tree, nullptr);
  EXPECT_EQ(seen.calls, seen.most);
}

}  // namespace
}  // namespace umbel
