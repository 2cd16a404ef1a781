// Radiance along one ray, by path tracing.
#pragma once

#include <array>
#include <cstdint>

#include "trace/sampler.hpp"
#include "trace/scene_data.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {

enum LightKind : uint32_t { kSun, kSky, kTriangles, kLightKinds };

/// With which probability each shadow ray of a hit goes to each kind of light.
struct ShadowPlan {
  uint32_t rays = 0;
  std::array<std::array<float, kLightKinds>, 2> chances{};  ///< of each ray
  std::array<float, kLightKinds> expected{};                ///< rays of each kind
};

/// Rays go to kinds in proportion to their light: each gets an eighth at least, and of two rays one
/// at most where others can take the second.
ShadowPlan plan_shadows(const Scene::Data& scene, uint32_t shadow_samples);

struct PathContext {
  const Scene::Data& scene;
  const Settings& settings;
  ShadowPlan plan;
};

/// The dimensions of a sampler that a path's start uses; bounces come after them.
inline constexpr uint32_t kPixelDimension = 0, kLensDimension = 1, kFirstBounceDimension = 2;

/// Radiance against the direction of `ray`. Counts its rays.
Vec3 trace_path(const PathContext& context, Ray ray, const Sampler& sampler, Statistics& counts);

/// What a denoiser is told about a pixel beside its radiance.
struct FirstHit {
  Vec3 albedo{0, 0, 0};  ///< of what is seen, each in [0, 1]; of the sky its colour, at most 1
  Vec3 normal{0, 0, 0};  ///< unit length, on the side that is seen; zero for the sky
};
/// That of the first surface that a path along `ray` with this sampler meets.
FirstHit trace_first_hit(const PathContext& context, Ray ray, const Sampler& sampler);

}  // namespace umbel::trace
