#include "trace/check_shading.hpp"

#include <cmath>

#include "base/printed.hpp"
#include "base/refuse.hpp"
#include "trace/vector.hpp"

namespace umbel::trace {
namespace {

struct NumberField {
  const char* name;
  float Material::* value;
  float low, high;
};

struct ColorField {
  const char* name;
  Vec3 Material::* color;
  float high;
};

struct TextureField {
  const char* name;
  TextureUse Material::* use;
};

constexpr float kBrightest = 1e9f;

constexpr std::array kNumbers{
    NumberField{"alpha", &Material::alpha, 0.0f, 1.0f},
    NumberField{"metallic", &Material::metallic, 0.0f, 1.0f},
    NumberField{"roughness", &Material::roughness, 0.0f, 1.0f},
    NumberField{"specular", &Material::specular, 0.0f, 1.0f},
    NumberField{"alpha_cutoff", &Material::alpha_cutoff, 0.0f, 1e6f},
    NumberField{"normal_scale", &Material::normal_scale, -1e6f, 1e6f},
    NumberField{"transmission", &Material::transmission, 0.0f, 1.0f},
    NumberField{"diffuse_transmission", &Material::diffuse_transmission, 0.0f, 1.0f},
    NumberField{"clearcoat", &Material::clearcoat, 0.0f, 1.0f},
    NumberField{"clearcoat_roughness", &Material::clearcoat_roughness, 0.0f, 1.0f},
    NumberField{"clearcoat_normal_scale", &Material::clearcoat_normal_scale, -1e6f, 1e6f},
    NumberField{"sheen_roughness", &Material::sheen_roughness, 0.0f, 1.0f},
    NumberField{"iridescence", &Material::iridescence, 0.0f, 1.0f},
    NumberField{"iridescence_ior", &Material::iridescence_ior, 1.0f, 100.0f},
    NumberField{"iridescence_thickness_min", &Material::iridescence_thickness_min, 0.0f, 1e6f},
    NumberField{"iridescence_thickness_max", &Material::iridescence_thickness_max, 0.0f, 1e6f}};

constexpr std::array kColors{
    ColorField{"base_color", &Material::base_color, 1.0f},
    ColorField{"emission", &Material::emission, kBrightest},
    ColorField{"specular_color", &Material::specular_color, 100.0f},
    ColorField{"attenuation_color", &Material::attenuation_color, 1.0f},
    ColorField{"diffuse_transmission_color", &Material::diffuse_transmission_color, 1.0f},
    ColorField{"sheen_color", &Material::sheen_color, 1.0f}};

constexpr std::array kTextures{
    TextureField{"base_color_texture", &Material::base_color_texture},
    TextureField{"metallic_roughness_texture", &Material::metallic_roughness_texture},
    TextureField{"emission_texture", &Material::emission_texture},
    TextureField{"normal_texture", &Material::normal_texture},
    TextureField{"specular_texture", &Material::specular_texture},
    TextureField{"specular_color_texture", &Material::specular_color_texture},
    TextureField{"transmission_texture", &Material::transmission_texture},
    TextureField{"diffuse_transmission_texture", &Material::diffuse_transmission_texture},
    TextureField{"diffuse_transmission_color_texture",
                 &Material::diffuse_transmission_color_texture},
    TextureField{"clearcoat_texture", &Material::clearcoat_texture},
    TextureField{"clearcoat_roughness_texture", &Material::clearcoat_roughness_texture},
    TextureField{"clearcoat_normal_texture", &Material::clearcoat_normal_texture},
    TextureField{"sheen_color_texture", &Material::sheen_color_texture},
    TextureField{"sheen_roughness_texture", &Material::sheen_roughness_texture},
    TextureField{"iridescence_texture", &Material::iridescence_texture},
    TextureField{"iridescence_thickness_texture", &Material::iridescence_thickness_texture}};

void check_range(const std::string& what, float value, float low, float high) {
  if (value >= low && value <= high) return;
  refuse(what + " is " + printed(value) + ", but must be from " + printed(low) + " to " +
         printed(high));
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
  // In double, in which the sum of finite floats is finite.
  if (!std::isfinite(double{use.offset.x} + use.offset.y + use.scale.x + use.scale.y +
                     use.rotation))
    refuse(what + " transforms its texture by numbers that are not finite");
  if (use.uv_set >= kMostUvSets)
    refuse(what + " uses the UVs " + std::to_string(use.uv_set) + ", but the last are 63");
}

void check_material(const Material& m, size_t index, size_t textures) {
  const std::string name = "materials[" + std::to_string(index) + "].";
  for (const NumberField& field : kNumbers)
    check_range(name + field.name, m.*field.value, field.low, field.high);
  for (const ColorField& field : kColors)
    check_color(name + field.name, m.*field.color, field.high);
  check_range(name + "ior", m.ior == 0.0f ? 1.0f : m.ior, 1.0f, 100.0f);
  if (!(m.attenuation_distance > 0.0f)) refuse(name + "attenuation_distance must be above 0");
  for (const TextureField& field : kTextures) check_use(name + field.name, m.*field.use, textures);
  if (m.alpha_mode > AlphaMode::kBlend) refuse(name + "alpha_mode is none");
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

std::array<const TextureUse*, 16> texture_uses(const Material& m) {
  std::array<const TextureUse*, 16> uses;
  static_assert(kTextures.size() == uses.size());
  for (size_t i = 0; i < uses.size(); ++i) uses[i] = &(m.*kTextures[i].use);
  return uses;
}

UvSets uv_sets_used(const Material& material) {
  UvSets sets = 0;
  for (const TextureUse* use : texture_uses(material))
    if (use->texture != kNone) sets |= UvSets{1} << use->uv_set;
  return sets;
}

Material with_uv_sets(Material material, UvSets sets) {
  for (const TextureField& field : kTextures) {
    TextureUse& use = material.*field.use;
    if (use.texture != kNone && (sets >> use.uv_set & 1) == 0) use.texture = kNone;
  }
  return material;
}

void check_shading(const MeshView& mesh, const Shading& shading) {
  for (size_t i = 0; i < shading.textures.size(); ++i) check_texture(shading.textures[i], i);
  for (size_t i = 0; i < shading.materials.size(); ++i)
    check_material(shading.materials[i], i, shading.textures.size());
  check_environment(shading.environment);
  if (shading.materials.empty()) return;
  for (size_t i = 0; i < mesh.materials.size(); ++i) {
    if (mesh.materials[i] >= shading.materials.size())
      refuse("triangle " + std::to_string(i) + " has material " +
             std::to_string(mesh.materials[i]) + ", but there are only " +
             std::to_string(shading.materials.size()));
  }
}

}  // namespace umbel::trace
