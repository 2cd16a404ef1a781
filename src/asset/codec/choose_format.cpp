#include "asset/codec/choose_format.hpp"

#include <algorithm>
#include <cmath>

#include "base/printed.hpp"

namespace umbel::asset {
namespace {

// Integers up to this are exact as floats.
constexpr float kExactSteps = 0x1p24f;
// Weights of joints are stored exactly where texture coordinates are, else as multiples of this.
constexpr float kWeightStep = 0x1p-14f;

void check_bits(const char* name, uint32_t bits) {
  if (bits != 0 && (bits < 2 || bits > 16))
    throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(bits) +
                                                 ", but must be 0 or from 2 to 16");
}

bool is_power_of_two(float f) {
  int exponent = 0;
  return f > 0 && std::isfinite(f) && std::frexp(f, &exponent) == 0.5f;
}

bool is_on_grid(float value, float step) {
  const float steps = value / step;
  return std::fabs(steps) <= kExactSteps && std::nearbyint(steps) == steps;
}

ValueRange range_of(const auto& for_each) {
  ValueRange range;
  for_each([&](float value) {
    range.largest = std::max(range.largest, std::fabs(value));
    range.is_finite &= std::isfinite(value);
  });
  return range;
}

/// Positions as multiples of the grid step that they were snapped to, else floats. Coordinates of
/// more steps than floats can count stay floats.
AttributeFormat positions_of(const StreamStatistics& streams, float step) {
  if (step == 0 || !streams.positions_on_grid) return {kPositions, Coding::kFloats, 0, 0};
  return {kPositions, Coding::kGrid, 0, step};
}

/// The requested step, or the next larger power of two that the largest value needs.
AttributeFormat on_grid_of(uint32_t attribute, uint32_t set, const ValueRange& range, float step) {
  if (step == 0 || !range.is_finite) return {attribute, Coding::kFloats, 0, 0, set};
  while (range.largest / step > kExactSteps) step *= 2;
  return {attribute, Coding::kGrid, 0, step, set};
}

/// Those of a kind. Joints and materials are whole numbers.
void add_extras(const VertexStatistics& vertices, ExtraKind kind, float step,
                std::vector<AttributeFormat>& out) {
  for (size_t i = 0; i < vertices.extras.size(); ++i)
    if (vertices.extras[i].kind == kind)
      out.push_back(on_grid_of(static_cast<uint32_t>(kind), vertices.extras[i].set,
                               vertices.extra_ranges[i], step));
}

AttributeFormat with_bits(uint32_t attribute, Coding coding, uint32_t bits) {
  if (bits == 0) return {attribute, Coding::kFloats, 0, 0};
  return {attribute, coding, bits, 0};
}

}  // namespace

VertexStatistics vertex_statistics(const Mesh& vertices, float position_step) {
  VertexStatistics all;
  StreamStatistics& streams = all.streams;
  streams.normals = !vertices.normals.empty();
  streams.tangents = !vertices.tangents.empty();
  streams.uvs = !vertices.uvs.empty();
  streams.colors = !vertices.colors.empty();
  streams.positions_on_grid =
      position_step == 0 || std::ranges::all_of(vertices.positions, [&](const Vec3& p) {
        return is_on_grid(p.x, position_step) && is_on_grid(p.y, position_step) &&
               is_on_grid(p.z, position_step);
      });
  const auto fits = [](float f) { return f >= 0 && f <= 1; };
  streams.colors_in_range = std::ranges::all_of(vertices.colors, [&](const Vec4& c) {
    return fits(c.x) && fits(c.y) && fits(c.z) && fits(c.w);
  });
  streams.uv_range = range_of([&](const auto& visit) {
    for (const Vec2& uv : vertices.uvs) visit(uv.x), visit(uv.y);
  });
  all.extras = vertices.extras;
  const size_t width = extra_width(vertices.extras);
  size_t at = 0;
  for (const Extra& extra : vertices.extras) {
    const size_t count = extra_width(extra.kind);
    all.extra_ranges.push_back(range_of([&](const auto& visit) {
      for (size_t v = 0; v < vertices.positions.size(); ++v)
        for (size_t k = 0; k < count; ++k) visit(vertices.extra_values[v * width + at + k]);
    }));
    at += count;
  }
  return all;
}

void add(VertexStatistics& sum, const VertexStatistics& more) {
  const auto join = [](ValueRange& range, const ValueRange& other) {
    range.largest = std::max(range.largest, other.largest);
    range.is_finite &= other.is_finite;
  };
  sum.streams.normals |= more.streams.normals;
  sum.streams.tangents |= more.streams.tangents;
  sum.streams.uvs |= more.streams.uvs;
  sum.streams.colors |= more.streams.colors;
  sum.streams.positions_on_grid &= more.streams.positions_on_grid;
  sum.streams.colors_in_range &= more.streams.colors_in_range;
  join(sum.streams.uv_range, more.streams.uv_range);
  if (sum.extras.empty()) {
    sum.extras = more.extras;
    sum.extra_ranges = more.extra_ranges;
    return;
  }
  for (size_t i = 0; i < more.extras.size(); ++i) join(sum.extra_ranges[i], more.extra_ranges[i]);
}

VertexFormat choose_format(const VertexStatistics& vertices, float position_step,
                           const AssetConfig& config) {
  check_bits("normal_bits", config.normal_bits);
  check_bits("tangent_bits", config.tangent_bits);
  check_bits("color_bits", config.color_bits);
  if (config.uv_step != 0 && !is_power_of_two(config.uv_step))
    throw Error(ErrorCode::kInvalidArgument,
                "uv_step is " + printed(config.uv_step) + ", but must be 0 or a power of two");
  const StreamStatistics& streams = vertices.streams;
  std::vector<AttributeFormat> attributes{positions_of(streams, position_step)};
  const bool octahedral = streams.normals && config.normal_bits > 0;
  if (streams.normals)
    attributes.push_back(with_bits(kNormals, Coding::kOctahedral, config.normal_bits));
  if (streams.tangents)
    attributes.push_back(
        with_bits(kTangents, Coding::kAngle, octahedral ? config.tangent_bits : 0));
  if (streams.uvs) attributes.push_back(on_grid_of(kUvs, 0, streams.uv_range, config.uv_step));
  add_extras(vertices, ExtraKind::kUvs, config.uv_step, attributes);
  if (streams.colors)
    attributes.push_back(
        with_bits(kColors, Coding::kSrgb, streams.colors_in_range ? config.color_bits : 0));
  add_extras(vertices, ExtraKind::kJoints, 1.0f, attributes);
  add_extras(vertices, ExtraKind::kWeights, config.uv_step > 0 ? kWeightStep : 0.0f, attributes);
  add_extras(vertices, ExtraKind::kMaterial, 1.0f, attributes);
  return make_format(std::move(attributes));
}

VertexFormat choose_format(const lod::Dag& dag, const AssetConfig& config) {
  const float step = dag.config.position_step;
  return choose_format(vertex_statistics(dag.vertices, step), step, config);
}

}  // namespace umbel::asset
