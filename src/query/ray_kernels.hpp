// The ray queries, one table of functions for each kind of nodes and instruction set.
#pragma once

#include "query/leaf_store.hpp"

namespace umbel {

/// Each takes the structure that it was made for, which has at least one triangle, and any ray.
struct RayKernels {
  Hit (*intersect)(const LeafStore& tree, const Ray& ray, const RayOptions& options);
  bool (*occluded)(const LeafStore& tree, const Ray& ray, const RayOptions& options);
  size_t (*all_hits)(const LeafStore& tree, const Ray& ray, std::span<Hit> hits,
                     const RayOptions& options);
};

/// For structures without triangles, so that no kernel has to ask.
extern const RayKernels kNoRays;

/// What kAuto means on this machine, or `wanted` itself. Throws kUnsupported where the machine
/// lacks the instructions asked for, kInvalidArgument for what is no value of Simd.
Simd choose_simd(Simd wanted);

}  // namespace umbel
