// Interpolates a scene's arrays at a point of a triangle.
#pragma once

#include "trace/scene_data.hpp"
#include "trace/vector.hpp"

namespace umbel::trace {

struct Barycentric {
  float a, b, c;
};

inline Barycentric weights_of(float u, float v) { return {1.0f - u - v, u, v}; }

inline Vec2 uv_at(const std::vector<Vec2>& uvs, const Triangle& t, const Barycentric& w) {
  if (uvs.empty()) return {0, 0};
  const Vec2 &a = uvs[t[0]], &b = uvs[t[1]], &c = uvs[t[2]];
  return {w.a * a.x + w.b * b.x + w.c * c.x, w.a * a.y + w.b * b.y + w.c * c.y};
}

/// A point of a triangle. Computes its first texture coordinates once, and others when asked for.
class Point {
 public:
  Point(const Scene::Data& scene, const Hit& hit) : Point(scene, hit.primitive, hit.u, hit.v) {}
  Point(const Scene::Data& scene, uint32_t triangle, float u, float v)
      : scene_(scene),
        corners_(scene.triangles[triangle].corners),
        weights_(weights_of(u, v)),
        uv_(uv_at(scene.uvs, corners_, weights_)) {}

  const Triangle& corners() const { return corners_; }
  const Barycentric& weights() const { return weights_; }

  Vec4 texel(const TextureUse& use) const {
    const Vec2 uv = use.uv_set == 0 ? uv_ : uv_at(scene_.uvs_of(use.uv_set), corners_, weights_);
    return scene_.textures[use.texture].lookup(transformed(use, uv));
  }

  Vec3 mixed(const std::vector<Vec3>& values) const {
    return values[corners_[0]] * weights_.a + values[corners_[1]] * weights_.b +
           values[corners_[2]] * weights_.c;
  }

  /// A colour or number times what a texture, if there is one, has in it.
  Vec3 tinted(const Vec3& color, const TextureUse& use) const {
    if (use.texture == kNone || is_black(color)) return color;
    const Vec4 t = texel(use);
    return color * Vec3{t.x, t.y, t.z};
  }
  float scaled(float value, const TextureUse& use, float Vec4::* channel) const {
    return use.texture == kNone || value == 0.0f ? value : value * (texel(use).*channel);
  }

 private:
  const Scene::Data& scene_;
  const Triangle& corners_;
  Barycentric weights_;
  Vec2 uv_;
};

}  // namespace umbel::trace
