// The layers of glTF's extensions at a hit, and the light that passes a hit without refraction.
#pragma once

#include "trace/layered_bsdf.hpp"
#include "trace/surface.hpp"

namespace umbel::trace {

/// Finds kinds of the scene's materials and the tables that they need.
void sort_materials(Scene::Data& scene);

/// The layers of a hit whose surface has been found; `basis` is around its shading normal.
SurfaceLayers layers_at(const Scene::Data& scene, const SceneHit& hit, const Surface& surface,
                        const Basis& basis, const Vec3& direction);

/// What happens to light along a ray at a hit that may be transparent.
struct Passage {
  float stop = 1.0f;         ///< probability with which a path should stop there
  float weight = 1.0f;       ///< of a path that does
  Vec3 through{0, 0, 0};     ///< the transmitted part
  bool leaves_body = false;  ///< or enters one, where `enters_body`
  bool enters_body = false;
};
Passage passage_at(const Scene::Data& scene, const SceneHit& hit, const Vec3& direction);

}  // namespace umbel::trace
