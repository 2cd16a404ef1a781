#include "trace/check_look.hpp"

#include <cmath>

#include "trace/vector.hpp"

namespace umbel::trace {
namespace {

constexpr uint32_t kMostUvSets = 64;

/// In the order of texture_uses.
constexpr std::array<const char*, 16> kTextureNames{"base_color_texture",
                                                    "metallic_roughness_texture",
                                                    "emission_texture",
                                                    "normal_texture",
                                                    "specular_texture",
                                                    "specular_color_texture",
                                                    "transmission_texture",
                                                    "diffuse_transmission_texture",
                                                    "diffuse_transmission_color_texture",
                                                    "clearcoat_texture",
                                                    "clearcoat_roughness_texture",
                                                    "clearcoat_normal_texture",
                                                    "sheen_color_texture",
                                                    "sheen_roughness_texture",
                                                    "iridescence_texture",
                                                    "iridescence_thickness_texture"};

void check_range(const std::string& what, float value, float low, float high) {
  if (value >= low && value <= high) return;
  refuse(what + " is " + std::to_string(value) + ", but must be from " + std::to_string(low) +
         " to " + std::to_string(high));
}

void check_color(const std::string& what, const Vec3& color, float high) {
  check_range(what, std::min({color.x, color.y, color.z}), 0.0f, high);
  check_range(what, max_component(color), 0.0f, high);
  if (std::isnan(color.x + color.y + color.z)) refuse(what + " has a NaN");
}

void check_use(const std::string& what, const TextureUse& use, size_t textures) {
  if (use.texture == kNone) return;
  if (use.texture >= textures)
    refuse(what + " uses texture " + std::to_string(use.texture) + ", but there are only " +
           std::to_string(textures));
  if (!std::isfinite(use.offset.x + use.offset.y + use.scale.x + use.scale.y + use.rotation))
    refuse(what + " places its texture by numbers that are not finite");
  if (use.uv_set > kMostUvSets)
    refuse(what + " uses the UVs " + std::to_string(use.uv_set) + ", but there are at most 64");
}

constexpr float kBrightest = 1e9f;

void check_layers(const Material& m, const std::string& name) {
  check_range(name + ".ior", m.ior == 0.0f ? 1.0f : m.ior, 1.0f, 100.0f);
  check_color(name + ".specular_color", m.specular_color, 100.0f);
  check_range(name + ".transmission", m.transmission, 0.0f, 1.0f);
  check_color(name + ".attenuation_color", m.attenuation_color, 1.0f);
  if (!(m.attenuation_distance > 0.0f)) refuse(name + ".attenuation_distance must be above 0");
  check_range(name + ".diffuse_transmission", m.diffuse_transmission, 0.0f, 1.0f);
  check_color(name + ".diffuse_transmission_color", m.diffuse_transmission_color, 1.0f);
  check_range(name + ".clearcoat", m.clearcoat, 0.0f, 1.0f);
  check_range(name + ".clearcoat_roughness", m.clearcoat_roughness, 0.0f, 1.0f);
  check_color(name + ".sheen_color", m.sheen_color, 1.0f);
  check_range(name + ".sheen_roughness", m.sheen_roughness, 0.0f, 1.0f);
  check_range(name + ".iridescence", m.iridescence, 0.0f, 1.0f);
  check_range(name + ".iridescence_ior", m.iridescence_ior, 1.0f, 100.0f);
  check_range(name + ".iridescence_thickness_min", m.iridescence_thickness_min, 0.0f, 1e6f);
  check_range(name + ".iridescence_thickness_max", m.iridescence_thickness_max, 0.0f, 1e6f);
  check_range(name + ".normal_scale", m.normal_scale, -1e6f, 1e6f);
  check_range(name + ".clearcoat_normal_scale", m.clearcoat_normal_scale, -1e6f, 1e6f);
}

void check_material(const Material& m, size_t index, size_t textures) {
  const std::string name = "materials[" + std::to_string(index) + "]";
  check_color(name + ".base_color", m.base_color, 1.0f);
  check_range(name + ".alpha", m.alpha, 0.0f, 1.0f);
  check_range(name + ".metallic", m.metallic, 0.0f, 1.0f);
  check_range(name + ".roughness", m.roughness, 0.0f, 1.0f);
  check_range(name + ".specular", m.specular, 0.0f, 1.0f);
  check_range(name + ".alpha_cutoff", m.alpha_cutoff, 0.0f, 1e6f);
  check_color(name + ".emission", m.emission, kBrightest);
  check_layers(m, name);
  const auto uses = texture_uses(m);
  for (size_t k = 0; k < uses.size(); ++k)
    check_use(name + "." + kTextureNames[k], *uses[k], textures);
  if (m.alpha_mode > AlphaMode::kBlend) refuse(name + ".alpha_mode is none");
}

void check_texture(const TextureView& t, size_t index) {
  const std::string name = "textures[" + std::to_string(index) + "]";
  constexpr uint32_t kLargest = 65536;
  if (t.width == 0 || t.height == 0 || t.width > kLargest || t.height > kLargest)
    refuse(name + " has " + std::to_string(t.width) + " x " + std::to_string(t.height) +
           " texels, but must have from 1 to 65536 each way");
  const size_t bytes = size_t(4) * t.width * t.height;
  if (t.texels.size() != bytes)
    refuse(name + " has " + std::to_string(t.texels.size()) + " bytes, but must have " +
           std::to_string(bytes));
}

void check_environment(const Environment& e) {
  check_color("environment.color", e.color, kBrightest);
  check_color("environment.ground_albedo", e.ground_albedo, 1.0f);
  check_range("environment.turbidity", e.turbidity, 1.7f, 10.0f);
  check_range("environment.sun_radius", e.sun_radius, 0.001f, 0.5f);
  check_range("environment.sun_strength", e.sun_strength, 0.0f, 1e6f);
  check_range("environment.sky_strength", e.sky_strength, 0.0f, 1e6f);
  const auto has_direction = [](const Vec3& v) { return is_finite(v) && !is_black(v); };
  if (!has_direction(e.up)) refuse("environment.up is no direction");
  if (e.kind == Environment::Kind::kSky && !has_direction(e.sun_direction))
    refuse("environment.sun_direction is no direction");
}

}  // namespace

void refuse(const std::string& sentence) { throw Error(ErrorCode::kInvalidArgument, sentence); }

std::array<const TextureUse*, 16> texture_uses(const Material& m) {
  return {&m.base_color_texture,
          &m.metallic_roughness_texture,
          &m.emission_texture,
          &m.normal_texture,
          &m.specular_texture,
          &m.specular_color_texture,
          &m.transmission_texture,
          &m.diffuse_transmission_texture,
          &m.diffuse_transmission_color_texture,
          &m.clearcoat_texture,
          &m.clearcoat_roughness_texture,
          &m.clearcoat_normal_texture,
          &m.sheen_color_texture,
          &m.sheen_roughness_texture,
          &m.iridescence_texture,
          &m.iridescence_thickness_texture};
}

void check_look(const MeshView& mesh, const Look& look) {
  for (size_t i = 0; i < look.textures.size(); ++i) check_texture(look.textures[i], i);
  for (size_t i = 0; i < look.materials.size(); ++i)
    check_material(look.materials[i], i, look.textures.size());
  check_environment(look.environment);
  if (look.materials.empty()) return;
  for (size_t i = 0; i < mesh.materials.size(); ++i) {
    if (mesh.materials[i] >= look.materials.size())
      refuse("triangle " + std::to_string(i) + " has material " +
             std::to_string(mesh.materials[i]) + ", but there are only " +
             std::to_string(look.materials.size()));
  }
}

}  // namespace umbel::trace
