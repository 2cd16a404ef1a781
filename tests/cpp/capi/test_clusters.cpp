// The C interface gives what the C++ one gives, and every mistake gives its code and a sentence.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <new>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>

#include "umbel/cluster.hpp"
#include "umbel/umbel.h"
#include "umbel/version.hpp"

namespace umbel {
namespace {

const float kNan = std::numeric_limits<float>::quiet_NaN();

/// A caller's arrays, with the C structs that point at them.
struct Call {
  Call() {
    umbel_cluster_input_init(&input);
    umbel_cluster_config_init(&config);
    umbel_build_options_init(&options);
    umbel_cluster_output_init(&output);
    umbel_cluster_capacity_init(&capacity);
    umbel_cluster_quality_init(&quality);
  }

  void set(const ClusterInput& in) {
    input.item_count = in.boxes.size();
    input.boxes = reinterpret_cast<const umbel_aabb*>(in.boxes.data());
    if (!in.centroids.empty())
      input.centroids = reinterpret_cast<const umbel_vec3*>(in.centroids.data());
    if (!in.connections.ranges.empty()) {
      input.connection_ranges = reinterpret_cast<const umbel_range*>(in.connections.ranges.data());
      input.connection_targets = in.connections.targets.data();
      input.connection_count = in.connections.targets.size();
      if (!in.connections.weights.empty()) input.connection_weights = in.connections.weights.data();
    }
    if (!in.item_vertices.empty()) input.item_vertices = in.item_vertices.data();
    input.vertices_per_item = in.vertices_per_item;
    input.shared_vertex_weight = in.shared_vertex_weight;
    if (!in.segments.empty())
      input.segments = reinterpret_cast<const umbel_range*>(in.segments.data());
    input.segment_count = in.segments.size();
  }

  void set(const ClusterConfig& c) {
    config.min_items = c.min_items;
    config.max_items = c.max_items;
    config.max_vertices = c.max_vertices;
    config.underfill_cost = c.underfill_cost;
    config.overlap_cost = c.overlap_cost;
    config.vertex_underfill_cost = c.vertex_underfill_cost;
    config.presplit_threshold = c.presplit_threshold;
    config.coarse = c.coarse;
  }

  /// Room for `ranges` clusters, `items` items and `segments` segments.
  void reserve(size_t range_room, size_t item_room, size_t segment_room) {
    ranges.assign(range_room, {kNone, kNone});
    items.assign(item_room, kNone);
    segments.assign(segment_room, {kNone, kNone});
    output.ranges = ranges.data();
    output.range_capacity = range_room;
    output.items = items.data();
    output.item_capacity = item_room;
    output.segments = segment_room ? segments.data() : nullptr;
    output.segment_capacity = segment_room;
  }

  umbel_result require() { return umbel_cluster_requirements(&input, &config, &capacity); }
  umbel_result build() { return umbel_cluster_build(&input, &config, &options, &output); }

  /// The two calls.
  umbel_result run() {
    if (const umbel_result result = require()) return result;
    reserve(capacity.ranges, capacity.items, capacity.segments);
    return build();
  }

  Clusters clusters() const {
    Clusters c;
    for (size_t i = 0; i < output.range_count; ++i)
      c.ranges.push_back({ranges[i].offset, ranges[i].count});
    c.items.assign(items.begin(), items.begin() + std::ptrdiff_t(output.item_count));
    for (size_t i = 0; i < output.segment_count; ++i)
      c.segments.push_back({segments[i].offset, segments[i].count});
    return c;
  }

  umbel_cluster_input input;
  umbel_cluster_config config;
  umbel_build_options options;
  umbel_cluster_output output;
  umbel_cluster_capacity capacity;
  umbel_cluster_quality quality;
  std::vector<umbel_range> ranges, segments;
  std::vector<uint32_t> items;
};

void expect_equal(const Clusters& a, const Clusters& b) {
  EXPECT_EQ(a.ranges, b.ranges);
  EXPECT_EQ(a.items, b.items);
  EXPECT_EQ(a.segments, b.segments);
}

/// Random items with anything that an input may have.
struct RandomItems {
  explicit RandomItems(uint32_t seed) : random(seed) {
    const uint32_t count = below(600);
    for (uint32_t i = 0; i < count; ++i) {
      const Vec3 p{unit(), unit(), unit()};
      boxes.push_back({p, {p.x + 0.1f * unit(), p.y + 0.1f * unit(), p.z + 0.1f * unit()}});
      centroids.push_back({unit(), unit(), unit()});
    }
    input.boxes = boxes;
    if (below(2)) input.centroids = centroids;
    if (below(2)) connect(count);
    if (below(2)) add_vertices(count);
    if (below(2)) cut_segments(count);
    config.max_items = 1 + below(40);
    config.min_items = 1 + below(config.max_items);
    config.underfill_cost = unit();
    config.overlap_cost = unit();
    config.vertex_underfill_cost = unit();
    config.presplit_threshold = below(3) ? 0 : 1 + below(300);
    config.coarse = below(2);
    if (!input.item_vertices.empty() && below(2))
      config.max_vertices = input.vertices_per_item + below(30);
  }

  uint32_t below(uint32_t n) { return n ? uint32_t(random() % n) : 0; }
  float unit() { return std::uniform_real_distribution<float>(0, 1)(random); }

  void connect(uint32_t count) {
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t links = below(4);
      ranges.push_back({uint32_t(targets.size()), links});
      for (uint32_t k = 0; k < links; ++k) {
        targets.push_back(below(count));
        weights.push_back(10 * unit());
      }
    }
    input.connections = {ranges, targets, {}};
    if (below(2)) input.connections.weights = weights;
  }

  void add_vertices(uint32_t count) {
    input.vertices_per_item = 1 + below(5);
    for (uint32_t i = 0; i < count * input.vertices_per_item; ++i) vertices.push_back(below(200));
    input.item_vertices = vertices;
    if (count) input.shared_vertex_weight = below(2) ? unit() : 0;
  }

  void cut_segments(uint32_t count) {
    for (uint32_t at = below(5); at < count;) {
      const uint32_t size = std::min(below(200), count - at);
      segments.push_back({at, size});
      at += size + below(3);
    }
    input.segments = segments;
  }

  std::mt19937 random;
  std::vector<Aabb> boxes;
  std::vector<Vec3> centroids;
  std::vector<Range> ranges, segments;
  std::vector<uint32_t> targets, vertices;
  std::vector<float> weights;
  ClusterInput input;
  ClusterConfig config;
};

Mesh grid() {
  Mesh mesh = shapes::terrain(40, 30, 1);
  return mesh;
}

/// Triangles given by their positions.
void set_mesh(Call& call, const Mesh& mesh) {
  call.input.item_count = mesh.triangles.size();
  call.input.item_vertices = mesh.triangles[0].data();
  call.input.vertices_per_item = 3;
  call.input.positions = reinterpret_cast<const umbel_vec3*>(mesh.positions.data());
  call.input.position_count = mesh.positions.size();
}

TEST(Capi, result_equals_the_cpp_result_for_random_input) {
  for (uint32_t seed = 1; seed <= 300; ++seed) {
    const RandomItems items(seed);
    const Clusters expected = build_clusters(items.input, items.config);
    Call call;
    call.set(items.input);
    call.set(items.config);
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    ASSERT_LE(call.output.range_count, call.capacity.ranges) << seed;
    ASSERT_EQ(call.output.item_count, call.capacity.items) << seed;
    ASSERT_EQ(call.output.segment_count, call.capacity.segments) << seed;
    expect_equal(call.clusters(), expected);
    if (HasFailure()) FAIL() << "seed " << seed;
  }
}

TEST(Capi, metrics_equal_the_cpp_metrics_for_random_input) {
  for (uint32_t seed = 1; seed <= 30; ++seed) {
    const RandomItems items(seed);
    const ClusterMetrics expected = cluster_metrics(
        items.input, build_clusters(items.input, items.config), items.config.max_items);
    Call call;
    call.set(items.input);
    call.set(items.config);
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    ASSERT_EQ(
        umbel_cluster_metrics(&call.input, &call.output, items.config.max_items, &call.quality),
        UMBEL_OK)
        << umbel_last_error();
    EXPECT_EQ(call.quality.struct_size, sizeof call.quality);
    EXPECT_EQ(call.quality.clusters, expected.clusters);
    EXPECT_EQ(call.quality.min_size, expected.min_size);
    EXPECT_EQ(call.quality.max_size, expected.max_size);
    EXPECT_EQ(call.quality.max_vertices, expected.max_vertices);
    EXPECT_EQ(call.quality.mean_fill, expected.mean_fill);
    EXPECT_EQ(call.quality.mean_vertices, expected.mean_vertices);
    EXPECT_EQ(call.quality.surface_area_ratio, expected.surface_area_ratio);
    EXPECT_EQ(call.quality.sah, expected.sah);
    EXPECT_EQ(call.quality.overlap, expected.overlap);
    EXPECT_EQ(call.quality.ratio_cut, expected.ratio_cut);
  }
}

TEST(Capi, triangles_given_by_positions_equal_the_cpp_mesh) {
  const Mesh mesh = grid();
  for (const float weight : {0.0f, 1.0f}) {
    Call call;
    set_mesh(call, mesh);
    call.input.shared_vertex_weight = weight;
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    expect_equal(call.clusters(), cluster_mesh(mesh.view(), ClusterConfig{}, weight));
  }
}

TEST(Capi, triangles_given_by_positions_take_segments) {
  const Mesh mesh = grid();
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  const std::vector<Range> segments{{100, 300}, {0, 100}, {500, 0}, {600, 1000}};
  ClusterInput same;
  same.boxes = boxes;
  same.segments = segments;
  Call call;
  set_mesh(call, mesh);
  call.input.segments = reinterpret_cast<const umbel_range*>(segments.data());
  call.input.segment_count = segments.size();
  ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
  expect_equal(call.clusters(), build_clusters(same, ClusterConfig{}));
  EXPECT_EQ(umbel_cluster_metrics(&call.input, &call.output, 128, &call.quality), UMBEL_OK);
}

TEST(Capi, result_does_not_depend_on_threads) {
  const Mesh mesh = shapes::blob(5, 1);
  Clusters first;
  for (const uint32_t threads : {1u, 2u, 8u}) {
    Call call;
    set_mesh(call, mesh);
    call.options.threads = threads;
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    if (threads == 1) first = call.clusters();
    expect_equal(call.clusters(), first);
  }
}

TEST(Capi, defaults_are_the_cpp_defaults) {
  const Mesh mesh = grid();
  Call call;
  set_mesh(call, mesh);
  ASSERT_EQ(umbel_cluster_requirements(&call.input, nullptr, &call.capacity), UMBEL_OK);
  call.reserve(call.capacity.ranges, call.capacity.items, 0);
  ASSERT_EQ(umbel_cluster_build(&call.input, nullptr, nullptr, &call.output), UMBEL_OK);
  call.output.segment_count = 0;
  Clusters expected = cluster_mesh(mesh.view(), ClusterConfig{});
  expected.segments.clear();
  expect_equal(call.clusters(), expected);
}

TEST(Capi, presets_are_the_cpp_presets) {
  const Mesh mesh = grid();
  for (const char* name : {"quality", "fast", "exact"}) {
    Call call;
    set_mesh(call, mesh);
    ASSERT_EQ(umbel_cluster_config_preset(&call.config, name, 48), UMBEL_OK);
    EXPECT_EQ(call.config.struct_size, sizeof call.config);
    ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    expect_equal(call.clusters(), cluster_mesh(mesh.view(), cluster_preset(name, 48)));
  }
}

TEST(Capi, empty_input_gives_an_empty_result) {
  Call call;
  ASSERT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
  EXPECT_EQ(call.output.range_count, 0u);
  EXPECT_EQ(call.output.item_count, 0u);
  EXPECT_EQ(call.output.segment_count, 0u);
  EXPECT_EQ(umbel_cluster_metrics(&call.input, &call.output, 128, &call.quality), UMBEL_OK);
  EXPECT_EQ(call.quality.clusters, 0u);
}

// ---- mistakes -----------------------------------------------------------------------------------

/// A call that would succeed, to be broken in one place.
struct GoodCall : Call {
  GoodCall() : mesh(grid()), boxes(triangle_boxes(mesh.view())) {
    input.item_count = boxes.size();
    input.boxes = reinterpret_cast<const umbel_aabb*>(boxes.data());
    input.item_vertices = mesh.triangles[0].data();
    input.vertices_per_item = 3;
    reserve(boxes.size(), boxes.size(), 2);
  }
  Mesh mesh;
  std::vector<Aabb> boxes;
};

void expect_failure(umbel_result result, umbel_result expected, const char* named) {
  EXPECT_EQ(result, expected) << umbel_last_error();
  EXPECT_NE(std::string(umbel_last_error()).find(named), std::string::npos)
      << "`" << umbel_last_error() << "` does not name " << named;
}

/// Breaks a good call, and expects the result, the sentence and untouched arrays.
void expect_build_failure(const std::function<void(GoodCall&)>& spoil, umbel_result expected,
                          const char* named) {
  GoodCall call;
  spoil(call);
  expect_failure(call.build(), expected, named);
  for (const uint32_t item : call.items) ASSERT_EQ(item, kNone) << named;
  for (const umbel_range& range : call.ranges) ASSERT_EQ(range.offset, kNone) << named;
}

TEST(CapiMistakes, good_call_is_good) {
  GoodCall call;
  EXPECT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
}

TEST(CapiMistakes, invalid_arguments_are_named) {
  const std::pair<std::function<void(GoodCall&)>, const char*> cases[] = {
      {[](GoodCall& c) { c.input.boxes = nullptr; }, "input->boxes"},
      {[](GoodCall& c) { c.input.item_count = size_t(1) << 32; }, "item_count"},
      {[](GoodCall& c) { c.input.vertices_per_item = 0; }, "vertices_per_item"},
      {[](GoodCall& c) { c.input.segment_count = 1; }, "input->segments"},
      {[](GoodCall& c) { c.input.connection_count = 1; }, "connection_ranges"},
      {[](GoodCall& c) {
         static const std::vector<umbel_range> ranges(c.boxes.size(), umbel_range{0, 0});
         c.input.connection_ranges = ranges.data();
         c.input.connection_count = 7;
       },
       "connection_targets"},
      {[](GoodCall& c) { c.input.shared_vertex_weight = -1; }, "shared_vertex_weight"},
      {[](GoodCall& c) { c.input.shared_vertex_weight = kNan; }, "shared_vertex_weight"},
      {[](GoodCall& c) {
         static const umbel_range segment{5, 0xfffffff0u};
         c.input.segments = &segment;
         c.input.segment_count = 1;
       },
       "segments[0]"},
      {[](GoodCall& c) {
         static const umbel_range segments[2] = {{5, 10}, {14, 10}};
         c.input.segments = segments;
         c.input.segment_count = 2;
       },
       "segments overlap"},
      {[](GoodCall& c) {
         c.input.positions = reinterpret_cast<const umbel_vec3*>(c.mesh.positions.data());
         c.input.position_count = c.mesh.positions.size();
       },
       "both boxes and positions"},
      {[](GoodCall& c) {
         set_mesh(c, c.mesh);
         c.input.boxes = nullptr;
         c.input.vertices_per_item = 4;
       },
       "vertices_per_item must be 3"},
      {[](GoodCall& c) {
         set_mesh(c, c.mesh);
         c.input.boxes = nullptr;
         c.input.item_vertices = nullptr;
       },
       "item_vertices is NULL"},
      {[](GoodCall& c) { c.config.min_items = 0; }, "min_items"},
      {[](GoodCall& c) { c.config.max_items = 0; }, "max_items"},
      {[](GoodCall& c) { c.config.min_items = 200; }, "min_items"},
      {[](GoodCall& c) { c.config.max_vertices = 2; }, "max_vertices"},
      {[](GoodCall& c) { c.config.underfill_cost = kNan; }, "underfill_cost"},
      {[](GoodCall& c) { c.config.overlap_cost = 1.5f; }, "overlap_cost"},
      {[](GoodCall& c) { c.config.vertex_underfill_cost = -1; }, "vertex_underfill_cost"},
      {[](GoodCall& c) { c.input.struct_size = 0; }, "input->struct_size"},
      {[](GoodCall& c) { c.config.struct_size = 0xcdcdcdcd; }, "config->struct_size"},
      {[](GoodCall& c) { c.options.struct_size = 4; }, "options->struct_size"},
      {[](GoodCall& c) { c.output.struct_size = 8; }, "output->struct_size"},
      {[](GoodCall& c) { c.output.ranges = nullptr; }, "output->ranges is NULL"},
      {[](GoodCall& c) { c.output.items = nullptr; }, "output->items is NULL"},
      {[](GoodCall& c) { c.output.segments = nullptr; }, "output->segments is NULL"},
  };
  for (const auto& [spoil, named] : cases)
    expect_build_failure(spoil, UMBEL_ERROR_INVALID_ARGUMENT, named);
}

TEST(CapiMistakes, invalid_geometry_is_named) {
  const auto invalid = UMBEL_ERROR_INVALID_MESH;
  expect_build_failure([](GoodCall& c) { c.boxes[17].max.y = kNan; }, invalid, "item 17");
  expect_build_failure([](GoodCall& c) { std::swap(c.boxes[3].min, c.boxes[3].max); }, invalid,
                       "item 3");
  for (const bool segmented : {false, true}) {
    static const umbel_range segment{0, 10};
    const auto by_positions = [=](GoodCall& c) {
      set_mesh(c, c.mesh);
      c.input.boxes = nullptr;
      if (segmented) {
        c.input.segments = &segment;
        c.input.segment_count = 1;
      }
    };
    expect_build_failure(
        [&](GoodCall& c) {
          by_positions(c);
          c.mesh.triangles[9][1] = 1u << 30;
        },
        invalid, "triangle 9");
    expect_build_failure(
        [&](GoodCall& c) {
          by_positions(c);
          c.mesh.positions[c.mesh.triangles[0][0]].z = kNan;
        },
        invalid, "triangle 0");
  }
}

TEST(CapiMistakes, null_structs_are_named) {
  GoodCall c;
  const auto invalid = UMBEL_ERROR_INVALID_ARGUMENT;
  expect_failure(umbel_cluster_build(nullptr, &c.config, &c.options, &c.output), invalid,
                 "input is NULL");
  expect_failure(umbel_cluster_build(&c.input, &c.config, &c.options, nullptr), invalid,
                 "output is NULL");
  expect_failure(umbel_cluster_requirements(nullptr, &c.config, &c.capacity), invalid,
                 "input is NULL");
  expect_failure(umbel_cluster_requirements(&c.input, &c.config, nullptr), invalid,
                 "capacity is NULL");
  expect_failure(umbel_cluster_metrics(nullptr, &c.output, 128, &c.quality), invalid,
                 "input is NULL");
  expect_failure(umbel_cluster_metrics(&c.input, nullptr, 128, &c.quality), invalid,
                 "clusters is NULL");
  expect_failure(umbel_cluster_metrics(&c.input, &c.output, 128, nullptr), invalid,
                 "quality is NULL");
  expect_failure(umbel_cluster_config_preset(nullptr, "fast", 128), invalid, "config is NULL");
  expect_failure(umbel_cluster_config_preset(&c.config, nullptr, 128), invalid, "name is NULL");
  umbel_cluster_config_init_sized(nullptr, sizeof(umbel_cluster_config));
}

TEST(CapiMistakes, presets_that_are_none_leave_the_config) {
  Call call;
  call.config.max_items = 77;
  const auto invalid = UMBEL_ERROR_INVALID_ARGUMENT;
  expect_failure(umbel_cluster_config_preset(&call.config, "best", 128), invalid, "best");
  expect_failure(umbel_cluster_config_preset(&call.config, "fast", 0), invalid, "max_items");
  EXPECT_EQ(call.config.max_items, 77u);
}

TEST(CapiMistakes, small_arrays_are_named_with_what_they_need) {
  GoodCall call;
  ASSERT_EQ(call.require(), UMBEL_OK);
  ASSERT_EQ(call.build(), UMBEL_OK);
  const size_t count = call.boxes.size(), made = call.output.range_count;

  call.reserve(made, count - 1, 1);
  expect_failure(call.build(), UMBEL_ERROR_CAPACITY, "item_capacity");
  EXPECT_EQ(call.output.item_count, count);
  EXPECT_EQ(call.output.range_count, call.capacity.ranges);

  call.reserve(made - 1, count, 1);
  expect_failure(call.build(), UMBEL_ERROR_CAPACITY, "range_capacity");
  EXPECT_EQ(call.output.range_count, made);
  EXPECT_EQ(call.items[0], kNone);
  EXPECT_EQ(call.ranges[0].offset, kNone);

  call.reserve(0, 0, 0);
  call.output.ranges = nullptr;
  call.output.items = nullptr;
  expect_failure(call.build(), UMBEL_ERROR_CAPACITY, "item_capacity");

  const umbel_range segments[2] = {{0, 10}, {10, 10}};
  call.input.segments = segments;
  call.input.segment_count = 2;
  call.reserve(made, count, 1);
  expect_failure(call.build(), UMBEL_ERROR_CAPACITY, "segment_capacity");
  EXPECT_EQ(call.output.segment_count, 2u);

  call.input.segment_count = 0;
  call.reserve(made, count, 1);
  EXPECT_EQ(call.build(), UMBEL_OK) << "exactly enough is enough";
}

TEST(CapiMistakes, clusters_that_are_none_are_named) {
  GoodCall c;
  ASSERT_EQ(c.build(), UMBEL_OK);
  const auto measure = [&] { return umbel_cluster_metrics(&c.input, &c.output, 128, &c.quality); };
  const auto invalid = UMBEL_ERROR_INVALID_ARGUMENT;
  ASSERT_EQ(measure(), UMBEL_OK);
  expect_failure(umbel_cluster_metrics(&c.input, &c.output, 0, &c.quality), invalid, "max_items");
  c.ranges[1].count = 0xffffffffu;
  expect_failure(measure(), invalid, "ranges[1]");
  c.ranges[1].count = 1;
  c.items[2] = 1u << 30;
  expect_failure(measure(), invalid, "items[2]");
  c.output.items = nullptr;
  expect_failure(measure(), invalid, "NULL");
}

// ---- progress, errors and versions --------------------------------------------------------------

struct Heard {
  std::vector<float> fractions;
  std::thread::id thread;
  int most = 1 << 30;
};

int listen(float fraction, const char* stage, void* user) {
  auto* heard = static_cast<Heard*>(user);
  EXPECT_NE(std::string(stage), "");
  EXPECT_EQ(std::this_thread::get_id(), heard->thread);
  heard->fractions.push_back(fraction);
  return int(heard->fractions.size()) < heard->most;
}

TEST(Capi, progress_rises_to_one_and_may_cancel) {
  const Mesh mesh = shapes::blob(5, 1);
  Call call;
  set_mesh(call, mesh);
  Heard heard;
  heard.thread = std::this_thread::get_id();
  call.options.progress = listen;
  call.options.progress_user = &heard;
  ASSERT_EQ(call.run(), UMBEL_OK);
  ASSERT_FALSE(heard.fractions.empty());
  EXPECT_TRUE(std::is_sorted(heard.fractions.begin(), heard.fractions.end()));
  EXPECT_EQ(heard.fractions.back(), 1.0f);

  for (const int most : {1, 2}) {
    heard.fractions.clear();
    heard.most = most;
    expect_failure(call.run(), UMBEL_ERROR_CANCELLED, "cancelled");
    EXPECT_EQ(call.output.range_count, 0u);
    EXPECT_EQ(call.items[0], kNone);
  }
}

template <typename Exception>
int throwing(float, const char*, void*) {
  if constexpr (std::is_constructible_v<Exception, const char*>) {
    throw Exception("thrown by the callback");
  } else {
    throw Exception();
  }
}

TEST(Capi, no_exception_crosses_the_border) {
  GoodCall call;
  call.options.progress = throwing<std::bad_alloc>;
  expect_failure(call.build(), UMBEL_ERROR_OUT_OF_MEMORY, "out of memory");
  call.options.progress = throwing<std::length_error>;
  expect_failure(call.build(), UMBEL_ERROR_OUT_OF_MEMORY, "out of memory");
  call.options.progress = throwing<std::logic_error>;
  expect_failure(call.build(), UMBEL_ERROR_INTERNAL, "thrown by the callback");
  call.options.progress = throwing<int>;
  expect_failure(call.build(), UMBEL_ERROR_INTERNAL, "unknown");
}

TEST(Capi, last_error_belongs_to_its_thread) {
  Call call;
  call.input.struct_size = 0;
  ASSERT_NE(call.build(), UMBEL_OK);
  const std::string here = umbel_last_error();
  EXPECT_NE(here, "");
  std::thread([] {
    EXPECT_STREQ(umbel_last_error(), "");
    EXPECT_EQ(umbel_cluster_config_preset(nullptr, "fast", 1), UMBEL_ERROR_INVALID_ARGUMENT);
  }).join();
  EXPECT_EQ(umbel_last_error(), here);
}

TEST(Capi, sentences_longer_than_their_memory_are_cut) {
  Call call;
  const std::string name(5000, 'x');
  EXPECT_EQ(umbel_cluster_config_preset(&call.config, name.c_str(), 1),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_GT(std::string(umbel_last_error()).size(), 100u);
  EXPECT_LT(std::string(umbel_last_error()).size(), 5000u);
}

TEST(Capi, any_number_of_threads_is_legal) {
  for (const uint32_t threads : {3u, 100000u, 0x7fffffffu, 0x80000000u, 0xffffffffu}) {
    GoodCall call;
    call.options.threads = threads;
    EXPECT_EQ(call.build(), UMBEL_OK) << threads << ": " << umbel_last_error();
  }
}

TEST(Capi, callers_of_a_newer_version_are_served_while_what_is_new_is_zero) {
  struct NewerConfig {
    umbel_cluster_config known;
    uint32_t fresh[4];
  };
  NewerConfig config;
  umbel_cluster_config_init_sized(&config.known, sizeof config);
  EXPECT_EQ(config.known.struct_size, sizeof config);
  EXPECT_EQ(config.known.max_items, 128u);
  EXPECT_EQ(config.fresh[3], 0u);
  GoodCall call;
  ASSERT_EQ(umbel_cluster_build(&call.input, &config.known, nullptr, &call.output), UMBEL_OK);
  config.fresh[2] = 1;
  expect_failure(umbel_cluster_build(&call.input, &config.known, nullptr, &call.output),
                 UMBEL_ERROR_UNSUPPORTED, "config");
}

TEST(Capi, results_have_names) {
  for (int i = 0; i <= UMBEL_ERROR_INTERNAL; ++i)
    EXPECT_STRNE(umbel_result_name(umbel_result(i)), "unknown result") << i;
  EXPECT_STREQ(umbel_result_name(umbel_result(UMBEL_ERROR_INTERNAL + 1)), "unknown result");
}

TEST(Capi, version_is_the_version) { EXPECT_STREQ(umbel_version(), UMBEL_VERSION); }

}  // namespace
}  // namespace umbel
