// Fuzzes the C interface of clusters: the bytes become boxes (NaN, infinite and huge ones among
// them), vertices, connections, segments and a config; whatever is accepted must be a partition
// within its limits, and the same for any number of threads.
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "c_interface.hpp"

namespace {

using umbel::fuzz::expect;

class Case {
 public:
  Case(const uint8_t* data, size_t size) : bytes_(data, size) {
    umbel_cluster_input_init(&input);
    umbel_cluster_config_init(&config);
    // Seldom large, because that is slow: nodes beyond 8192 items are split by another search.
    count_ = bytes_.integral_in_range<uint32_t>(0, 700);
    if (bytes_.integral<uint8_t>() < 12) count_ *= 32;
    mood_ = bytes_.integral<uint8_t>();
    read_config();
    read_segments();
    read_vertices();
    read_connections();
    read_boxes();
    input.item_count = count_;
  }

  uint32_t count() const { return count_; }
  std::vector<umbel_range> segments_or_all() const {
    if (!segments_.empty()) return segments_;
    if (count_ == 0) return {};
    return {umbel_range{0, count_}};
  }

  umbel_cluster_input input;
  umbel_cluster_config config;

 private:
  bool likes(int bit) const { return mood_ >> bit & 1; }

  void read_config() {
    if (likes(0)) {
      config.max_items = bytes_.integral_in_range<uint32_t>(1, 300);
      config.min_items = bytes_.integral_in_range<uint32_t>(1, config.max_items);
    } else {
      config.max_items = bytes_.integral<uint32_t>();
      config.min_items = bytes_.integral<uint32_t>();
    }
    config.max_vertices = likes(1) ? bytes_.integral<uint16_t>() % 400 : 0;
    for (float* cost :
         {&config.underfill_cost, &config.overlap_cost, &config.vertex_underfill_cost})
      *cost = likes(0) ? bytes_.probability() : number();
    config.presplit_threshold = bytes_.integral<uint16_t>() % 2000;
    config.coarse = bytes_.integral<uint8_t>() % 2;
  }

  void read_segments() {
    if (!likes(2)) return;
    const uint32_t number = bytes_.integral_in_range<uint32_t>(0, 20);
    for (uint32_t s = 0, at = 0; s < number; ++s) {
      umbel_range range{at, bytes_.integral_in_range<uint32_t>(0, 400)};
      if (bytes_.integral<uint8_t>() == 0) range.offset = bytes_.integral<uint32_t>();
      range.count = std::min(range.count, count_ - std::min(count_, range.offset));
      at = std::min(count_, range.offset + range.count);
      segments_.push_back(range);
    }
    input.segments = segments_.data();
    input.segment_count = segments_.size();
  }

  void read_vertices() {
    if (!likes(3)) return;
    input.vertices_per_item = bytes_.integral_in_range<uint32_t>(1, 6);
    const uint32_t different = bytes_.integral_in_range<uint32_t>(0, 5000);
    vertices_.resize(size_t(count_) * input.vertices_per_item);
    for (uint32_t& v : vertices_) {
      v = noise();
      if (different) v %= different;
    }
    vertices_.resize(std::max<size_t>(vertices_.size(), 1));
    input.item_vertices = vertices_.data();
    if (likes(4)) input.shared_vertex_weight = number();
  }

  void read_connections() {
    const uint32_t count = count_;
    if (!likes(5) || count == 0) return;
    const uint32_t most = bytes_.integral<uint8_t>() % 13;
    const bool wild = bytes_.integral<uint8_t>() == 0;
    const float heavy = number();
    for (uint32_t i = 0; i < count; ++i) {
      const umbel_range range{uint32_t(targets_.size()), most ? noise() % (most + 1) : 0};
      for (uint32_t k = 0; k < range.count; ++k) {
        targets_.push_back(wild ? noise() : noise() % count);
        weights_.push_back(noise() % 16 ? float(noise() % 100) : heavy);
      }
      ranges_.push_back(range);
    }
    if (wild) ranges_[noise() % count].count = noise();
    input.connection_ranges = ranges_.data();
    input.connection_targets = targets_.data();
    input.connection_count = targets_.size();
    if (noise() % 2) input.connection_weights = weights_.data();
  }

  // Some boxes from the bytes, and the others made of those, so that few bytes make many items.
  void read_boxes() {
    const uint32_t grid = bytes_.integral_in_range<uint32_t>(1, 64);
    const float step = number();
    for (uint32_t i = 0; i < count_; ++i) {
      float v[6];
      const bool own = bytes_.remaining_bytes() > 8;
      for (float& x : v) x = own ? number() : (likes(6) ? step : 1.0f) * float(noise() % grid);
      // Mostly legal, or nothing beyond the checks would ever run.
      if (noise() % 256)
        for (int k = 0; k < 3; ++k)
          if (v[k] > v[k + 3]) std::swap(v[k], v[k + 3]);
      boxes_.push_back({{v[0], v[1], v[2]}, {v[3], v[4], v[5]}});
      centroids_.push_back({v[0], v[4], v[2]});
    }
    input.boxes = boxes_.data();
    if (likes(7)) input.centroids = centroids_.data();
  }

  float number() {
    constexpr float kSpecial[] = {
        0.0f,   -0.0f,       1.0f,       -1.0f,
        1e18f,  -1e18f,      3e38f,      -3e38f,
        1e-38f, 1e-45f,      HUGE_VALF,  1e30f,
        1e-30f, 16777216.0f, -HUGE_VALF, std::numeric_limits<float>::quiet_NaN()};
    const uint8_t kind = bytes_.integral<uint8_t>();
    if (kind < 16) return kSpecial[kind];
    if (kind < 32) return kSpecial[kind % 16 % 14] * 0.5f;
    if (kind < 128) return float(kind - 64);
    return float(bytes_.integral<int16_t>()) / 64.0f;
  }

  uint32_t noise() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u + mood_;
    return uint32_t(state_ >> 33);
  }

  umbel::fuzz::DataProvider bytes_;
  uint32_t count_ = 0;
  uint8_t mood_ = 0;
  uint64_t state_ = 1;
  std::vector<umbel_aabb> boxes_;
  std::vector<umbel_vec3> centroids_;
  std::vector<umbel_range> segments_, ranges_;
  std::vector<uint32_t> vertices_, targets_;
  std::vector<float> weights_;
};

struct Result {
  std::vector<umbel_range> ranges, segments;
  std::vector<uint32_t> items;
  umbel_cluster_output output;
};

umbel_result build(const Case& c, const umbel_cluster_capacity& room, uint32_t threads,
                   Result& result) {
  // Exactly as much as is said to be enough, so that the sanitizer sees what goes beyond.
  result.ranges.resize(room.ranges);
  result.items.resize(room.items);
  result.segments.resize(room.segments);
  umbel_cluster_output_init(&result.output);
  result.output.ranges = result.ranges.data();
  result.output.range_capacity = room.ranges;
  result.output.items = result.items.data();
  result.output.item_capacity = room.items;
  result.output.segments = result.segments.data();
  result.output.segment_capacity = room.segments;
  umbel_build_options options;
  umbel_build_options_init(&options);
  options.threads = threads;
  return umbel_cluster_build(&c.input, &c.config, &options, &result.output);
}

void check_vertices(const Case& c, const Result& r, const umbel_range& range) {
  if (c.config.max_vertices == 0 || range.count <= 1) return;
  std::set<uint32_t> unique;
  for (uint32_t i = range.offset; i < range.offset + range.count; ++i) {
    const uint32_t* v = c.input.item_vertices + size_t(r.items[i]) * c.input.vertices_per_item;
    unique.insert(v, v + c.input.vertices_per_item);
  }
  expect(unique.size() <= c.config.max_vertices, "too many vertices in a cluster");
}

void check_segment(const Case& c, const Result& r, const umbel_range& segment,
                   const umbel_range& clusters, std::vector<uint8_t>& seen) {
  uint32_t at = segment.offset, small = 0;
  for (uint32_t k = clusters.offset; k < clusters.offset + clusters.count; ++k) {
    const umbel_range& range = r.ranges[k];
    expect(range.offset == at, "clusters of a segment do not follow each other");
    expect(range.count >= 1 && range.count <= c.config.max_items, "a cluster of an illegal size");
    small += range.count < c.config.min_items;
    at += range.count;
    check_vertices(c, r, range);
    for (uint32_t i = range.offset; i < at; ++i) {
      const uint32_t item = r.items[i];
      expect(item >= segment.offset && item - segment.offset < segment.count,
             "an item left its segment");
      expect(!seen[item]++, "an item is in two clusters");
    }
  }
  expect(at == segment.offset + segment.count, "clusters do not cover their segment");
  if (c.config.max_vertices == 0) expect(small <= 1, "two undersized clusters in a segment");
}

void check(const Case& c, const Result& r) {
  const std::vector<umbel_range> segments = c.segments_or_all();
  expect(r.output.item_count == c.count(), "not all items came back");
  expect(r.output.segment_count == segments.size(), "not all segments came back");
  std::vector<uint8_t> seen(c.count(), 0);
  for (size_t s = 0; s < segments.size(); ++s)
    check_segment(c, r, segments[s], r.segments[s], seen);
  for (uint32_t i = 0; i < c.count(); ++i) {
    if (seen[i]) continue;
    bool inside = false;
    for (const umbel_range& s : segments) inside |= i >= s.offset && i - s.offset < s.count;
    expect(!inside && r.items[i] == i, "an item of no segment moved, or one of a segment is lost");
  }
}

bool same(const Result& a, const Result& b) {
  const auto equal = [](const umbel_range& x, const umbel_range& y) {
    return x.offset == y.offset && x.count == y.count;
  };
  return a.output.range_count == b.output.range_count && a.items == b.items &&
         std::equal(a.ranges.begin(), a.ranges.begin() + std::ptrdiff_t(a.output.range_count),
                    b.ranges.begin(), equal);
}

void expect_refusal(umbel_result result) {
  expect(result == UMBEL_ERROR_INVALID_ARGUMENT || result == UMBEL_ERROR_INVALID_MESH,
         "a failure that is not the input's fault");
  expect(umbel_last_error()[0] != '\0', "a failure without a sentence");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const Case c(data, size);
  umbel_cluster_capacity room;
  umbel_cluster_capacity_init(&room);
  if (const umbel_result result = umbel_cluster_requirements(&c.input, &c.config, &room)) {
    expect_refusal(result);
    return 0;
  }
  expect(room.ranges <= c.count(), "more clusters than items");
  Result one, two;
  if (const umbel_result result = build(c, room, 1, one)) {
    expect_refusal(result);
    return 0;
  }
  check(c, one);
  expect(build(c, room, 2, two) == UMBEL_OK && same(one, two), "threads change the result");
  // Thousands of lines against all boxes: slow under the sanitizers.
  if (size % 16 != 0) return 0;
  umbel_cluster_metrics metrics;
  umbel_cluster_metrics_init(&metrics);
  expect(umbel_cluster_get_metrics(&c.input, &one.output, c.config.max_items, &metrics) == UMBEL_OK,
         "clusters that cannot be measured");
  expect(metrics.clusters == one.output.range_count && metrics.mean_fill <= 1.0, "wrong metrics");
  return 0;
}
