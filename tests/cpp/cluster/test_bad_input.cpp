// Input that is degenerate, extreme or wrong: valid clusters in little time, or one sentence.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

TEST(BisectBadInput, degenerate_inputs_end_in_valid_clusters) {
  const auto all_forms = [](const Items& items) {
    for (const char* preset : {"quality", "fast", "exact"}) checked(items, cluster_preset(preset));
    checked(items, limits(1, 64));
    ClusterConfig penalised = limits(1, 64);
    penalised.overlap_cost = 1;
    checked(items, penalised);
    if (!items.vertices.empty()) checked(items, limits(32, 128, 64));
  };
  Items identical;
  identical.boxes.assign(20000, {{1, 2, 3}, {2, 3, 4}});
  all_forms(identical);
  Items points;
  points.boxes.assign(20000, {{1, 2, 3}, {1, 2, 3}});
  all_forms(points);
  Items concentric;
  for (int i = 1; i <= 20000; ++i)
    concentric.boxes.push_back({{-float(i), -float(i), -float(i)}, {float(i), float(i), float(i)}});
  all_forms(concentric);
  for (const Vec3 along : {Vec3{1, 0, 0}, Vec3{1, 2, -1}}) {
    Items collinear;
    for (int i = 0; i < 20000; ++i)
      collinear.boxes.push_back({min(along * float(i), along * float(i + 1)),
                                 max(along * float(i), along * float(i + 1))});
    all_forms(collinear);
  }
  all_forms(items_of(fan(50000)));
  Mesh same_triangle;
  same_triangle.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  same_triangle.triangles.assign(20000, {0, 1, 2});
  all_forms(items_of(same_triangle));
  Mesh degenerate = same_triangle;
  degenerate.triangles.assign(5000, {1, 1, 1});
  all_forms(items_of(degenerate));
}

TEST(BisectBadInput, extreme_extents_are_clustered_as_well_as_usual_ones) {
  const Items items = random_items(20000, 17);
  const ClusterConfig config = limits(32, 128);
  const Clusters base = checked(items, config);
  const double usual = cluster_metrics(items.input(), base, 128).surface_area_ratio;
  for (const float scale : {0.15f, 1e-20f, 1e-30f, 1e15f, 1e18f, 3e38f}) {
    Items scaled = items;
    for (Aabb& b : scaled.boxes) b = {b.min * scale, b.max * scale};
    for (Aabb& b : scaled.boxes) b.max = min(b.max, {3.4e38f, 3.4e38f, 3.4e38f});
    const Clusters c = checked(scaled, config);
    const double ratio = cluster_metrics(scaled.input(), c, 128).surface_area_ratio;
    EXPECT_NEAR(ratio, usual, 0.05 * usual) << scale;
  }
  Items whole = items;  // from the lowest to the largest float
  for (Aabb& b : whole.boxes)
    for (float* f : {&b.min.x, &b.min.y, &b.min.z, &b.max.x, &b.max.y, &b.max.z})
      *f = (std::min(*f, 1.0f) - 0.5f) * 2 * 3.4e38f;
  checked(whole, config);
  Items denormal = items;
  for (Aabb& b : denormal.boxes) b = {b.min * 1e-42f, b.max * 1e-42f};
  checked(denormal, config);
}

TEST(BisectBadInput, given_centroids_may_lie_anywhere) {
  for (const uint32_t count : {3000u, 30000u}) {
    Items items = random_items(count, 23, 1e-6f);
    for (const float scale : {1.0f, 1e-30f, 1e30f, 3e38f}) {
      items.centroids.clear();
      for (const Aabb& b : items.boxes)
        items.centroids.push_back((b.min - Vec3{0.5f, 0.5f, 0.5f}) * scale);
      checked(items, limits(32, 128));
      checked(items, limits(128, 128));
    }
  }
}

TEST(BisectBadInput, one_far_item_does_not_spoil_the_rest) {
  Items items = random_items(20000, 18);
  const ClusterConfig config = limits(32, 128);
  const auto areas = [](const Items& of, const Clusters& c) {
    double sum = 0;
    for (const Range& r : c.ranges) {
      Aabb box;
      bool far = false;
      for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
        extend(box, of.boxes[c.items[i]]);
        far |= of.boxes[c.items[i]].max.x > 1e6f;
      }
      if (!far) sum += half_area(box);
    }
    return sum;
  };
  const double usual = areas(items, checked(items, config));
  for (const float far : {1e9f, 1e18f, 1e38f}) {
    items.boxes[777] = {{far, far, far}, {far, far, far}};
    EXPECT_LT(areas(items, checked(items, config)), 1.3 * usual) << far;
  }
}

// In order of their indices, these corners of the mesh become what is not finite.
Mesh spoiled(Mesh mesh, const std::vector<size_t>& corners, float bad) {
  for (const size_t c : corners) mesh.positions[mesh.triangles[c / 3][c % 3]].y = bad;
  return mesh;
}

void expect_all_forms_refuse(const Mesh& mesh) {
  uint32_t first = 0;
  const auto is_bad = [&](const Triangle& t) {
    return std::any_of(t.begin(), t.end(),
                       [&](uint32_t v) { return !std::isfinite(mesh.positions[v].y); });
  };
  while (!is_bad(mesh.triangles[first])) ++first;
  const std::string number = " " + std::to_string(first) + " ";
  const Items items = items_of(mesh);
  for (const char* preset : {"quality", "fast", "exact"}) {
    const ClusterConfig config = cluster_preset(preset);
    const auto invalid = ErrorCode::kInvalidMesh;
    expect_error(invalid, "item" + number, [&] { build_clusters(items.input(), config); });
    expect_error(invalid, "triangle" + number, [&] { cluster_mesh(mesh.view(), config); });
    expect_error(invalid, "triangle" + number, [&] { cluster_mesh_morton(mesh.view(), config); });
  }
}

TEST(BisectBadInput, nothing_but_nan_is_rejected) {
  Mesh mesh = grid(100, 100);
  const float nan = std::nanf("");
  for (Vec3& p : mesh.positions) p = {nan, nan, nan};
  expect_all_forms_refuse(mesh);
}

TEST(BisectBadInput, ten_nan_coordinates_lose_no_triangle_in_silence) {
  expect_all_forms_refuse(spoiled(
      grid(100, 100), {700, 7000, 9000, 20000, 20001, 30003, 40000, 50000, 59000, 59998}, NAN));
}

TEST(BisectBadInput, two_infinite_coordinates_are_rejected) {
  expect_all_forms_refuse(spoiled(grid(100, 100), {30000, 50000}, HUGE_VALF));
  expect_all_forms_refuse(spoiled(grid(100, 100), {59999, 12}, -HUGE_VALF));
}

TEST(BisectBadInput, not_finite_boxes_and_centroids_are_rejected) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, inf, -inf}) {
    Items items = random_items(1000, 1);
    items.boxes[500].max.y = bad;
    expect_error(ErrorCode::kInvalidMesh, items.input(), limits(32, 128));
    items = random_items(1000, 1);
    items.centroids.assign(1000, {0, 0, 0});
    items.centroids[999].x = bad;
    expect_error(ErrorCode::kInvalidMesh, items.input(), limits(32, 128));
    Mesh mesh = grid(10, 10);  // in a vertex that no triangle uses
    mesh.positions.push_back({bad, bad, bad});
    EXPECT_NO_THROW(cluster_mesh(mesh.view(), {}));
  }
  Items empty_box = random_items(10, 1);
  empty_box.boxes[3] = Aabb{};
  expect_error(ErrorCode::kInvalidMesh, empty_box.input(), limits(1, 4));
  Mesh mesh = grid(10, 10);
  mesh.triangles[7][1] = 1000000;
  expect_error(ErrorCode::kInvalidMesh, "triangle 7 ", [&] { cluster_mesh(mesh.view(), {}); });
}

TEST(BisectBadInput, bad_configs_are_rejected) {
  const Items items = random_items(100, 1);
  const auto bad = [&](auto&& change) {
    ClusterConfig config;
    change(config);
    expect_error(ErrorCode::kInvalidArgument, items.input(), config);
  };
  bad([](ClusterConfig& c) { c.min_items = 0; });
  bad([](ClusterConfig& c) { c.max_items = 0; });
  bad([](ClusterConfig& c) { c.min_items = c.max_items + 1; });
  bad([](ClusterConfig& c) { c.max_vertices = 64; });
  for (const float value : {-0.1f, 1.1f, std::nanf("")}) {
    bad([&](ClusterConfig& c) { c.underfill_cost = value; });
    bad([&](ClusterConfig& c) { c.overlap_cost = value; });
    bad([&](ClusterConfig& c) { c.vertex_underfill_cost = value; });
  }
  EXPECT_THROW(cluster_preset("best"), Error);
  EXPECT_THROW(cluster_preset("quality", 0), Error);
}

TEST(BisectBadInput, bad_layouts_are_rejected) {
  const auto bad = [](auto&& change) {
    Items items = random_items(100, 1);
    ClusterInput input = items.input();
    change(items, input);
    expect_error(ErrorCode::kInvalidArgument, input, limits(4, 16));
  };
  using I = Items;
  using C = ClusterInput;
  bad([](I& i, C& in) { in.centroids = (i.centroids.resize(99), i.centroids); });
  bad([](I& i, C& in) { in.segments = i.segments = {{0, 60}, {50, 10}}; });
  bad([](I& i, C& in) { in.segments = i.segments = {{90, 11}}; });
  bad([](I& i, C& in) { in.segments = i.segments = {{kNone, 2}}; });
  bad([](I& i, C& in) { in.item_vertices = (i.vertices.resize(300), i.vertices); });
  bad([](I& i, C& in) {
    in.item_vertices = (i.vertices.resize(299), i.vertices);
    in.vertices_per_item = 3;
  });
  bad([](I&, C& in) { in.shared_vertex_weight = 1; });
  bad([](I& i, C& in) { in.connections.ranges = (i.ranges.resize(99), i.ranges); });
  bad([](I& i, C& in) { in.connections.ranges = (i.ranges.assign(100, {0, 1}), i.ranges); });
  bad([](I& i, C& in) {
    in.connections.ranges = (i.ranges.assign(100, {0, 1}), i.ranges);
    in.connections.targets = (i.targets = {100}, i.targets);
  });
  for (const float weight : {-1.0f, std::nanf(""), HUGE_VALF})
    bad([&](I& i, C& in) {
      in.connections.ranges = (i.ranges.assign(100, {0, 1}), i.ranges);
      in.connections.targets = (i.targets = {1}, i.targets);
      in.connections.weights = (i.weights = {weight}, i.weights);
    });
  Items items = items_of(grid(5, 5));
  expect_error(ErrorCode::kInvalidArgument, items.input(), limits(1, 16, 2));
}

TEST(BisectBadInput, no_metrics_of_boxes_that_are_none) {
  Items items = random_items(100, 3);
  const Clusters c = checked(items, limits(4, 16));
  for (const float wrong : {std::numeric_limits<float>::quiet_NaN(), HUGE_VALF, -HUGE_VALF}) {
    items.boxes[70].max.y = wrong;
    try {
      cluster_metrics(items.input(), c, 16);
      ADD_FAILURE() << "measured";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidMesh);
      EXPECT_NE(std::string(error.what()).find("item 70"), std::string::npos) << error.what();
    }
  }
}

TEST(BisectBadInput, empty_input_gives_an_empty_result) {
  const Clusters c = build_clusters({}, {});
  EXPECT_TRUE(c.items.empty() && c.ranges.empty() && c.segments.empty());
  EXPECT_TRUE(cluster_mesh({}, {}).items.empty());
  EXPECT_TRUE(cluster_mesh_morton({}, {}).items.empty());
  EXPECT_EQ(cluster_metrics({}, c, 128).clusters, 0u);
}

TEST(BisectBadInput, an_extent_of_1e18_is_legal_in_any_form) {
  Mesh mesh = grid(100, 100, 5.0f);
  for (Vec3& p : mesh.positions) p = 1e16f * p;
  for (const char* preset : {"quality", "fast", "exact"}) {
    const ClusterConfig config = cluster_preset(preset);
    const Clusters c = checked(items_of(mesh), config);
    EXPECT_TRUE(same(c, in_time([&] { return cluster_mesh(mesh.view(), config); })));
  }
}

TEST(BisectBadInput, seventy_thousand_items_in_exact_clusters_of_64_with_presplit) {
  ClusterConfig config = limits(64, 64);
  config.presplit_threshold = 8000;
  EXPECT_EQ(checked(random_items(70000, 2), config).ranges.size(), (70000u + 63) / 64);
}

TEST(BisectBadInput, five_million_unused_vertices_cost_nothing) {
  Mesh mesh = grid(100, 100);
  const std::vector<Triangle> triangles = mesh.triangles;
  mesh.positions.insert(mesh.positions.begin(), 5000000, {0, 0, 0});
  for (Triangle& t : mesh.triangles)
    for (uint32_t& v : t) v += 5000000;
  const std::clock_t start = std::clock();
  cluster_mesh(mesh.view(), limits(32, 128, 128));
  EXPECT_LT(double(std::clock() - start) / CLOCKS_PER_SEC, 1);
}

TEST(BisectBadInput, unwelded_seams_change_no_cluster) {
  const Mesh mesh = grid(150, 150, 5.0f);
  Mesh torn;
  for (const Triangle& t : mesh.triangles) {
    const uint32_t v = uint32_t(torn.positions.size());
    for (const uint32_t corner : t) torn.positions.push_back(mesh.positions[corner]);
    torn.triangles.push_back({v, v + 1, v + 2});
  }
  for (const char* preset : {"quality", "fast", "exact"}) {
    const ClusterConfig config = cluster_preset(preset);
    EXPECT_TRUE(same(cluster_mesh(mesh.view(), config),
                     in_time([&] { return cluster_mesh(torn.view(), config); })))
        << preset;
  }
}

}  // namespace
}  // namespace umbel
