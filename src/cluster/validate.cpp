#include "cluster/validate.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "base/refuse.hpp"
#include "cluster/source.hpp"

namespace umbel::cluster {
namespace {

void check_fraction(const char* name, float value) {
  // Written so that NaN fails as well.
  if (!(value >= 0.0f && value <= 1.0f))
    refuse(std::string(name) + " must be within [0, 1], not " + printed(value));
}

void check_connections(const ClusterInput& input) {
  const Connections& c = input.connections;
  const size_t items = input.boxes.size();
  if (c.ranges.empty()) {
    if (!c.targets.empty()) refuse("connections have targets but no ranges");
    return;
  }
  if (c.ranges.size() != items)
    refuse("connections.ranges has " + std::to_string(c.ranges.size()) +
           " elements, but there are " + std::to_string(items) + " items");
  if (!c.vertex_bits.empty() && c.vertex_bits.size() != c.targets.size())
    refuse("connections.vertex_bits has " + std::to_string(c.vertex_bits.size()) +
           " elements, but there are " + std::to_string(c.targets.size()) + " targets");
  if (!c.weights.empty() && c.weights.size() != c.targets.size())
    refuse("connections.weights has " + std::to_string(c.weights.size()) +
           " elements, but there are " + std::to_string(c.targets.size()) + " targets");
  for (size_t i = 0; i < items; ++i)
    if (uint64_t(c.ranges[i].offset) + c.ranges[i].count > c.targets.size())
      refuse("connections.ranges[" + std::to_string(i) + "] ends past the " +
             std::to_string(c.targets.size()) + " targets");
  for (size_t i = 0; i < c.targets.size(); ++i)
    if (c.targets[i] >= items)
      refuse("connections.targets[" + std::to_string(i) + "] is " + std::to_string(c.targets[i]) +
             ", but there are " + std::to_string(items) + " items");
  for (size_t i = 0; i < c.weights.size(); ++i)
    if (!(c.weights[i] >= 0.0f && std::isfinite(c.weights[i])))
      refuse("connections.weights[" + std::to_string(i) + "] must be finite and >= 0, not " +
             printed(c.weights[i]));
}

void check_vertex_bits(const ClusterInput& input) {
  const std::span<const uint8_t> bits = input.connections.vertex_bits;
  const uint32_t arity = input.vertices_per_item;
  if (arity < 1 || arity > 8)
    refuse("vertices_per_item must be from 1 to 8 where connections have vertex_bits, not " +
           std::to_string(arity));
  for (size_t i = 0; i < bits.size(); ++i)
    if (bits[i] >> arity)
      refuse("connections.vertex_bits[" + std::to_string(i) + "] is " + std::to_string(bits[i]) +
             ", but items have " + std::to_string(arity) + " vertices");
}

void check_vertex_limit(const ClusterInput& input, const ClusterConfig& config) {
  if (config.max_vertices && config.max_vertices < input.vertices_per_item)
    refuse("max_vertices is " + std::to_string(config.max_vertices) + ", too few for one item of " +
           std::to_string(input.vertices_per_item) + " vertices");
}

void check_vertices(const ClusterInput& input, const ClusterConfig& config) {
  const size_t items = input.boxes.size();
  if (!(input.shared_vertex_weight >= 0.0f && std::isfinite(input.shared_vertex_weight)))
    refuse("shared_vertex_weight must be finite and >= 0, not " +
           printed(input.shared_vertex_weight));
  if (input.item_vertices.empty()) {
    if (items == 0) return;
    const bool has_bits = has_vertex_bits(input);
    if (has_bits) check_vertex_bits(input);
    if (config.max_vertices && !has_bits) refuse("max_vertices is set, but items have no vertices");
    if (input.shared_vertex_weight > 0.0f)
      refuse("shared_vertex_weight is set, but items have no vertices");
    if (has_bits) check_vertex_limit(input, config);
    return;
  }
  if (input.vertices_per_item == 0) refuse("vertices_per_item must be at least 1, not 0");
  if (input.item_vertices.size() != uint64_t(items) * input.vertices_per_item)
    refuse("item_vertices has " + std::to_string(input.item_vertices.size()) + " elements, but " +
           std::to_string(items) + " items of " + std::to_string(input.vertices_per_item) +
           " vertices need " + std::to_string(uint64_t(items) * input.vertices_per_item));
  check_vertex_limit(input, config);
}

void check_segments(const ClusterInput& input) {
  const size_t items = input.boxes.size();
  uint64_t end = 0;
  bool ascending = true;
  for (size_t s = 0; s < input.segments.size(); ++s) {
    const Range& r = input.segments[s];
    if (uint64_t(r.offset) + r.count > items)
      refuse("segments[" + std::to_string(s) + "] ends at " +
             std::to_string(uint64_t(r.offset) + r.count) + ", but there are " +
             std::to_string(items) + " items");
    if (r.count == 0) continue;
    ascending &= r.offset >= end;
    end = uint64_t(r.offset) + r.count;
  }
  if (ascending) return;
  std::vector<Range> sorted;
  for (const Range& r : input.segments)
    if (r.count) sorted.push_back(r);
  std::sort(sorted.begin(), sorted.end(),
            [](const Range& a, const Range& b) { return a.offset < b.offset; });
  for (size_t s = 1; s < sorted.size(); ++s)
    if (sorted[s].offset < sorted[s - 1].offset + sorted[s - 1].count)
      refuse("segments overlap at item " + std::to_string(sorted[s].offset));
}

[[noreturn]] void report_triangle(const MeshView& mesh, size_t i) {
  for (const uint32_t v : mesh.triangles[i]) {
    const std::string what = "triangle " + std::to_string(i) + " uses vertex " + std::to_string(v);
    if (v >= mesh.positions.size())
      throw Error(ErrorCode::kInvalidMesh,
                  what + ", but there are " + std::to_string(mesh.positions.size()) + " positions");
    if (!is_finite(mesh.positions[v]))
      throw Error(ErrorCode::kInvalidMesh, what + ", whose position is NaN or infinite");
  }
  throw Error(ErrorCode::kInvalidMesh, "triangle " + std::to_string(i) + " is invalid");
}

// The box of all positions, where each may be used. Reads everything once and in order.
bool positions_tell(const MeshView& mesh, Box4& box) {
  constexpr size_t kChunk = 1 << 13;
  const size_t triangles = mesh.triangles.size(), positions = mesh.positions.size();
  if (positions / 4 > triangles) return false;
  std::vector<uint8_t> bad((triangles + kChunk - 1) / kChunk, 0);
  parallel_chunks(triangles, kChunk, [&](size_t begin, size_t end) {
    uint32_t last = 0;
    for (size_t i = begin; i < end; ++i)
      for (const uint32_t v : mesh.triangles[i]) last = std::max(last, v);
    bad[begin / kChunk] = last >= positions;
  });
  std::vector<Box4> parts((positions + kChunk - 1) / kChunk);
  parallel_chunks(positions, kChunk, [&](size_t begin, size_t end) {
    Box4 part = Box4::empty();
    Float4 zero{};  // stays 0 unless something is not finite
    for (size_t i = begin; i < end; ++i) {
      const Vec3& p = mesh.positions[i];
      const Float4 point{p.x, p.y, p.z, 0};
      zero += point * Float4{};
      part.extend({point, -point});
    }
    if (!(zero[0] == 0 && zero[1] == 0 && zero[2] == 0)) part.low = splat(-HUGE_VALF);
    parts[begin / kChunk] = part;
  });
  for (const Box4& part : parts) box.extend(part);
  return std::find(bad.begin(), bad.end(), 1) == bad.end() && box.low[3] == 0;
}

// The box of all positions that are used.
Box4 check_corners(const MeshView& mesh) {
  const auto is_valid = [&](const Triangle& t) {
    for (const uint32_t v : t)
      if (v >= mesh.positions.size() || !is_finite(mesh.positions[v])) return false;
    return true;
  };
  constexpr size_t kChunk = 1 << 14;
  struct Summary {
    Box4 box = Box4::empty();
    bool bad = false;
  };
  std::vector<Summary> parts((mesh.triangles.size() + kChunk - 1) / kChunk);
  parallel_chunks(mesh.triangles.size(), kChunk, [&](size_t begin, size_t end) {
    Summary part;
    Float4 zero{};  // stays 0 unless something is not finite
    for (size_t i = begin; i < end; ++i) {
      for (const uint32_t v : mesh.triangles[i]) {
        if (v >= mesh.positions.size()) {
          part.bad = true;
          continue;
        }
        const Vec3& p = mesh.positions[v];
        const Float4 point{p.x, p.y, p.z, 0};
        zero += point * Float4{};
        part.box.extend({point, -point});
      }
    }
    part.bad |= !(zero[0] == 0 && zero[1] == 0 && zero[2] == 0);
    parts[begin / kChunk] = part;
  });
  Box4 all = Box4::empty();
  for (size_t c = 0; c < parts.size(); ++c) {
    all.extend(parts[c].box);
    if (!parts[c].bad) continue;
    for (size_t i = c * kChunk;; ++i)
      if (!is_valid(mesh.triangles[i])) report_triangle(mesh, i);
  }
  return all;
}

// Of the boxes and centroids in [begin, end), without saying what is wrong.
bool are_valid(const ClusterInput& input, size_t begin, size_t end) {
  Float4 zero{};  // stays 0 unless something is not finite
  bool valid = true;
  for (size_t i = begin; i < end; ++i) {
    const Box4 box = Box4::from(input.boxes[i]);
    zero += box.low * Float4{} + box.negated_high * Float4{};
    valid &= !is_empty(input.boxes[i]);
    if (input.centroids.empty()) continue;
    const Vec3& c = input.centroids[i];
    zero += Float4{c.x, c.y, c.z, 0} * Float4{};
  }
  return valid && zero[0] == 0 && zero[1] == 0 && zero[2] == 0;
}

}  // namespace

void validate_config(const ClusterConfig& config) {
  if (config.min_items == 0) refuse("min_items must be at least 1, not 0");
  if (config.max_items == 0) refuse("max_items must be at least 1, not 0");
  if (config.min_items > config.max_items)
    refuse("min_items is " + std::to_string(config.min_items) + ", more than max_items, " +
           std::to_string(config.max_items));
  check_fraction("underfill_cost", config.underfill_cost);
  check_fraction("overlap_cost", config.overlap_cost);
  check_fraction("vertex_underfill_cost", config.vertex_underfill_cost);
}

void validate_layout(const ClusterInput& input, const ClusterConfig& config) {
  // The last index is kNone, "no such element".
  if (input.boxes.size() >= kNone)
    refuse("there are " + std::to_string(input.boxes.size()) +
           " items, more than 32-bit indices can name");
  if (!input.centroids.empty() && input.centroids.size() != input.boxes.size())
    refuse("centroids has " + std::to_string(input.centroids.size()) + " elements, but there are " +
           std::to_string(input.boxes.size()) + " boxes");
  check_connections(input);
  check_vertices(input, config);
  check_segments(input);
}

Box4 validate_triangles(const MeshView& mesh, const ClusterConfig& config,
                        float shared_vertex_weight) {
  if (mesh.triangles.size() >= kNone)
    refuse("there are " + std::to_string(mesh.triangles.size()) +
           " triangles, more than 32-bit indices can name");
  if (!(shared_vertex_weight >= 0.0f && std::isfinite(shared_vertex_weight)))
    refuse("shared_vertex_weight must be finite and >= 0, not " + printed(shared_vertex_weight));
  if (config.max_vertices && config.max_vertices < 3)
    refuse("max_vertices is " + std::to_string(config.max_vertices) + ", too few for one triangle");
  Box4 box = Box4::empty();
  if (!positions_tell(mesh, box)) box = check_corners(mesh);
  return box;
}

void validate_boxes(const ClusterInput& input, size_t begin, size_t end) {
  if (are_valid(input, begin, end)) return;
  for (size_t i = begin; i < end; ++i) {
    const Aabb& b = input.boxes[i];
    const std::string item = "item " + std::to_string(i);
    if (!is_finite(b.min) || !is_finite(b.max))
      throw Error(ErrorCode::kInvalidMesh, "the box of " + item + " has a NaN or infinite corner");
    if (is_empty(b))
      throw Error(ErrorCode::kInvalidMesh, "the box of " + item + " has its min above its max");
    if (!input.centroids.empty() && !is_finite(input.centroids[i]))
      throw Error(ErrorCode::kInvalidMesh, "the centroid of " + item + " is NaN or infinite");
  }
}

void validate_all_boxes(const ClusterInput& input) {
  constexpr size_t kChunk = 1 << 14;
  const size_t count = input.boxes.size();
  std::vector<uint8_t> bad((count + kChunk - 1) / kChunk, 0);
  parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
    bad[begin / kChunk] = !are_valid(input, begin, end);
  });
  // The first offender is named, whichever thread finds one first.
  for (size_t c = 0; c < bad.size(); ++c)
    if (bad[c]) validate_boxes(input, c * kChunk, std::min(count, (c + 1) * kChunk));
}

}  // namespace umbel::cluster
