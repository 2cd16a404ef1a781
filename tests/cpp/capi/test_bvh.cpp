// Hierarchies from C: what good calls give, beside the C++ interface.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <thread>

#include "capi/bvh_call.hpp"

namespace umbel {
namespace {

using namespace bvh_call;

Call built(Mesh mesh = shapes::blob(3, 1)) {
  Call call(std::move(mesh));
  EXPECT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
  EXPECT_NE(call.bvh, nullptr);
  return call;
}

TEST(CapiBvh, defaults_are_those_of_cpp) {
  umbel_bvh_config config;
  umbel_bvh_config_init(&config);
  const BvhConfig cpp;
  EXPECT_EQ(config.struct_size, sizeof config);
  EXPECT_EQ(config.builder, uint32_t(cpp.tree.builder));
  EXPECT_EQ(config.traversal_cost, cpp.tree.cost.traversal);
  EXPECT_EQ(config.intersection_cost, cpp.tree.cost.intersection);
  EXPECT_EQ(config.max_leaf_size, cpp.tree.max_leaf_size);
  EXPECT_EQ(config.max_depth, cpp.tree.max_depth);
  EXPECT_EQ(config.kmeans_clusters, cpp.tree.kmeans.clusters);
  EXPECT_EQ(config.aac_leaf_size, cpp.tree.aac.leaf_size);
  EXPECT_EQ(config.aac_epsilon, cpp.tree.aac.epsilon);
  EXPECT_EQ(config.width, cpp.width);
  EXPECT_EQ(config.compact, 0u);
  EXPECT_EQ(config.simd, uint32_t{UMBEL_SIMD_AUTO});
}

TEST(CapiBvh, presets_and_builders_set_the_tree_and_nothing_else) {
  umbel_bvh_config config;
  umbel_bvh_config_init(&config);
  config.width = 4, config.compact = 1, config.simd = UMBEL_SIMD_PORTABLE;
  ASSERT_EQ(umbel_bvh_config_preset(&config, "best"), UMBEL_OK);
  const bvh::Config best = bvh::preset("best");
  EXPECT_EQ(config.builder, uint32_t(best.builder));
  EXPECT_EQ(config.reinsertion_rounds, best.reinsertion_rounds);
  ASSERT_EQ(umbel_bvh_config_builder(&config, "kmeans"), UMBEL_OK);
  EXPECT_EQ(config.builder, uint32_t{UMBEL_BVH_KMEANS});
  EXPECT_EQ(config.reinsertion_rounds, 0u);
  ASSERT_EQ(umbel_bvh_config_builder(&config, "kmeans-q4"), UMBEL_OK);
  EXPECT_EQ(config.kmeans_clusters, 32u);
  EXPECT_EQ(config.kmeans_candidates, 20u);
  EXPECT_EQ(config.kmeans_iterations, 10u);
  ASSERT_EQ(umbel_bvh_config_builder(&config, "aac-hq"), UMBEL_OK);
  EXPECT_EQ(config.builder, uint32_t{UMBEL_BVH_AAC});
  EXPECT_EQ(config.aac_leaf_size, 20u);
  EXPECT_EQ(config.aac_epsilon, 0.1f);
  EXPECT_EQ(config.width, 4u);
  EXPECT_EQ(config.compact, 1u);
  EXPECT_EQ(config.simd, uint32_t{UMBEL_SIMD_PORTABLE});
}

TEST(CapiBvh, every_builder_is_reached_by_name_and_by_number) {
  for (const bvh::Builder builder : bvh::builders()) {
    const std::string name(bvh::name(builder));
    Call call;
    ASSERT_EQ(umbel_bvh_config_builder(&call.config, name.c_str()), UMBEL_OK);
    EXPECT_EQ(call.config.builder, uint32_t(builder)) << name;
    ASSERT_EQ(call.build(), UMBEL_OK) << name << ": " << umbel_last_error();
    BvhConfig config;
    config.tree = bvh::Config{};
    config.tree.builder = builder;
    const Bvh expected = Bvh::build(call.source.view(), config);
    umbel_bvh_statistics found;
    umbel_bvh_statistics_init(&found);
    ASSERT_EQ(umbel_bvh_get_statistics(call.bvh.get(), &found), UMBEL_OK);
    EXPECT_EQ(found.nodes, expected.statistics().nodes) << name;
    EXPECT_EQ(found.sah_cost, expected.statistics().sah_cost) << name;
  }
}

TEST(CapiBvh, every_field_of_the_config_arrives) {
  // Each is out of range, so that the builder's sentence tells that it was read.
  const std::pair<void (*)(umbel_bvh_config&), const char*> cases[] = {
      {[](umbel_bvh_config& c) { c.builder = 11; }, "builder"},
      {[](umbel_bvh_config& c) { c.traversal_cost = 0; }, "cost.traversal"},
      {[](umbel_bvh_config& c) { c.intersection_cost = kNan; }, "cost.intersection"},
      {[](umbel_bvh_config& c) { c.max_leaf_size = 0; }, "max_leaf_size"},
      {[](umbel_bvh_config& c) { c.max_depth = 256; }, "max_depth"},
      {[](umbel_bvh_config& c) { c.bins = 3; }, "bins"},
      {[](umbel_bvh_config& c) { c.spatial_budget = -1; }, "spatial_budget"},
      {[](umbel_bvh_config& c) { c.spatial_overlap = 2; }, "spatial_overlap"},
      {[](umbel_bvh_config& c) { c.morton_bits = 31; }, "morton_bits"},
      {[](umbel_bvh_config& c) { c.hlbvh_bits = 31; }, "hlbvh_bits"},
      {[](umbel_bvh_config& c) { c.ploc_radius = 129; }, "ploc_radius"},
      {[](umbel_bvh_config& c) { c.treelet_size = 16; }, "treelet_size"},
      {[](umbel_bvh_config& c) { c.treelet_rounds = 0; }, "treelet_rounds"},
      {[](umbel_bvh_config& c) { c.reinsertion_rounds = 65; }, "reinsertion_rounds"},
      {[](umbel_bvh_config& c) { c.kmeans_clusters = 1; }, "kmeans.clusters"},
      {[](umbel_bvh_config& c) { c.kmeans_candidates = 0; }, "kmeans.candidates"},
      {[](umbel_bvh_config& c) { c.kmeans_iterations = 101; }, "kmeans.iterations"},
      {[](umbel_bvh_config& c) { c.aac_leaf_size = 1; }, "aac.leaf_size"},
      {[](umbel_bvh_config& c) { c.aac_epsilon = 0.6f; }, "aac.epsilon"},
      {[](umbel_bvh_config& c) { c.width = 3; }, "width"},
      {[](umbel_bvh_config& c) { c.simd = 4; }, "simd is 4"}};
  for (const auto& [spoil, name] : cases) {
    Call call;
    spoil(call.config);
    expect_failure(call.build(), UMBEL_ERROR_INVALID_ARGUMENT, name);
    EXPECT_EQ(call.bvh, nullptr) << name;
  }
  // Those that cannot be wrong.
  Call call;
  call.config.builder = UMBEL_BVH_KMEANS;
  Tree euclidean(call.mesh.triangle_count), manhattan(call.mesh.triangle_count);
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, &call.config, nullptr, &euclidean.tree),
            UMBEL_OK);
  call.config.kmeans_manhattan = 1;
  ASSERT_EQ(umbel_bvh2_build_triangles(&call.mesh, &call.config, nullptr, &manhattan.tree),
            UMBEL_OK);
  EXPECT_NE(euclidean.primitives, manhattan.primitives);
}

TEST(CapiBvh, rays_get_what_they_get_from_cpp) {
  for (const uint32_t width : {2u, 4u, 8u})
    for (const uint32_t compact : {0u, 1u}) {
      Call call;
      call.config.width = width;
      call.config.compact = compact;
      ASSERT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
      const Bvh expected = Bvh::build(call.source.view());
      const std::vector<Ray> rays = random_rays(500, width);
      std::vector<umbel_hit> hits(rays.size());
      std::vector<uint8_t> occluded(rays.size(), 7);
      ASSERT_EQ(umbel_bvh_intersect(call.bvh.get(), as_c(rays), rays.size(), nullptr, hits.data()),
                UMBEL_OK);
      ASSERT_EQ(
          umbel_bvh_occluded(call.bvh.get(), as_c(rays), rays.size(), nullptr, occluded.data()),
          UMBEL_OK);
      size_t found = 0;
      for (size_t i = 0; i < rays.size(); ++i) {
        const Hit hit = expected.intersect(rays[i]);
        ASSERT_TRUE(same(hits[i], hit)) << i;
        ASSERT_EQ(occluded[i], hit.hit() ? 1 : 0) << i;
        found += hit.hit();
      }
      EXPECT_GT(found, 50u);
      EXPECT_LT(found, rays.size());
    }
}

TEST(CapiBvh, all_hits_fill_their_rows_and_leave_the_rest) {
  const Call call = built(large_triangles(200));
  const Bvh expected = Bvh::build(call.source.view());
  const std::vector<Ray> rays = random_rays(300, 4);
  constexpr size_t kEach = 3;
  const umbel_hit untouched{-1, 77, -1, -1};
  std::vector<umbel_hit> hits(kEach * rays.size(), untouched);
  std::vector<uint32_t> counts(rays.size(), 99);
  ASSERT_EQ(umbel_bvh_all_hits(call.bvh.get(), as_c(rays), rays.size(), nullptr, kEach, hits.data(),
                               counts.data()),
            UMBEL_OK);
  size_t full = 0, part = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    std::vector<Hit> row(kEach);
    ASSERT_EQ(counts[i], expected.all_hits(rays[i], row));
    for (size_t k = 0; k < kEach; ++k)
      if (k < counts[i])
        ASSERT_TRUE(same(hits[kEach * i + k], row[k]));
      else
        ASSERT_EQ(hits[kEach * i + k].primitive, 77u);
    full += counts[i] == kEach;
    part += counts[i] > 0 && counts[i] < kEach;
  }
  EXPECT_GT(full, 0u);
  EXPECT_GT(part, 0u);
  // Room for none asks nothing.
  ASSERT_EQ(umbel_bvh_all_hits(call.bvh.get(), as_c(rays), rays.size(), nullptr, 0, nullptr,
                               counts.data()),
            UMBEL_OK);
  EXPECT_TRUE(std::all_of(counts.begin(), counts.end(), [](uint32_t n) { return n == 0; }));
}

TEST(CapiBvh, ray_options_and_masks_select_triangles) {
  Call call(shapes::sphere(2));
  std::vector<uint32_t> masks(call.source.triangles.size());
  for (size_t i = 0; i < masks.size(); ++i) masks[i] = 1u << (i % 3);
  call.mesh.masks = masks.data();
  ASSERT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
  std::vector<Ray> rays = random_rays(400, 5);
  for (Ray& ray : rays) ray.direction = {-ray.origin.x, -ray.origin.y, -ray.origin.z};
  std::vector<umbel_hit> all(rays.size()), some(rays.size()), front(rays.size());
  umbel_ray_options options;
  umbel_ray_options_init(&options);
  EXPECT_EQ(options.mask, 0xffffffffu);
  const auto trace = [&](std::vector<umbel_hit>& hits) {
    ASSERT_EQ(umbel_bvh_intersect(call.bvh.get(), as_c(rays), rays.size(), &options, hits.data()),
              UMBEL_OK)
        << umbel_last_error();
  };
  trace(all);
  options.mask = 2;
  options.threads = 1;
  trace(some);
  options.mask = 0xffffffffu;
  options.cull_back_faces = 1;
  trace(front);
  for (size_t i = 0; i < rays.size(); ++i) {
    if (some[i].primitive != UMBEL_NONE) {
      EXPECT_EQ(masks[some[i].primitive], 2u);
    }
    if (all[i].primitive != UMBEL_NONE && masks[all[i].primitive] == 2)
      EXPECT_EQ(some[i].primitive, all[i].primitive);
    const Vec3& o = rays[i].origin;
    const float length = std::sqrt(o.x * o.x + o.y * o.y + o.z * o.z);
    // The sphere has flat sides.
    if (std::abs(length - 1) > 0.1f) EXPECT_EQ(front[i].primitive != UMBEL_NONE, length > 1) << i;
  }
  std::vector<uint8_t> none(rays.size(), 1);
  options.mask = 8;
  ASSERT_EQ(umbel_bvh_occluded(call.bvh.get(), as_c(rays), rays.size(), &options, none.data()),
            UMBEL_OK);
  EXPECT_EQ(std::count(none.begin(), none.end(), 1), 0);
}

TEST(CapiBvh, points_get_what_they_get_from_cpp) {
  const Call call = built();
  const Bvh expected = Bvh::build(call.source.view());
  std::vector<umbel_vec3> points;
  for (const Ray& ray : random_rays(300, 6))
    points.push_back({0.7f * ray.origin.x, 0.7f * ray.origin.y, 0.7f * ray.origin.z});
  std::vector<umbel_closest_point> closest(points.size());
  std::vector<uint8_t> inside(points.size(), 7);
  std::vector<float> distance(points.size());
  umbel_bvh* const bvh = call.bvh.get();
  ASSERT_EQ(umbel_bvh_closest_point(bvh, points.data(), points.size(), 0.5f, 0, closest.data()),
            UMBEL_OK);
  ASSERT_EQ(umbel_bvh_contains(bvh, points.data(), points.size(), 1, inside.data()), UMBEL_OK);
  ASSERT_EQ(umbel_bvh_signed_distance(bvh, points.data(), points.size(), 2, distance.data()),
            UMBEL_OK);
  size_t found = 0, within = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const Vec3 p{points[i].x, points[i].y, points[i].z};
    const ClosestPoint c = expected.closest_point(p, 0.5f);
    ASSERT_EQ(closest[i].primitive, c.primitive);
    ASSERT_EQ(closest[i].distance, c.distance);
    ASSERT_EQ(closest[i].point.x, c.point.x);
    ASSERT_EQ(closest[i].v, c.v);
    ASSERT_EQ(inside[i], expected.contains(p) ? 1 : 0);
    ASSERT_EQ(distance[i], expected.signed_distance(p));
    found += c.primitive != kNone;
    within += inside[i];
  }
  EXPECT_GT(found, 0u);
  EXPECT_LT(found, points.size());
  EXPECT_GT(within, 0u);
  EXPECT_LT(within, points.size());
}

TEST(CapiBvh, overlaps_are_asked_for_in_two_calls) {
  const Call call = built();
  const Bvh expected = Bvh::build(call.source.view());
  const umbel_aabb box{{0, 0, 0}, {1, 1, 1}};
  const umbel_sphere sphere{{0.5f, 0.5f, 0.5f}, 0.5f};
  const umbel_plane planes[6] = {{{1, 0, 0}, 0},  {{0, 1, 0}, 0},  {{0, 0, 1}, 0},
                                 {{-1, 0, 0}, 1}, {{0, -1, 0}, 1}, {{0, 0, -1}, 1}};
  Frustum frustum;
  std::memcpy(&frustum, planes, sizeof planes);
  umbel_bvh* const bvh = call.bvh.get();
  const auto check = [&](const auto& ask, const std::vector<uint32_t>& truth) {
    ASSERT_GT(truth.size(), 5u);
    size_t count = 0;
    ASSERT_EQ(ask(nullptr, 0, &count), UMBEL_OK);
    ASSERT_EQ(count, truth.size());
    std::vector<uint32_t> found(count, kNone);
    expect_failure(ask(found.data(), count - 1, &count), UMBEL_ERROR_CAPACITY, "triangles");
    EXPECT_EQ(count, truth.size());
    EXPECT_EQ(found[0], kNone);
    ASSERT_EQ(ask(found.data(), count, &count), UMBEL_OK);
    EXPECT_EQ(found, truth);
  };
  check(
      [&](uint32_t* t, size_t n, size_t* c) { return umbel_bvh_overlaps_box(bvh, &box, t, n, c); },
      expected.overlaps(Aabb{{0, 0, 0}, {1, 1, 1}}));
  check([&](uint32_t* t, size_t n,
            size_t* c) { return umbel_bvh_overlaps_sphere(bvh, &sphere, t, n, c); },
        expected.overlaps(Sphere{{0.5f, 0.5f, 0.5f}, 0.5f}));
  check([&](uint32_t* t, size_t n,
            size_t* c) { return umbel_bvh_overlaps_frustum(bvh, planes, t, n, c); },
        expected.overlaps(frustum));
}

TEST(CapiBvh, refit_follows_moved_vertices) {
  Call call = built();
  umbel_bvh_statistics before;
  umbel_bvh_statistics_init(&before);
  ASSERT_EQ(umbel_bvh_get_statistics(call.bvh.get(), &before), UMBEL_OK);
  for (Vec3& p : call.source.positions) p = {p.x + 5, 2 * p.y, p.z};
  umbel_refit_report report;
  umbel_refit_report_init(&report);
  ASSERT_EQ(umbel_bvh_refit(call.bvh.get(), &call.mesh, &call.options, &report), UMBEL_OK);
  EXPECT_EQ(report.built_sah_cost, before.sah_cost);
  EXPECT_GT(report.sah_cost, 0);
  EXPECT_EQ(report.rebuild_advised, 0u);
  const Bvh expected = Bvh::build(call.source.view());
  std::vector<Ray> rays = random_rays(200, 8);
  for (Ray& ray : rays) ray.origin.x += 5;
  std::vector<umbel_hit> hits(rays.size());
  ASSERT_EQ(umbel_bvh_intersect(call.bvh.get(), as_c(rays), rays.size(), nullptr, hits.data()),
            UMBEL_OK);
  for (size_t i = 0; i < rays.size(); ++i)
    ASSERT_TRUE(same(hits[i], expected.intersect(rays[i]))) << i;
  // Vertices that go anywhere make a tree that a new build would beat.
  std::mt19937 random(3);
  std::shuffle(call.source.positions.begin(), call.source.positions.end(), random);
  ASSERT_EQ(umbel_bvh_refit(call.bvh.get(), &call.mesh, nullptr, &report), UMBEL_OK);
  EXPECT_EQ(report.rebuild_advised, 1u);
  EXPECT_EQ(umbel_bvh_refit(call.bvh.get(), &call.mesh, nullptr, nullptr), UMBEL_OK);
}

TEST(CapiBvh, saved_files_load_as_they_were) {
  const Folder folder;
  const Call call = built();
  const std::string path = folder.file("mesh.umbvh");
  ASSERT_EQ(umbel_bvh_save(call.bvh.get(), path.c_str()), UMBEL_OK) << umbel_last_error();
  umbel_bvh* loaded = nullptr;
  ASSERT_EQ(umbel_bvh_load(path.c_str(), &loaded), UMBEL_OK) << umbel_last_error();
  const Owned owned(loaded);
  const std::vector<Ray> rays = random_rays(200, 9);
  std::vector<umbel_hit> a(rays.size()), b(rays.size());
  ASSERT_EQ(umbel_bvh_intersect(call.bvh.get(), as_c(rays), rays.size(), nullptr, a.data()),
            UMBEL_OK);
  ASSERT_EQ(umbel_bvh_intersect(loaded, as_c(rays), rays.size(), nullptr, b.data()), UMBEL_OK);
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]), 0);
}

TEST(CapiBvh, statistics_say_what_is_there) {
  const Call call = built();
  umbel_bvh_statistics found;
  umbel_bvh_statistics_init(&found);
  ASSERT_EQ(umbel_bvh_get_statistics(call.bvh.get(), &found), UMBEL_OK);
  const Bvh expected = Bvh::build(call.source.view());
  const BvhStatistics truth = expected.statistics();
  EXPECT_EQ(found.struct_size, sizeof found);
  EXPECT_EQ(found.width, 8u);
  EXPECT_EQ(found.nodes, truth.nodes);
  EXPECT_EQ(found.leaves, truth.leaves);
  EXPECT_EQ(found.max_depth, truth.max_depth);
  EXPECT_EQ(found.references, truth.references);
  EXPECT_EQ(found.triangle_count, call.source.triangles.size());
  EXPECT_EQ(found.sah_cost, truth.sah_cost);
  EXPECT_EQ(found.bytes, truth.bytes);
  EXPECT_EQ(found.bounds.max.y, expected.bounds().max.y);
}

TEST(CapiBvh, empty_meshes_answer_every_query) {
  Call call{Mesh{}};
  ASSERT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
  umbel_bvh* const bvh = call.bvh.get();
  const std::vector<Ray> rays = random_rays(3, 1);
  umbel_hit hits[3];
  uint8_t flags[3] = {9, 9, 9};
  uint32_t counts[3] = {9, 9, 9};
  const umbel_vec3 points[3] = {};
  umbel_closest_point closest[3];
  float distances[3];
  ASSERT_EQ(umbel_bvh_intersect(bvh, as_c(rays), 3, nullptr, hits), UMBEL_OK);
  EXPECT_EQ(hits[2].primitive, UMBEL_NONE);
  EXPECT_EQ(hits[2].t, kInfinity);
  ASSERT_EQ(umbel_bvh_occluded(bvh, as_c(rays), 3, nullptr, flags), UMBEL_OK);
  EXPECT_EQ(flags[2], 0);
  ASSERT_EQ(umbel_bvh_all_hits(bvh, as_c(rays), 3, nullptr, 1, hits, counts), UMBEL_OK);
  EXPECT_EQ(counts[2], 0u);
  ASSERT_EQ(umbel_bvh_closest_point(bvh, points, 3, kInfinity, 0, closest), UMBEL_OK);
  EXPECT_EQ(closest[2].primitive, UMBEL_NONE);
  EXPECT_EQ(closest[2].distance, kInfinity);
  flags[2] = 9;
  ASSERT_EQ(umbel_bvh_contains(bvh, points, 3, 0, flags), UMBEL_OK);
  EXPECT_EQ(flags[2], 0);
  ASSERT_EQ(umbel_bvh_signed_distance(bvh, points, 3, 0, distances), UMBEL_OK);
  EXPECT_EQ(distances[2], kInfinity);
  size_t count = 5;
  const umbel_aabb box{{-1, -1, -1}, {1, 1, 1}};
  ASSERT_EQ(umbel_bvh_overlaps_box(bvh, &box, nullptr, 0, &count), UMBEL_OK);
  EXPECT_EQ(count, 0u);
  umbel_bvh_statistics found;
  umbel_bvh_statistics_init(&found);
  ASSERT_EQ(umbel_bvh_get_statistics(bvh, &found), UMBEL_OK);
  EXPECT_EQ(found.nodes, 0u);
  EXPECT_GT(found.bounds.min.x, found.bounds.max.x);
  EXPECT_EQ(umbel_bvh_refit(bvh, &call.mesh, nullptr, nullptr), UMBEL_OK);
  // Nothing asked of a tree with triangles is no fault either.
  const Call full = built();
  EXPECT_EQ(umbel_bvh_intersect(full.bvh.get(), nullptr, 0, nullptr, nullptr), UMBEL_OK);
  EXPECT_EQ(umbel_bvh_contains(full.bvh.get(), nullptr, 0, 0, nullptr), UMBEL_OK);
}

TEST(CapiBvh, one_tree_serves_many_threads) {
  const Call call = built();
  const std::vector<Ray> rays = random_rays(400, 10);
  std::vector<umbel_hit> expected(rays.size());
  ASSERT_EQ(umbel_bvh_intersect(call.bvh.get(), as_c(rays), rays.size(), nullptr, expected.data()),
            UMBEL_OK);
  std::vector<std::thread> threads;
  std::vector<std::vector<umbel_hit>> found(4, std::vector<umbel_hit>(rays.size()));
  for (auto& hits : found)
    threads.emplace_back([&] {
      umbel_bvh_intersect(call.bvh.get(), as_c(rays), rays.size(), nullptr, hits.data());
    });
  for (std::thread& thread : threads) thread.join();
  for (const auto& hits : found)
    EXPECT_EQ(std::memcmp(hits.data(), expected.data(), hits.size() * sizeof hits[0]), 0);
}

}  // namespace
}  // namespace umbel
