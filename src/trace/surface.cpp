#include "trace/surface.hpp"

#include "trace/lookup.hpp"

namespace umbel::trace {
namespace {

/// Rounding of a point computed from barycentric coordinates stays well below this times the
/// largest coordinate.
constexpr float kOffset = 0x1p-20f;

float coordinate_size(const Vec3& p) {
  return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
}

struct Edges {
  Vec3 first, second;
};

Edges edges_of(const Scene::Data& scene, const Triangle& t) {
  const Vec3& origin = scene.positions[t[0]];
  return {scene.positions[t[1]] - origin, scene.positions[t[2]] - origin};
}

/// Unit vectors along the triangle in which the image's u and v grow, where there are any.
struct Tangents {
  Vec3 u{0, 0, 0}, v{0, 0, 0};
};

Tangents tangents_of(const Scene::Data& scene, const Triangle& t, const TextureUse& use,
                     const Edges& edges) {
  const std::vector<Vec2>& uvs = scene.uvs_of(use.uv_set);
  if (uvs.empty()) return {};
  const Vec2 a = transformed(use, uvs[t[0]]), b = transformed(use, uvs[t[1]]),
             c = transformed(use, uvs[t[2]]);
  const float du1 = b.x - a.x, du2 = c.x - a.x, dv1 = b.y - a.y, dv2 = c.y - a.y;
  const float sign = du1 * dv2 - du2 * dv1 < 0.0f ? -1.0f : 1.0f;
  return {normalized((edges.first * dv2 - edges.second * dv1) * sign, {0, 0, 0}),
          normalized((edges.second * du1 - edges.first * du2) * sign, {0, 0, 0})};
}

/// The normal that a normal map gives. Tangents follow the triangle's own UVs, so a mesh needs
/// none.
Vec3 mapped_normal(const Scene::Data& scene, const Point& at, const TextureUse& use, float scale,
                   const Edges& edges, const Vec3& normal) {
  const Tangents along = tangents_of(scene, at.corners(), use, edges);
  const Vec3 tangent = normalized(along.u - normal * dot(normal, along.u), {0, 0, 0});
  if (is_black(tangent)) return normal;
  // v runs down the image and +Y up it.
  Vec3 up = cross(normal, tangent);
  if (dot(up, along.v) > 0.0f) up = -up;
  const Vec4 texel = at.texel(use);
  const Vec3 n{(2.0f * texel.x - 1.0f) * scale, (2.0f * texel.y - 1.0f) * scale,
               2.0f * texel.z - 1.0f};
  return normalized(tangent * n.x + up * n.y + normal * n.z, normal);
}

/// The shading normal turned to the seen side, and no further than the light can follow.
Vec3 facing(Vec3 shading, const Vec3& face, const Vec3& direction) {
  if (dot(shading, face) < 0.0f) shading = -shading;
  const float away = dot(shading, direction);
  if (away < -1e-3f) return shading;
  // Seen from behind: the nearest normal that is not.
  return normalized(shading - direction * (away + 1e-2f), face);
}

/// A mapped normal turned towards the face until a mirror there would reflect what is outside. It
/// would be black otherwise; the rougher it is, the less that matters.
Vec3 reflecting(const Vec3& shading, const Vec3& face, const Vec3& direction, float roughness) {
  const Vec3 to_eye = -direction;
  const float height = dot(to_eye, face), least = std::min(0.9f * height, 0.01f);
  const Vec3 reflected = shading * (2.0f * dot(shading, to_eye)) - to_eye;
  if (roughness >= 1.0f || dot(reflected, face) >= least) return shading;
  // In the plane of both normals, the normal z high whose reflection is `least` high.
  const Vec3 side = normalized(shading - face * dot(shading, face), {0, 0, 0});
  const float across = dot(to_eye, side);
  const float a = across * across + height * height, b = 2.0f * (a + height * least),
              c = (least + height) * (least + height);
  const float root = std::sqrt(std::max(0.0f, b * b - 4.0f * a * c));
  if (!(a > 0.0f)) return shading;
  const float z2 = std::clamp(0.25f * (across < 0.0f ? b + root : b - root) / a, 0.0f, 1.0f);
  const Vec3 turned = side * std::sqrt(1.0f - z2) + face * std::sqrt(z2);
  return normalized(lerp(turned, shading, roughness), face);
}

/// Edges are scaled because the product of two tiny ones is no float.
Vec3 outside_of(const Edges& edges, const Vec3& direction) {
  return normalized(cross(normalized(edges.first, {0, 0, 0}), normalized(edges.second, {0, 0, 0})),
                    -direction);
}

Vec3 smooth_normal(const Scene::Data& scene, const Point& at, const Vec3& outside) {
  return scene.normals.empty() ? outside : normalized(at.mixed(scene.normals), outside);
}

float reflectance_of(float ior) {
  if (ior == 1.5f) return 0.04f;
  const float root = (ior - 1.0f) / (ior + 1.0f);
  return root * root;
}

/// The reflection of a dielectric of another index or colour than most have.
void color_reflection(const Material& m, const Point& at, SurfaceColor& color) {
  const float plain = reflectance_of(m.ior);
  color.specular = at.scaled(m.specular, m.specular_texture, &Vec4::w);
  color.f0 = min(at.tinted(m.specular_color * plain, m.specular_color_texture), {1, 1, 1});
  // An index close to that of air reflects nothing at grazing angles either.
  color.f90 = std::min(1.0f, 50.0f * plain);
}

void color_surface(const Scene::Data& scene, const Material& m, const Point& at, Surface& s) {
  s.color = {m.base_color, m.metallic, m.roughness, m.specular};
  s.emission = m.emission;
  if (!scene.colors.empty()) {
    const Triangle& t = at.corners();
    const Barycentric& w = at.weights();
    const Vec4 &a = scene.colors[t[0]], &b = scene.colors[t[1]], &c = scene.colors[t[2]];
    s.color.base =
        s.color.base * Vec3{w.a * a.x + w.b * b.x + w.c * c.x, w.a * a.y + w.b * b.y + w.c * c.y,
                            w.a * a.z + w.b * b.z + w.c * c.z};
  }
  if (m.base_color_texture.texture != kNone) {
    const Vec4 texel = at.texel(m.base_color_texture);
    s.color.base = s.color.base * Vec3{texel.x, texel.y, texel.z};
  }
  if (m.metallic_roughness_texture.texture != kNone) {
    const Vec4 texel = at.texel(m.metallic_roughness_texture);
    s.color.roughness *= texel.y;
    s.color.metallic *= texel.z;
  }
  if (m.emission_texture.texture != kNone) {
    const Vec4 texel = at.texel(m.emission_texture);
    s.emission = s.emission * Vec3{texel.x, texel.y, texel.z};
  }
  const MaterialKind& kind = scene.kinds[s.material];
  if (kind.colored_reflection) color_reflection(m, at, s.color);
  if (kind.unlit) s.emission = s.color.base;
}

/// In the space of the triangle's corners.
Surface surface_in_part_space(const Scene::Data& scene, const Hit& hit, const Vec3& direction) {
  const Point at(scene, hit);
  const Triangle& t = at.corners();
  const Barycentric& w = at.weights();
  const Vec3 &p0 = scene.positions[t[0]], &p1 = scene.positions[t[1]], &p2 = scene.positions[t[2]];
  const Edges edges{p1 - p0, p2 - p0};

  Surface s;
  s.material = scene.triangles[hit.primitive].material;
  s.point = p0 * w.a + p1 * w.b + p2 * w.c;
  s.offset = kOffset * std::max({coordinate_size(p0), coordinate_size(p1), coordinate_size(p2)});
  const Vec3 outside = outside_of(edges, direction);
  s.behind = dot(outside, direction) > 0.0f;
  s.face = s.behind ? -outside : outside;

  const Material& m = scene.materials[s.material];
  Vec3 shading = smooth_normal(scene, at, outside);
  if (m.normal_texture.texture != kNone)
    shading = mapped_normal(scene, at, m.normal_texture, m.normal_scale, edges, shading);
  s.shading = facing(shading, s.face, direction);
  color_surface(scene, m, at, s);
  if (m.normal_texture.texture != kNone)
    s.shading = reflecting(s.shading, s.face, direction, s.color.roughness);
  return s;
}

}  // namespace

Surface surface_at(const Scene::Data& scene, const SceneHit& hit, const Vec3& direction) {
  if (!scene.clusters) return surface_in_part_space(scene, hit, direction);
  const InstanceTransform& transform = scene.clusters->transform(hit.transform);
  Surface s = surface_in_part_space(scene, hit,
                                    normalized(transform.vector_to_object(direction), direction));
  s.point = transform.point_to_world(s.point);
  s.face = normalized(transform.normal_to_world(s.face), -direction);
  s.shading = normalized(transform.normal_to_world(s.shading), s.face);
  s.offset = std::max(s.offset * transform.scale(), kOffset * coordinate_size(s.point));
  return s;
}

Vec3 coat_normal_at(const Scene::Data& scene, const SceneHit& hit, const Vec3& direction) {
  const InstanceTransform* transform =
      scene.clusters ? &scene.clusters->transform(hit.transform) : nullptr;
  const Vec3 local =
      transform ? normalized(transform->vector_to_object(direction), direction) : direction;
  const Point at(scene, hit);
  const Edges edges = edges_of(scene, at.corners());
  const Vec3 outside = outside_of(edges, local);
  const Material& m = scene.materials[scene.triangles[hit.primitive].material];
  Vec3 normal = smooth_normal(scene, at, outside);
  if (m.clearcoat_normal_texture.texture != kNone)
    normal = mapped_normal(scene, at, m.clearcoat_normal_texture, m.clearcoat_normal_scale, edges,
                           normal);
  const Vec3 face = dot(outside, local) > 0.0f ? -outside : outside;
  normal = facing(normal, face, local);
  if (m.clearcoat_normal_texture.texture != kNone)
    normal = reflecting(normal, face, local, m.clearcoat_roughness);
  return transform ? normalized(transform->normal_to_world(normal), -direction) : normal;
}

float opacity_at(const Scene::Data& scene, const Hit& hit) {
  const TriangleRecord& record = scene.triangles[hit.primitive];
  const Material& m = scene.materials[record.material];
  if (m.alpha_mode == AlphaMode::kOpaque) return 1.0f;
  const Point at(scene, hit);
  float alpha = m.alpha;
  if (!scene.colors.empty()) {
    const Triangle& t = record.corners;
    const Barycentric& w = at.weights();
    alpha *= w.a * scene.colors[t[0]].w + w.b * scene.colors[t[1]].w + w.c * scene.colors[t[2]].w;
  }
  if (m.base_color_texture.texture != kNone) alpha *= at.texel(m.base_color_texture).w;
  if (m.alpha_mode == AlphaMode::kMask) return alpha >= m.alpha_cutoff ? 1.0f : 0.0f;
  return std::clamp(alpha, 0.0f, 1.0f);
}

Vec3 emission_at(const Scene::Data& scene, uint32_t triangle, float u, float v) {
  const Material& m = scene.materials[scene.triangles[triangle].material];
  const Hit point{.primitive = triangle, .u = u, .v = v};
  return Point(scene, point).tinted(m.emission, m.emission_texture) * opacity_at(scene, point);
}

}  // namespace umbel::trace
