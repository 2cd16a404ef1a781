// A hit's surface: point, normals and colours, from the scene's arrays.
#pragma once

#include "trace/bsdf.hpp"
#include "trace/scene_data.hpp"
#include "trace/vector.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::trace {

struct Surface {
  Vec3 point;
  Vec3 face;     ///< unit normal of the triangle, on the side that is seen
  Vec3 shading;  ///< unit normal for shading, on the same side
  float offset;  ///< how far along `face` a new ray has to start
  SurfaceColor color;
  Vec3 emission;
  uint32_t material;
  bool behind;  ///< the side that is seen is the one from which triangles run clockwise

  /// Where a ray starts that leaves to the side of `direction`.
  Vec3 origin(const Vec3& direction) const {
    return point + face * (dot(face, direction) < 0.0f ? -offset : offset);
  }
};

/// The surface that a ray along `direction` hits.
Surface surface_at(const Scene::Data& scene, const SceneHit& hit, const Vec3& direction);

/// The normal of the clear coat at a hit, on the side that is seen.
Vec3 coat_normal_at(const Scene::Data& scene, const SceneHit& hit, const Vec3& direction);

/// The part of light along a ray that a hit's alpha absorbs, 0..1.
float opacity_at(const Scene::Data& scene, const Hit& hit);

/// The radiance that a point of a light emits, as far as its alpha lets it be seen.
Vec3 emission_at(const Scene::Data& scene, uint32_t triangle, float u, float v);

}  // namespace umbel::trace
