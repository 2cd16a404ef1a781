// Properties of clusters that hold for any input.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "base/math.hpp"
#include "cluster/bisect.hpp"
#include "umbel/cluster.hpp"

namespace umbel {
namespace {

struct Items {
  std::vector<Aabb> boxes;
  std::vector<Vec3> centroids;
  std::vector<uint32_t> vertices;
  std::vector<Range> segments;
  std::vector<Range> ranges;
  std::vector<uint32_t> targets;
  std::vector<float> weights;

  ClusterInput input() const {
    ClusterInput in;
    in.boxes = boxes;
    in.centroids = centroids;
    in.item_vertices = vertices;
    in.vertices_per_item = vertices.empty() ? 0 : 3;
    in.segments = segments;
    in.connections = {ranges, targets, weights};
    return in;
  }
};

Items random_items(uint32_t count, uint32_t seed, float size = 0.05f) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Items items;
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 p{unit(random), unit(random), unit(random)};
    items.boxes.push_back({p, p + size * Vec3{unit(random), unit(random), unit(random)}});
  }
  return items;
}

Mesh grid(uint32_t columns, uint32_t rows, float wave = 0.0f) {
  Mesh mesh;
  for (uint32_t y = 0; y <= rows; ++y)
    for (uint32_t x = 0; x <= columns; ++x)
      mesh.positions.push_back(
          {float(x), float(y), wave * std::sin(0.3f * float(x)) * std::cos(0.2f * float(y))});
  const uint32_t w = columns + 1;
  for (uint32_t y = 0; y < rows; ++y)
    for (uint32_t x = 0; x < columns; ++x) {
      const uint32_t v = y * w + x;
      mesh.triangles.push_back({v, v + 1, v + w});
      mesh.triangles.push_back({v + 1, v + w + 1, v + w});
    }
  return mesh;
}

Mesh soup(uint32_t triangles, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Mesh mesh;
  for (uint32_t i = 0; i < triangles; ++i) {
    const Vec3 p{unit(random), unit(random), unit(random)};
    for (int k = 0; k < 3; ++k)
      mesh.positions.push_back(p + 0.02f * Vec3{unit(random), unit(random), unit(random)});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

Mesh fan(uint32_t triangles) {
  Mesh mesh;
  mesh.positions.push_back({0, 0, 0});
  for (uint32_t i = 0; i <= triangles; ++i) {
    const float a = 6.2831853f * float(i) / float(triangles);
    mesh.positions.push_back({std::cos(a), std::sin(a), 0});
  }
  for (uint32_t i = 0; i < triangles; ++i) mesh.triangles.push_back({0, i + 1, i + 2});
  return mesh;
}

Items items_of(const Mesh& mesh) {
  Items items;
  for (const Triangle& t : mesh.triangles) {
    Aabb box;
    for (const uint32_t v : t) {
      extend(box, mesh.positions[v]);
      items.vertices.push_back(v);
    }
    items.boxes.push_back(box);
  }
  return items;
}

size_t unique_vertices(const Items& items, const Clusters& c, const Range& r) {
  std::set<uint32_t> unique;
  for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
    for (int k = 0; k < 3; ++k) unique.insert(items.vertices[size_t(c.items[i]) * 3 + k]);
  return unique.size();
}

// Everything that the header promises about a result.
void expect_valid(const Items& items, const ClusterConfig& config, const Clusters& c) {
  const uint32_t count = uint32_t(items.boxes.size());
  ASSERT_EQ(c.items.size(), count);
  std::vector<uint8_t> seen(count, 0);
  for (const uint32_t item : c.items) {
    ASSERT_LT(item, count);
    EXPECT_EQ(seen[item]++, 0) << "item " << item << " twice";
  }
  std::vector<Range> segments = items.segments;
  if (segments.empty() && count) segments = {{0, count}};
  ASSERT_EQ(c.segments.size(), segments.size());
  std::vector<uint8_t> in_segment(count, 0);
  for (size_t s = 0; s < segments.size(); ++s) {
    const Range& segment = segments[s];
    uint32_t at = segment.offset, undersized = 0;
    for (uint32_t k = c.segments[s].offset; k < c.segments[s].offset + c.segments[s].count; ++k) {
      const Range& r = c.ranges[k];
      ASSERT_EQ(r.offset, at);
      ASSERT_GE(r.count, 1u);
      EXPECT_LE(r.count, config.max_items);
      undersized += r.count < config.min_items;
      if (config.max_vertices) EXPECT_LE(unique_vertices(items, c, r), config.max_vertices);
      for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
        EXPECT_GE(c.items[i], segment.offset);
        EXPECT_LT(c.items[i], segment.offset + segment.count);
        in_segment[i] = 1;
      }
      at += r.count;
    }
    EXPECT_EQ(at, segment.offset + segment.count);
    if (!config.max_vertices) EXPECT_LE(undersized, 1u);
  }
  for (uint32_t i = 0; i < count; ++i)
    if (!in_segment[i]) EXPECT_EQ(c.items[i], i);
}

// Clusters them, and fails if that takes longer than a hang guard of 10 seconds.
Clusters cluster(const Items& items, const ClusterConfig& config, uint32_t threads = 0) {
  BuildOptions options;
  options.threads = threads;
  const auto start = std::chrono::steady_clock::now();
  Clusters c = build_clusters(items.input(), config, options);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
  expect_valid(items, config, c);
  return c;
}

bool same(const Clusters& a, const Clusters& b) {
  return a.items == b.items && a.ranges == b.ranges && a.segments == b.segments;
}

ClusterConfig limits(uint32_t min_items, uint32_t max_items, uint32_t max_vertices = 0) {
  ClusterConfig config;
  config.min_items = min_items;
  config.max_items = max_items;
  config.max_vertices = max_vertices;
  return config;
}

void expect_error(ErrorCode code, const ClusterInput& input, const ClusterConfig& config) {
  for (int form = 0; form < 2; ++form) {
    try {
      if (form == 0) {
        build_clusters(input, config);
      } else {
        Clusters out;
        cluster::Bisector().build(input, config, out);
      }
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      EXPECT_GT(std::string(error.what()).size(), 10u);
    }
  }
}

TEST(Bisect, every_item_is_in_one_cluster_for_random_inputs_and_configs) {
  std::mt19937 random(7);
  for (int round = 0; round < 150; ++round) {
    const uint32_t count = random() % (round % 10 == 0 ? 20000 : 700);
    Items items = random() % 2 ? random_items(count, round) : items_of(soup(count, round));
    const uint32_t max_items = 1 + random() % 200;
    ClusterConfig config = limits(1 + random() % max_items, max_items);
    config.underfill_cost = float(random() % 3) * 0.5f;
    config.overlap_cost = float(random() % 3) * 0.5f;
    config.presplit_threshold = random() % 3 ? 0 : random() % 1000;
    config.coarse = random() % 3 == 0;
    if (!items.vertices.empty() && random() % 2) config.max_vertices = 3 + random() % 200;
    if (random() % 2) {
      for (uint32_t at = 0; at < count;) {
        const uint32_t length = std::min(count - at, uint32_t(random() % 300));
        if (random() % 5) items.segments.push_back({at, length});
        at += length;
      }
      if (random() % 2) std::shuffle(items.segments.begin(), items.segments.end(), random);
    }
    cluster(items, config);
    if (HasFatalFailure()) FAIL() << "round " << round;
  }
}

TEST(Bisect, sizes_stay_within_every_pair_of_limits) {
  const Items items = random_items(1000, 3);
  for (uint32_t max_items = 1; max_items <= 40; ++max_items)
    for (uint32_t min_items = 1; min_items <= max_items; ++min_items)
      cluster(items, limits(min_items, max_items));
  for (uint32_t count = 1; count < 300; ++count) {
    cluster(random_items(count, count), limits(96, 128));
    cluster(random_items(count, count), limits(24, 32));
    cluster(random_items(count, count), limits(7, 7));
  }
}

TEST(Bisect, exact_preset_fills_all_clusters_but_one) {
  for (const uint32_t count : {70000u, 5000u, 129u, 128u, 127u}) {
    const Clusters c = cluster(random_items(count, 1), cluster_preset("exact"));
    EXPECT_EQ(c.ranges.size(), (count + 127) / 128);
  }
}

TEST(Bisect, one_hundred_thousand_segments_are_clustered_each_by_itself) {
  Items items = random_items(300000, 5);
  for (uint32_t i = 0; i < 100000; ++i) items.segments.push_back({i * 3, 3});
  const Clusters c = cluster(items, limits(1, 2));
  EXPECT_GE(c.ranges.size(), 200000u);
}

TEST(Bisect, result_does_not_depend_on_the_number_of_threads) {
  for (const bool limited : {false, true}) {
    const Items items = items_of(grid(300, 250, 5.0f));
    ClusterConfig config = limits(32, 128, limited ? 80 : 0);
    const Clusters one = cluster(items, config, 1);
    EXPECT_TRUE(same(one, cluster(items, config, 2)));
    EXPECT_TRUE(same(one, cluster(items, config, 8)));
    Clusters alone;
    cluster::Bisector bisector;
    bisector.build(items.input(), config, alone);
    EXPECT_TRUE(same(one, alone));
    bisector.build(items.input(), config, alone);
    EXPECT_TRUE(same(one, alone));
  }
}

TEST(Bisect, mesh_and_boxes_give_the_same_clusters) {
  const Mesh mesh = grid(200, 200, 5.0f);
  EXPECT_TRUE(same(cluster_mesh(mesh.view(), limits(32, 128, 100)),
                   cluster(items_of(mesh), limits(32, 128, 100))));
}

TEST(Bisect, power_of_two_scale_does_not_change_the_partition) {
  for (const uint32_t count : {3000u, 40000u}) {
    const Items items = random_items(count, 11);
    const Clusters base = cluster(items, limits(32, 128));
    for (const int exponent : {-60, -20, -1, 1, 20, 60, 100}) {
      Items scaled = items;
      for (Aabb& b : scaled.boxes)
        b = {b.min * std::ldexp(1.0f, exponent), b.max * std::ldexp(1.0f, exponent)};
      EXPECT_TRUE(same(base, cluster(scaled, limits(32, 128)))) << "2^" << exponent;
    }
  }
}

// Coordinates are multiples of 2^-12, so that adding an offset does not round.
TEST(Bisect, translation_does_not_change_the_partition) {
  for (const uint32_t count : {3000u, 40000u}) {
    Items items = random_items(count, 12);
    for (Aabb& b : items.boxes)
      for (float* f : {&b.min.x, &b.min.y, &b.min.z, &b.max.x, &b.max.y, &b.max.z})
        *f = std::round(*f * 4096) / 4096;
    const Clusters base = cluster(items, limits(32, 128));
    for (const Vec3 offset : {Vec3{1, 2, -3}, Vec3{-100, 50, 7}, Vec3{1000, 1000, 1000}}) {
      Items moved = items;
      for (Aabb& b : moved.boxes) b = {b.min + offset, b.max + offset};
      EXPECT_TRUE(same(base, cluster(moved, limits(32, 128))));
    }
  }
}

TEST(Bisect, permutation_of_items_does_not_change_the_partition) {
  const Items items = random_items(30000, 13);
  const Clusters base = cluster(items, limits(32, 128));
  std::vector<uint32_t> to(items.boxes.size());
  for (uint32_t i = 0; i < to.size(); ++i) to[i] = i;
  std::shuffle(to.begin(), to.end(), std::mt19937(1));
  Items shuffled = items;
  for (uint32_t i = 0; i < to.size(); ++i) shuffled.boxes[to[i]] = items.boxes[i];
  const Clusters other = cluster(shuffled, limits(32, 128));
  const auto sets = [](const Clusters& c, const std::vector<uint32_t>* rename) {
    std::set<std::set<uint32_t>> all;
    for (const Range& r : c.ranges) {
      std::set<uint32_t> one;
      for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
        one.insert(rename ? (*rename)[c.items[i]] : c.items[i]);
      all.insert(one);
    }
    return all;
  };
  EXPECT_EQ(sets(base, &to), sets(other, nullptr));
}

TEST(Bisect, degenerate_inputs_end_in_valid_clusters) {
  const auto all_forms = [](const Items& items) {
    cluster(items, limits(32, 128));
    cluster(items, limits(1, 64));
    cluster(items, limits(128, 128));
    ClusterConfig priced = limits(1, 64);
    priced.overlap_cost = 1;
    cluster(items, priced);
    if (!items.vertices.empty()) cluster(items, limits(32, 128, 64));
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

TEST(Bisect, extreme_extents_are_clustered_as_well_as_usual_ones) {
  const Items items = random_items(20000, 17);
  const ClusterConfig config = limits(32, 128);
  const Clusters base = cluster(items, config);
  const double usual = cluster_metrics(items.input(), base, 128).surface_area_ratio;
  for (const float scale : {1e-20f, 1e-30f, 1e15f, 1e18f, 3e38f}) {
    Items scaled = items;
    for (Aabb& b : scaled.boxes) b = {b.min * scale, b.max * scale};
    for (Aabb& b : scaled.boxes) b.max = min(b.max, {3.4e38f, 3.4e38f, 3.4e38f});
    const Clusters c = cluster(scaled, config);
    const double ratio = cluster_metrics(scaled.input(), c, 128).surface_area_ratio;
    EXPECT_NEAR(ratio, usual, 0.05 * usual) << scale;
  }
  Items whole = items;  // from the lowest to the largest float
  for (Aabb& b : whole.boxes)
    for (float* f : {&b.min.x, &b.min.y, &b.min.z, &b.max.x, &b.max.y, &b.max.z})
      *f = (std::min(*f, 1.0f) - 0.5f) * 2 * 3.4e38f;
  cluster(whole, config);
  Items denormal = items;
  for (Aabb& b : denormal.boxes) b = {b.min * 1e-42f, b.max * 1e-42f};
  cluster(denormal, config);
}

TEST(Bisect, given_centroids_may_lie_anywhere) {
  for (const uint32_t count : {3000u, 30000u}) {
    Items items = random_items(count, 23, 1e-6f);
    for (const float scale : {1.0f, 1e-30f, 1e30f, 3e38f}) {
      items.centroids.clear();
      for (const Aabb& b : items.boxes)
        items.centroids.push_back((b.min - Vec3{0.5f, 0.5f, 0.5f}) * scale);
      cluster(items, limits(32, 128));
      cluster(items, limits(128, 128));
    }
  }
}

TEST(Bisect, fast_preset_has_little_more_area_than_quality) {
  const Mesh mesh = grid(300, 300, 8.0f);
  const Items items = items_of(mesh);
  const auto area = [&](const char* preset) {
    const ClusterConfig config = cluster_preset(preset);
    return cluster_metrics(items.input(), cluster(items, config), 128).surface_area_ratio;
  };
  EXPECT_LE(area("fast"), 1.2 * area("quality"));
}

TEST(Bisect, one_far_item_does_not_spoil_the_rest) {
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
  const double usual = areas(items, cluster(items, config));
  for (const float far : {1e9f, 1e18f, 1e38f}) {
    items.boxes[777] = {{far, far, far}, {far, far, far}};
    EXPECT_LT(areas(items, cluster(items, config)), 1.3 * usual) << far;
  }
}

TEST(Bisect, ten_thousand_clusters_with_connections_keep_neighbours_together) {
  // A 100 x 100 grid of boxes, where rows are connected strongly.
  Items items;
  for (uint32_t y = 0; y < 100; ++y)
    for (uint32_t x = 0; x < 100; ++x) {
      items.boxes.push_back({{float(x), float(y), 0}, {float(x) + 1, float(y) + 1, 0}});
      const uint32_t i = y * 100 + x;
      const uint32_t start = uint32_t(items.targets.size());
      if (x > 0) items.targets.push_back(i - 1);
      if (x < 99) items.targets.push_back(i + 1);
      items.ranges.push_back({start, uint32_t(items.targets.size()) - start});
    }
  items.weights.assign(items.targets.size(), 20.0f);
  const auto cut_rows = [&](const Clusters& c) {
    return cluster_metrics(items.input(), c, 32).ratio_cut;
  };
  Items plain = items;
  plain.ranges.clear();
  plain.targets.clear();
  plain.weights.clear();
  EXPECT_LT(cut_rows(cluster(items, limits(24, 32))),
            0.7 * cut_rows(cluster(plain, limits(24, 32))));
}

TEST(Bisect, bad_weights_do_not_degenerate_into_single_items) {
  Items items = random_items(20000, 19);
  std::mt19937 random(3);
  for (uint32_t i = 0; i < 20000; ++i) {  // everything hangs on a few hubs
    items.ranges.push_back({uint32_t(items.targets.size()), 3});
    for (int k = 0; k < 3; ++k) items.targets.push_back(random() % 5);
  }
  for (const float weight : {0.0f, 1e-30f, 1.0f, 1e10f, 3e38f}) {
    items.weights.assign(items.targets.size(), weight);
    const Clusters c = cluster(items, limits(1, 128));
    EXPECT_LT(c.ranges.size(), 2000u) << weight;
  }
}

TEST(Bisect, shared_vertex_weight_lowers_the_vertices_of_a_cluster) {
  const Mesh mesh = grid(150, 150, 10.0f);
  const Items items = items_of(mesh);
  const auto vertices = [&](float weight) {
    return cluster_metrics(items.input(), cluster_mesh(mesh.view(), limits(32, 128), weight), 128)
        .mean_vertices;
  };
  EXPECT_LE(vertices(1.0f), vertices(0.0f));
}

TEST(Bisect, vertex_limit_is_kept_and_clusters_stay_full) {
  const Mesh flat = grid(200, 200);
  for (const uint32_t limit : {3u, 10u, 64u, 128u, 255u})
    cluster(items_of(flat), limits(32, 128, limit));
  const Items loose = items_of(soup(20000, 4));
  const Clusters c = cluster(loose, limits(32, 128, 128));
  // 42 triangles of their own vertices fill a cluster of 128 vertices.
  EXPECT_GE(20000.0 / double(c.ranges.size()), 0.95 * 42);
}

TEST(Bisect, not_finite_boxes_are_rejected) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, inf, -inf}) {
    Items items = random_items(1000, 1);
    items.boxes[500].max.y = bad;
    expect_error(ErrorCode::kInvalidMesh, items.input(), limits(32, 128));
    for (Aabb& b : items.boxes) b.min.z = bad;
    expect_error(ErrorCode::kInvalidMesh, items.input(), limits(32, 128));
    items = random_items(1000, 1);
    items.centroids.assign(1000, {0, 0, 0});
    items.centroids[999].x = bad;
    expect_error(ErrorCode::kInvalidMesh, items.input(), limits(32, 128));
    Mesh mesh = grid(10, 10);
    mesh.positions[60].z = bad;
    EXPECT_THROW(cluster_mesh(mesh.view(), {}), Error);
    EXPECT_THROW(cluster_mesh_morton(mesh.view(), {}), Error);
    mesh = grid(10, 10);  // in a vertex that no triangle uses
    mesh.positions.push_back({bad, bad, bad});
    EXPECT_NO_THROW(cluster_mesh(mesh.view(), {}));
  }
  Items empty_box = random_items(10, 1);
  empty_box.boxes[3] = Aabb{};
  expect_error(ErrorCode::kInvalidMesh, empty_box.input(), limits(1, 4));
  Mesh mesh = grid(10, 10);
  mesh.triangles[7][1] = 1000000;
  EXPECT_THROW(cluster_mesh(mesh.view(), {}), Error);
}

TEST(Bisect, bad_configs_are_rejected) {
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

TEST(Bisect, bad_layouts_are_rejected) {
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

TEST(Bisect, empty_input_gives_an_empty_result) {
  const Clusters c = build_clusters({}, {});
  EXPECT_TRUE(c.items.empty() && c.ranges.empty() && c.segments.empty());
  EXPECT_TRUE(cluster_mesh({}, {}).items.empty());
  EXPECT_TRUE(cluster_mesh_morton({}, {}).items.empty());
  EXPECT_EQ(cluster_metrics({}, c, 128).clusters, 0u);
}

TEST(Bisect, seventy_thousand_items_in_exact_clusters_of_64_with_presplit) {
  ClusterConfig config = limits(64, 64);
  config.presplit_threshold = 8000;
  EXPECT_EQ(cluster(random_items(70000, 2), config).ranges.size(), (70000u + 63) / 64);
}

TEST(Bisect, five_million_unused_vertices_cost_nothing) {
  Mesh mesh = grid(100, 100);
  const std::vector<Triangle> triangles = mesh.triangles;
  mesh.positions.insert(mesh.positions.begin(), 5000000, {0, 0, 0});
  for (Triangle& t : mesh.triangles)
    for (uint32_t& v : t) v += 5000000;
  const auto start = std::chrono::steady_clock::now();
  cluster_mesh(mesh.view(), limits(32, 128, 128));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(1));
}

TEST(Bisect, progress_never_falls_ends_at_one_and_can_cancel) {
  const Items items = random_items(200000, 21);
  BuildOptions options;
  float last = 0;
  int calls = 0;
  options.progress = [&](float fraction, std::string_view) {
    EXPECT_GE(fraction, last);
    last = fraction;
    ++calls;
    return true;
  };
  build_clusters(items.input(), limits(32, 128), options);
  EXPECT_EQ(last, 1.0f);
  EXPECT_GT(calls, 2);
  for (const int at : {1, 2, 3}) {
    int left = at;
    options.progress = [&](float, std::string_view) { return --left > 0; };
    try {
      build_clusters(items.input(), limits(32, 128), options);
      ADD_FAILURE() << "not cancelled";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    }
  }
}

TEST(Bisect, sampled_overlap_agrees_with_the_area_ratio) {
  const Items items = random_items(5000, 22);
  const ClusterMetrics m = cluster_metrics(items.input(), cluster(items, limits(32, 128)), 128);
  EXPECT_NEAR(m.overlap, m.surface_area_ratio, 0.05 * m.surface_area_ratio);
}

TEST(Morton, clusters_are_full_and_hold_every_triangle_once) {
  const Mesh mesh = grid(123, 77, 3.0f);
  const Clusters c = cluster_mesh_morton(mesh.view(), limits(1, 100));
  const Items items = items_of(mesh);
  expect_valid(items, limits(100, 100), c);
}

}  // namespace
}  // namespace umbel
