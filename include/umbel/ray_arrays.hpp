// Many rays at once, with origins, directions and intervals in arrays of their own, as NumPy,
// Fortran and GPU programs store them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "umbel/triangle_queries.hpp"
#include "umbel/types.hpp"

namespace umbel {

/// Rays by their parts. Each array has one element a ray, or one element for all rays; the two of
/// the interval may be empty (0 and infinity).
struct RayArrays {
  std::span<const Vec3> origins;
  std::span<const Vec3> directions;
  std::span<const float> t_min;
  std::span<const float> t_max;
};

/// How many rays these are. Throws kInvalidArgument naming the array whose length does not fit.
UMBEL_API size_t ray_count(const RayArrays& rays);

/// Where the parts of hits go: one element a ray (those of Hit), or empty where not wanted.
struct HitArrays {
  std::span<float> t;
  std::span<uint32_t> primitive;
  std::span<float> u;
  std::span<float> v;
};

/// The nearest hit of each ray, in parallel (threads: 0 means all cores).
UMBEL_API void intersect(const TriangleQueries& structure, const RayArrays& rays,
                         const HitArrays& hits, const RayOptions& options = {},
                         uint32_t threads = 0);

/// 1 for each ray that hits anything, else 0; `results` has one element a ray.
UMBEL_API void occluded(const TriangleQueries& structure, const RayArrays& rays,
                        std::span<uint8_t> results, const RayOptions& options = {},
                        uint32_t threads = 0);

/// The hits of ray i are those at [offsets[i], offsets[i + 1]).
struct AllHits {
  std::vector<uint64_t> offsets;
  std::vector<Hit> hits;
};

/// The nearest `max_hits` hits of each ray (0: all of them) in the order of (t, primitive).
UMBEL_API AllHits all_hits(const TriangleQueries& structure, const RayArrays& rays,
                           size_t max_hits = 0, const RayOptions& options = {},
                           uint32_t threads = 0);

}  // namespace umbel
