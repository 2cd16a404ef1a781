#include "trace/surface.hpp"

namespace umbel::trace {
namespace {

/// Rounding of a point computed from barycentric coordinates stays well below this times the
/// largest coordinate.
constexpr float kOffset = 0x1p-20f;

struct Barycentric {
  float a, b, c;
};

Barycentric weights_of(float u, float v) { return {1.0f - u - v, u, v}; }

Vec2 uv_at(const Scene::Data& scene, const Triangle& t, const Barycentric& w) {
  if (scene.uvs.empty()) return {0, 0};
  const Vec2 &a = scene.uvs[t[0]], &b = scene.uvs[t[1]], &c = scene.uvs[t[2]];
  return {w.a * a.x + w.b * b.x + w.c * c.x, w.a * a.y + w.b * b.y + w.c * c.y};
}

Vec4 texel_at(const Scene::Data& scene, const TextureUse& use, const Vec2& uv) {
  return scene.textures[use.texture].lookup(transformed(use, uv));
}

float coordinate_size(const Vec3& p) {
  return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
}

/// The direction in which u grows, along the triangle.
Vec3 tangent_of(const Scene::Data& scene, const Triangle& t, const Vec3& e1, const Vec3& e2,
                bool& mirrored) {
  const Vec2 &a = scene.uvs[t[0]], &b = scene.uvs[t[1]], &c = scene.uvs[t[2]];
  const float du1 = b.x - a.x, du2 = c.x - a.x, dv1 = b.y - a.y, dv2 = c.y - a.y;
  const float determinant = du1 * dv2 - du2 * dv1;
  mirrored = determinant < 0.0f;
  const Vec3 tangent = (e1 * dv2 - e2 * dv1) * (mirrored ? -1.0f : 1.0f);
  return normalized(tangent, {0, 0, 0});
}

/// The normal that a normal map gives. Tangents follow the triangle's own UVs, so a mesh needs
/// none.
Vec3 mapped_normal(const Scene::Data& scene, const Triangle& t, const TextureUse& use,
                   const Vec2& uv, const Vec3& e1, const Vec3& e2, const Vec3& normal) {
  bool mirrored = false;
  const Vec3 along = tangent_of(scene, t, e1, e2, mirrored);
  const Vec3 tangent = normalized(along - normal * dot(normal, along), {0, 0, 0});
  if (is_black(tangent)) return normal;
  // v runs down the image and +Y up it.
  const Vec3 bitangent = cross(normal, tangent) * (mirrored ? 1.0f : -1.0f);
  const Vec4 texel = texel_at(scene, use, uv);
  const Vec3 n{2.0f * texel.x - 1.0f, 2.0f * texel.y - 1.0f, 2.0f * texel.z - 1.0f};
  return normalized(tangent * n.x + bitangent * -n.y + normal * n.z, normal);
}

/// The shading normal turned to the seen side, and no further than the light can follow.
Vec3 facing(Vec3 shading, const Vec3& face, const Vec3& direction) {
  if (dot(shading, face) < 0.0f) shading = -shading;
  const float away = dot(shading, direction);
  if (away < -1e-3f) return shading;
  // Seen from behind: the nearest normal that is not.
  return normalized(shading - direction * (away + 1e-2f), face);
}

/// In the space of the triangle's corners.
Surface surface_in_place(const Scene::Data& scene, const Hit& hit, const Vec3& direction) {
  const TriangleRecord& record = scene.triangles[hit.primitive];
  const Triangle& t = record.corners;
  const Vec3 &p0 = scene.positions[t[0]], &p1 = scene.positions[t[1]], &p2 = scene.positions[t[2]];
  const Barycentric w = weights_of(hit.u, hit.v);
  const Vec3 e1 = p1 - p0, e2 = p2 - p0;

  Surface s;
  s.material = record.material;
  s.point = p0 * w.a + p1 * w.b + p2 * w.c;
  s.offset = kOffset * std::max({coordinate_size(p0), coordinate_size(p1), coordinate_size(p2)});
  // Edges are scaled because the product of two tiny ones is no float.
  const Vec3 outside =
      normalized(cross(normalized(e1, {0, 0, 0}), normalized(e2, {0, 0, 0})), -direction);
  const bool behind = dot(outside, direction) > 0.0f;
  s.face = behind ? -outside : outside;

  const Material& m = scene.materials[record.material];
  s.color = {m.base_color, m.metallic, m.roughness, m.specular};
  s.emission = m.emission;
  const Vec2 uv = uv_at(scene, t, w);
  Vec3 shading = outside;
  if (!scene.normals.empty())
    shading = normalized(
        scene.normals[t[0]] * w.a + scene.normals[t[1]] * w.b + scene.normals[t[2]] * w.c, outside);
  if (m.normal_texture.texture != kNone)
    shading = mapped_normal(scene, t, m.normal_texture, uv, e1, e2, shading);
  s.shading = facing(shading, s.face, direction);

  if (!scene.colors.empty()) {
    const Vec4 &a = scene.colors[t[0]], &b = scene.colors[t[1]], &c = scene.colors[t[2]];
    s.color.base =
        s.color.base * Vec3{w.a * a.x + w.b * b.x + w.c * c.x, w.a * a.y + w.b * b.y + w.c * c.y,
                            w.a * a.z + w.b * b.z + w.c * c.z};
  }
  if (m.base_color_texture.texture != kNone) {
    const Vec4 texel = texel_at(scene, m.base_color_texture, uv);
    s.color.base = s.color.base * Vec3{texel.x, texel.y, texel.z};
  }
  if (m.metallic_roughness_texture.texture != kNone) {
    const Vec4 texel = texel_at(scene, m.metallic_roughness_texture, uv);
    s.color.roughness *= texel.y;
    s.color.metallic *= texel.z;
  }
  if (m.emission_texture.texture != kNone) {
    const Vec4 texel = texel_at(scene, m.emission_texture, uv);
    s.emission = s.emission * Vec3{texel.x, texel.y, texel.z};
  }
  return s;
}

}  // namespace

Surface surface_at(const Scene::Data& scene, const SceneHit& hit, const Vec3& direction) {
  if (!scene.clusters) return surface_in_place(scene, hit, direction);
  const Placement& placement = scene.clusters->placement(hit.transform);
  Surface s =
      surface_in_place(scene, hit, normalized(placement.vector_to_object(direction), direction));
  s.point = placement.point_to_world(s.point);
  s.face = normalized(placement.normal_to_world(s.face), -direction);
  s.shading = normalized(placement.normal_to_world(s.shading), s.face);
  s.offset = std::max(s.offset * placement.scale(), kOffset * coordinate_size(s.point));
  return s;
}

float opacity_at(const Scene::Data& scene, const Hit& hit) {
  const TriangleRecord& record = scene.triangles[hit.primitive];
  const Material& m = scene.materials[record.material];
  if (!is_see_through(m)) return 1.0f;
  const Barycentric w = weights_of(hit.u, hit.v);
  float alpha = m.alpha;
  if (!scene.colors.empty()) {
    const Triangle& t = record.corners;
    alpha *= w.a * scene.colors[t[0]].w + w.b * scene.colors[t[1]].w + w.c * scene.colors[t[2]].w;
  }
  if (m.base_color_texture.texture != kNone)
    alpha *= texel_at(scene, m.base_color_texture, uv_at(scene, record.corners, w)).w;
  if (m.alpha_mode == AlphaMode::kMask) return alpha >= m.alpha_cutoff ? 1.0f : 0.0f;
  return std::clamp(alpha, 0.0f, 1.0f);
}

Vec3 emission_at(const Scene::Data& scene, uint32_t triangle, float u, float v) {
  const TriangleRecord& record = scene.triangles[triangle];
  const Material& m = scene.materials[record.material];
  if (m.emission_texture.texture == kNone) return m.emission;
  const Vec4 texel =
      texel_at(scene, m.emission_texture, uv_at(scene, record.corners, weights_of(u, v)));
  return m.emission * Vec3{texel.x, texel.y, texel.z};
}

}  // namespace umbel::trace
