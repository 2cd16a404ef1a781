#include "trace/layers.hpp"

#include <algorithm>

#include "trace/lookup.hpp"

namespace umbel::trace {
namespace {

/// Up to this roughness a thin surface does not change light's direction: by half a degree at most.
constexpr float kStraightRoughness = 0.1f;
/// Bodies of an index below this do not refract: floats cannot resolve the change of direction.
constexpr float kLeastIndex = 1.01f;
constexpr float kLeastStop = 0.1f;

bool bends(const Material& m) { return m.transmission > 0.0f && m.body && m.ior >= kLeastIndex; }

Vec3 absorption_of(const Material& m) {
  if (!m.body || m.transmission <= 0.0f || !std::isfinite(m.attenuation_distance)) return {0, 0, 0};
  const auto of = [&](float part) {
    return -std::log(std::clamp(part, 1e-6f, 1.0f)) / m.attenuation_distance;
  };
  return {of(m.attenuation_color.x), of(m.attenuation_color.y), of(m.attenuation_color.z)};
}

const BodyAlbedos* albedos_for(float ior, Scene::Data& scene) {
  for (const auto& found : scene.bodies)
    if (found->ior() == ior) return found.get();
  scene.bodies.push_back(std::make_unique<const BodyAlbedos>(ior));
  return scene.bodies.back().get();
}

Vec3 root(const Vec3& v) { return {std::sqrt(v.x), std::sqrt(v.y), std::sqrt(v.z)}; }

bool may_keep_direction(const Material& m) {
  return m.transmission > 0.0f && !bends(m) &&
         (m.body || m.roughness <= kStraightRoughness ||
          m.metallic_roughness_texture.texture != kNone);
}

bool keeps_direction(const Material& m, float roughness) {
  return m.body ? !bends(m) : roughness <= kStraightRoughness;
}

void lay_coat(const Scene::Data& scene, const SceneHit& hit, const Point& at, const Basis& basis,
              const Vec3& direction, SurfaceLayers& layers) {
  const Material& m = scene.materials[scene.triangles[hit.primitive].material];
  layers.coat = at.scaled(m.clearcoat, m.clearcoat_texture, &Vec4::x);
  if (!(layers.coat > 0.0f)) return;
  layers.coat_roughness = at.scaled(m.clearcoat_roughness, m.clearcoat_roughness_texture, &Vec4::y);
  if (m.normal_texture.texture != kNone || m.clearcoat_normal_texture.texture != kNone)
    layers.coat_normal =
        normalized(basis.to_local(coat_normal_at(scene, hit, direction)), {0, 0, 1});
}

void lay_film(const Material& m, const Point& at, SurfaceLayers& layers) {
  layers.film = at.scaled(m.iridescence, m.iridescence_texture, &Vec4::x);
  if (!(layers.film > 0.0f)) return;
  const float part = at.scaled(1.0f, m.iridescence_thickness_texture, &Vec4::y);
  layers.film_ior = m.iridescence_ior;
  layers.film_thickness = m.iridescence_thickness_min +
                          (m.iridescence_thickness_max - m.iridescence_thickness_min) * part;
}

}  // namespace

bool is_see_through(const Material& m) {
  return m.alpha_mode != AlphaMode::kOpaque || may_keep_direction(m);
}

void sort_materials(Scene::Data& scene) {
  for (const Material& m : scene.materials) {
    MaterialKind kind;
    kind.layered = m.transmission > 0.0f || m.diffuse_transmission > 0.0f || m.clearcoat > 0.0f ||
                   m.iridescence > 0.0f || !is_black(m.sheen_color);
    kind.colored_reflection = m.ior != 1.5f || m.specular_texture.texture != kNone ||
                              m.specular_color_texture.texture != kNone ||
                              !(m.specular_color == Vec3{1, 1, 1});
    kind.unlit = m.unlit;
    kind.straight = may_keep_direction(m);
    kind.absorption = absorption_of(m);
    if (bends(m)) kind.body = albedos_for(m.ior, scene);
    scene.see_through |= is_see_through(m);
    scene.absorbs |= !is_black(kind.absorption);
    scene.kinds.push_back(kind);
  }
}

SurfaceLayers layers_at(const Scene::Data& scene, const SceneHit& hit, const Surface& surface,
                        const Basis& basis, const Vec3& direction) {
  const Material& m = scene.materials[surface.material];
  const Point at(scene, hit);
  SurfaceLayers layers;
  layers.body = scene.kinds[surface.material].body;
  layers.inside = layers.body && surface.behind;
  layers.transmission = at.scaled(m.transmission, m.transmission_texture, &Vec4::x);
  // Light that crosses a body meets its colour twice.
  layers.passing = m.body ? root(surface.color.base) : surface.color.base;
  layers.straight = layers.transmission > 0.0f && keeps_direction(m, surface.color.roughness);
  layers.diffuse_transmission =
      at.scaled(m.diffuse_transmission, m.diffuse_transmission_texture, &Vec4::w);
  layers.diffuse_transmission_color =
      at.tinted(m.diffuse_transmission_color, m.diffuse_transmission_color_texture);
  layers.sheen = at.tinted(m.sheen_color, m.sheen_color_texture);
  layers.sheen_roughness = at.scaled(m.sheen_roughness, m.sheen_roughness_texture, &Vec4::w);
  lay_film(m, at, layers);
  if (!layers.inside) lay_coat(scene, hit, at, basis, direction, layers);
  return layers;
}

Passage passage_at(const Scene::Data& scene, const SceneHit& hit, const Vec3& direction) {
  const float opacity = opacity_at(scene, hit), open = 1.0f - opacity;
  const uint32_t material = scene.triangles[hit.primitive].material;
  Passage passage{opacity, 1.0f, {open, open, open}};
  if (!scene.kinds[material].straight || opacity <= 0.0f) return passage;
  const Surface surface = surface_at(scene, hit, direction);
  const Basis basis = basis_around(surface.shading);
  const SurfaceLayers layers = layers_at(scene, hit, surface, basis, direction);
  const LayeredBsdf bsdf(surface.color, layers, basis.to_local(-direction));
  passage.through = passage.through + bsdf.straight() * opacity;
  passage.stop = std::clamp(1.0f - max_component(passage.through), kLeastStop * opacity, 1.0f);
  passage.weight = opacity / passage.stop;
  const bool body = scene.materials[material].body;
  passage.leaves_body = body && surface.behind;
  passage.enters_body = body && !surface.behind;
  return passage;
}

}  // namespace umbel::trace
