// Small scenes whose pictures are known, and numbers taken from pictures.
#pragma once

#include <cmath>
#include <vector>

#include "umbel/mesh.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace::testing {

/// A square in the plane z = 0 with corners at +-half, seen from +z.
inline Mesh square(float half) {
  Mesh mesh;
  mesh.positions = {{-half, -half, 0}, {half, -half, 0}, {half, half, 0}, {-half, half, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

inline void append(Mesh& to, const Mesh& from, const Vec3& move, uint32_t material) {
  to.materials.resize(to.triangles.size(), 0);
  const auto first = static_cast<uint32_t>(to.positions.size());
  for (const Vec3& p : from.positions)
    to.positions.push_back({p.x + move.x, p.y + move.y, p.z + move.z});
  for (const Triangle& t : from.triangles)
    to.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  to.materials.resize(to.triangles.size(), material);
}

inline Environment constant(float radiance) {
  Environment environment;
  environment.kind = Environment::Kind::kConstant;
  environment.color = {radiance, radiance, radiance};
  return environment;
}

/// A sun in this direction, and no other light.
inline Environment lone_sun(const Vec3& direction) {
  Environment sun;
  sun.up = {0, 0, 1};
  sun.sky_strength = 0;
  sun.ground_albedo = {0, 0, 0};
  sun.sun_direction = direction;
  return sun;
}

inline BvhConfig quick() {
  BvhConfig config;
  config.tree = bvh::preset("fast");
  return config;
}

inline Scene scene_of(const Mesh& mesh, const std::vector<Material>& materials,
                      const Environment& environment,
                      const std::vector<TextureView>& textures = {}) {
  return Scene::build(mesh.view(), {materials, textures, environment}, quick());
}

/// Straight down the z axis at the origin, through a narrow window.
inline Camera from_above(float distance = 1.0f, float fov = 0.05f) {
  Camera camera;
  camera.position = {0, 0, distance};
  camera.target = {0, 0, 0};
  camera.fov_y = fov;
  return camera;
}

inline Settings small_picture(uint32_t size, uint32_t samples) {
  Settings settings;
  settings.width = settings.height = size;
  settings.samples = samples;
  return settings;
}

inline double mean(const Image& image) {
  double sum = 0;
  for (const Vec3& p : image.pixels) sum += double{p.x} + p.y + p.z;
  return sum / (3.0 * static_cast<double>(image.pixels.size()));
}

inline bool all_finite(const Image& image) {
  for (const Vec3& p : image.pixels)
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) return false;
  return true;
}

inline Material lambert(float albedo) {
  Material material;
  material.base_color = {albedo, albedo, albedo};
  material.specular = 0.0f;
  return material;
}

inline Material emitter(float radiance, float albedo = 0.0f) {
  Material material = lambert(albedo);
  material.emission = {radiance, radiance, radiance};
  return material;
}

}  // namespace umbel::trace::testing
