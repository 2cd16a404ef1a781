// What glTF's extensions say at a hit, and the light that goes through a hit without being bent.
#pragma once

#include "trace/layered_bsdf.hpp"
#include "trace/surface.hpp"

namespace umbel::trace {

/// Finds kinds of the scene's materials and the tables that they need.
void sort_materials(Scene::Data& scene);

/// The layers of a hit whose surface has been found; `frame` is around its shading normal.
SurfaceLayers layers_at(const Scene::Data& scene, const SceneHit& hit, const Surface& surface,
                        const Frame& frame, const Vec3& direction);

/// What light along a ray does at a hit that may let it through.
struct Passage {
  float stop = 1.0f;         ///< probability with which a path should stop there
  float weight = 1.0f;       ///< of a path that does
  Vec3 through{0, 0, 0};     ///< the part that goes on
  bool leaves_body = false;  ///< or enters one, where `enters_body`
  bool enters_body = false;
};
Passage passage_at(const Scene::Data& scene, const SceneHit& hit, const Vec3& direction);

}  // namespace umbel::trace
