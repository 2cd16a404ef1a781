// A call of the C interface's cluster functions, and inputs for it.
#pragma once

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <string>

#include "umbel/cluster.hpp"
#include "umbel/umbel.h"

namespace umbel::cluster_call {

inline const float kNan = std::numeric_limits<float>::quiet_NaN();

/// A caller's arrays, with the C structs that point at them.
struct Call {
  Call() {
    umbel_cluster_input_init(&input);
    umbel_cluster_config_init(&config);
    umbel_build_options_init(&options);
    umbel_cluster_output_init(&output);
    umbel_cluster_capacity_init(&capacity);
    umbel_cluster_metrics_init(&metrics);
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
      if (!in.connections.vertex_bits.empty())
        input.connection_vertex_bits = in.connections.vertex_bits.data();
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
  umbel_cluster_metrics metrics;
  std::vector<umbel_range> ranges, segments;
  std::vector<uint32_t> items;
};

inline void expect_equal(const Clusters& a, const Clusters& b) {
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
    if ((!input.item_vertices.empty() || !bits.empty()) && below(2))
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
    if (!targets.empty() && below(2)) {
      input.vertices_per_item = 1 + below(5);
      for (size_t k = 0; k < targets.size(); ++k)
        bits.push_back(static_cast<uint8_t>(below(1u << input.vertices_per_item)));
      input.connections.vertex_bits = bits;
    }
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
  std::vector<uint8_t> bits;
  ClusterInput input;
  ClusterConfig config;
};

inline Mesh grid() {
  Mesh mesh = shapes::terrain(40, 30, 1);
  return mesh;
}

/// Triangles given by their positions.
inline void set_mesh(Call& call, const Mesh& mesh) {
  call.input.item_count = mesh.triangles.size();
  call.input.item_vertices = mesh.triangles[0].data();
  call.input.vertices_per_item = 3;
  call.input.positions = reinterpret_cast<const umbel_vec3*>(mesh.positions.data());
  call.input.position_count = mesh.positions.size();
}

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

inline void expect_failure(umbel_result result, umbel_result expected, const char* named) {
  EXPECT_EQ(result, expected) << umbel_last_error();
  EXPECT_NE(std::string(umbel_last_error()).find(named), std::string::npos)
      << "`" << umbel_last_error() << "` does not name " << named;
}

}  // namespace umbel::cluster_call
