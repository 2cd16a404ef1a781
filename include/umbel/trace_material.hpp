// Materials and textures as the path tracer of trace.hpp takes them: glTF 2.0's metallic-roughness
// model with the layers that its extensions add.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "umbel/types.hpp"

namespace umbel::trace {

enum class Wrap : uint32_t { kRepeat, kClamp, kMirror };

/// An image of 8-bit RGBA texels, row by row from the top (v = 0), that the caller owns.
struct TextureView {
  std::span<const uint8_t> texels;  ///< 4 * width * height
  uint32_t width = 0, height = 0;   ///< 1..65536
  bool srgb = false;                ///< red, green and blue are sRGB-encoded; alpha never is
  bool nearest = false;             ///< no bilinear interpolation
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
};

/// A texture and where the mesh's UVs meet it: uv' = offset + rotate(rotation, scale * uv), as
/// KHR_texture_transform has it.
struct TextureUse {
  uint32_t texture = kNone;  ///< index into Shading::textures
  Vec2 offset{0, 0};
  Vec2 scale{1, 1};
  float rotation = 0.0f;  ///< radians, counter-clockwise with v down
  /// 0: MeshView::uvs; up to 63: its ExtraKind::kUvs of this set. A mesh without the set is
  /// shown without the texture.
  uint32_t uv_set = 0;
};

enum class AlphaMode : uint32_t {
  kOpaque,  ///< alpha is ignored
  kMask,    ///< there or not, by alpha_cutoff
  kBlend,   ///< lets the fraction 1 - alpha of all light pass straight through
};

/// glTF 2.0's metallic-roughness model. Colours are multiplied by the mesh's vertex colours and
/// by textures where there are any; texture channels are glTF's.
struct Material {
  Vec3 base_color{0.8f, 0.8f, 0.8f};  ///< each in [0, 1]
  float alpha = 1.0f;
  float metallic = 0.0f;   ///< 0 dielectric .. 1 metal
  float roughness = 1.0f;  ///< 0 mirror .. 1 matte
  float specular = 1.0f;   ///< strength of a dielectric's reflection, 0..1; 0 and not metallic:
                           ///< the surface is Lambert's
  Vec3 emission{0, 0, 0};  ///< radiance, on both sides
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;
  TextureUse base_color_texture;          ///< RGB and alpha
  TextureUse metallic_roughness_texture;  ///< roughness in green, metallic in blue
  TextureUse emission_texture;
  TextureUse normal_texture;     ///< tangent space, +Y up
  float normal_scale = 1.0f;     ///< of the normal's tangential part
  float ior = 1.5f;              ///< index of refraction, 1..100; 0: reflects all, at any angle
  Vec3 specular_color{1, 1, 1};  ///< of a dielectric's reflection at normal incidence, up to 100
  TextureUse specular_texture;   ///< alpha
  TextureUse specular_color_texture;

  bool unlit = false;  ///< emits its base colour and reflects nothing

  /// The part of the light below the reflection that is transmitted instead of scattered. The
  /// surface is thin, or with `body` that of a solid of index `ior`, which refracts.
  float transmission = 0.0f;  ///< 0..1
  TextureUse transmission_texture;
  bool body = false;
  /// Inside a body: what white light becomes after this distance.
  Vec3 attenuation_color{1, 1, 1};
  float attenuation_distance = std::numeric_limits<float>::infinity();  ///< above 0

  /// The part of the scattered light that is scattered to the other side.
  float diffuse_transmission = 0.0f;  ///< 0..1
  Vec3 diffuse_transmission_color{1, 1, 1};
  TextureUse diffuse_transmission_texture;  ///< alpha
  TextureUse diffuse_transmission_color_texture;

  /// A second, colourless reflection on top, of index 1.5.
  float clearcoat = 0.0f, clearcoat_roughness = 0.0f;  ///< 0..1
  TextureUse clearcoat_texture, clearcoat_roughness_texture, clearcoat_normal_texture;
  float clearcoat_normal_scale = 1.0f;

  /// Cloth's reflection at grazing angles.
  Vec3 sheen_color{0, 0, 0};  ///< each in [0, 1]
  float sheen_roughness = 0.0f;
  TextureUse sheen_color_texture, sheen_roughness_texture;

  /// Interference of a thin film on the surface.
  float iridescence = 0.0f;      ///< 0..1
  float iridescence_ior = 1.3f;  ///< 1..100
  /// In nanometres; the texture interpolates between them, and without one the second holds.
  float iridescence_thickness_min = 100.0f, iridescence_thickness_max = 400.0f;
  TextureUse iridescence_texture, iridescence_thickness_texture;
};

}  // namespace umbel::trace
