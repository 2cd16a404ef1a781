#include "lod/build/check_config.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "base/printed.hpp"
#include "base/refuse.hpp"

namespace umbel::lod {
namespace {

bool is_power_of_two(float value) {
  int exponent = 0;
  return value > 0 && std::isfinite(value) && std::frexp(value, &exponent) == 0.5f;
}

// Materials of triangles are kept as floats where clusters mix them.
void check_materials(const MeshView& mesh, const Config& config) {
  require(mesh.extras.empty() || mesh.extras.back().kind != ExtraKind::kMaterial,
          "the extras have a material, which only levels of detail have: give `materials`");
  if (!config.mix_materials || mesh.materials.empty()) return;
  require(extra_width(mesh.extras) < kMostExtraValues,
          "the extras have " + std::to_string(extra_width(mesh.extras)) +
              " values a vertex, but with mix_materials at most " +
              std::to_string(kMostExtraValues - 1) + " are possible");
  for (size_t t = 0; t < mesh.materials.size(); ++t)
    if (mesh.materials[t] > kMostMixedMaterial)
      require(false, "triangle " + std::to_string(t) + " has the material " +
                         std::to_string(mesh.materials[t]) + ", at most " +
                         std::to_string(kMostMixedMaterial) + " is possible with mix_materials");
}

}  // namespace

void check_config(const Config& config) {
  require(config.max_triangles >= 4 && config.max_triangles <= 256,
          "max_triangles is " + std::to_string(config.max_triangles) + ", must be in [4, 256]");
  require(config.max_vertices >= 6 && config.max_vertices <= 256,
          "max_vertices is " + std::to_string(config.max_vertices) + ", must be in [6, 256]");
  require(config.min_triangles <= config.max_triangles,
          "min_triangles is " + std::to_string(config.min_triangles) +
              ", more than max_triangles, " + std::to_string(config.max_triangles));
  const std::pair<const char*, float> costs[] = {
      {"underfill_cost", config.underfill_cost},
      {"vertex_underfill_cost", config.vertex_underfill_cost},
      {"overlap_cost", config.overlap_cost},
      {"group_underfill_cost", config.group_underfill_cost},
      {"group_overlap_cost", config.group_overlap_cost}};
  for (const auto& [name, cost] : costs)
    require(cost >= 0.0f && cost <= 1.0f,
            std::string(name) + " is " + printed(cost) + ", must be in [0, 1]");
  require(config.min_group >= 2,
          "min_group is " + std::to_string(config.min_group) + ", must be at least 2");
  require(config.max_group <= 1024,
          "max_group is " + std::to_string(config.max_group) + ", must be at most 1024");
  require(config.min_group <= config.max_group, "min_group is " + std::to_string(config.min_group) +
                                                    ", more than max_group, " +
                                                    std::to_string(config.max_group));
  require(config.ratio >= 0.1f && config.ratio <= 0.9f,
          "ratio is " + printed(config.ratio) + ", must be in [0.1, 0.9]");
  require(config.position_step == 0.0f || is_power_of_two(config.position_step),
          "position_step is " + printed(config.position_step) +
              ", must be 0 or a positive power of two");
  const std::pair<const char*, float> weights[] = {{"normal_weight", config.normal_weight},
                                                   {"uv_weight", config.uv_weight},
                                                   {"color_weight", config.color_weight},
                                                   {"tangent_weight", config.tangent_weight},
                                                   {"skin_weight", config.skin_weight}};
  for (const auto& [name, weight] : weights)
    require(weight >= 0.0f && weight <= 1e3f,
            std::string(name) + " is " + printed(weight) + ", must be in [0, 1000]");
  require(config.max_error >= 0.0f,
          "max_error is " + printed(config.max_error) + ", must be at least 0");
}

Config with_limits(const Config& config) {
  constexpr uint32_t kMost = 256;  // that bytes can name
  Config result = config;
  if (result.max_triangles == 0) result.max_triangles = kMost;
  if (result.max_vertices == 0) result.max_vertices = kMost;
  return result;
}

void check_config(const MeshView& mesh, const Config& config) {
  check_config(config);
  check_materials(mesh, config);
}

}  // namespace umbel::lod
