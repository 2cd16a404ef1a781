#include "asset/codec/choose_format.hpp"

#include <algorithm>
#include <cmath>

namespace umbel::asset {
namespace {

// Integers up to this are exact as floats.
constexpr float kMostSteps = 0x1p24f;
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
  return std::fabs(steps) <= kMostSteps && std::nearbyint(steps) == steps;
}

/// Positions as multiples of the grid step that they were snapped to, else floats.
AttributeFormat positions_of(const lod::Dag& dag) {
  const float step = dag.config.position_step;
  if (step == 0) return {kPositions, Coding::kFloats, 0, 0};
  const auto on_grid = [&](const Vec3& p) {
    return is_on_grid(p.x, step) && is_on_grid(p.y, step) && is_on_grid(p.z, step);
  };
  const auto& positions = dag.vertices.positions;
  // Coordinates of more steps than floats can count stay floats.
  const bool all = std::all_of(positions.begin(), positions.end(), on_grid);
  return all ? AttributeFormat{kPositions, Coding::kGrid, 0, step}
             : AttributeFormat{kPositions, Coding::kFloats, 0, 0};
}

/// The requested step, or the next larger power of two that the largest value needs.
AttributeFormat on_grid_of(uint32_t attribute, uint32_t set, const auto& for_each, float step) {
  float largest = 0;
  bool finite = true;
  for_each([&](float value) {
    largest = std::max(largest, std::fabs(value));
    finite &= std::isfinite(value);
  });
  while (finite && step > 0 && largest / step > kMostSteps) step *= 2;
  if (step > 0 && finite) return {attribute, Coding::kGrid, 0, step, set};
  return {attribute, Coding::kFloats, 0, 0, set};
}

AttributeFormat uvs_of(const std::vector<Vec2>& uvs, float step) {
  const auto for_each = [&](const auto& visit) {
    for (const Vec2& uv : uvs) visit(uv.x), visit(uv.y);
  };
  return on_grid_of(kUvs, 0, for_each, step);
}

/// Those of a kind. Joints and materials are whole numbers.
void add_extras(const Mesh& mesh, ExtraKind kind, float step, std::vector<AttributeFormat>& out) {
  const size_t width = extra_width(mesh.extras);
  size_t at = 0;
  for (const Extra& extra : mesh.extras) {
    const size_t count = extra_width(extra.kind);
    const auto for_each = [&](const auto& visit) {
      for (size_t v = 0; v < mesh.positions.size(); ++v)
        for (size_t k = 0; k < count; ++k) visit(mesh.extra_values[v * width + at + k]);
    };
    if (extra.kind == kind)
      out.push_back(on_grid_of(static_cast<uint32_t>(kind), extra.set, for_each, step));
    at += count;
  }
}

bool are_in_range(const std::vector<Vec4>& colors) {
  const auto fits = [](float f) { return f >= 0 && f <= 1; };
  return std::all_of(colors.begin(), colors.end(), [&](const Vec4& c) {
    return fits(c.x) && fits(c.y) && fits(c.z) && fits(c.w);
  });
}

AttributeFormat with_bits(uint32_t attribute, Coding coding, uint32_t bits) {
  if (bits == 0) return {attribute, Coding::kFloats, 0, 0};
  return {attribute, coding, bits, 0};
}

}  // namespace

VertexFormat choose_format(const lod::Dag& dag, const AssetConfig& config) {
  check_bits("normal_bits", config.normal_bits);
  check_bits("tangent_bits", config.tangent_bits);
  check_bits("color_bits", config.color_bits);
  if (config.uv_step != 0 && !is_power_of_two(config.uv_step))
    throw Error(ErrorCode::kInvalidArgument, "uv_step is " + std::to_string(config.uv_step) +
                                                 ", but must be 0 or a power of two");
  const Mesh& mesh = dag.vertices;
  std::vector<AttributeFormat> attributes{positions_of(dag)};
  const bool octahedral = !mesh.normals.empty() && config.normal_bits > 0;
  if (!mesh.normals.empty())
    attributes.push_back(with_bits(kNormals, Coding::kOctahedral, config.normal_bits));
  if (!mesh.tangents.empty())
    attributes.push_back(
        with_bits(kTangents, Coding::kAngle, octahedral ? config.tangent_bits : 0));
  if (!mesh.uvs.empty()) attributes.push_back(uvs_of(mesh.uvs, config.uv_step));
  add_extras(mesh, ExtraKind::kUvs, config.uv_step, attributes);
  if (!mesh.colors.empty())
    attributes.push_back(
        with_bits(kColors, Coding::kSrgb, are_in_range(mesh.colors) ? config.color_bits : 0));
  add_extras(mesh, ExtraKind::kJoints, 1.0f, attributes);
  add_extras(mesh, ExtraKind::kWeights, config.uv_step > 0 ? kWeightStep : 0.0f, attributes);
  add_extras(mesh, ExtraKind::kMaterial, 1.0f, attributes);
  return make_format(std::move(attributes));
}

}  // namespace umbel::asset
