// The builders of kd-trees, for build().
#pragma once

#include <span>

#include "base/progress.hpp"
#include "kdtree/clip.hpp"
#include "kdtree/grow.hpp"

namespace umbel::kdtree {

/// What a builder is given: some triangles of a mesh, or all of the boxes, all finite; not none.
struct Input {
  const Primitives& primitives;
  std::span<const uint32_t> triangles;  ///< their numbers among the primitives
  std::span<const Aabb> boxes;
  Aabb bounds;
  CostRule rule;
  Allowance allowance;
};

void build_exact(const Input& input, const Config& config, Progress& progress, Branch& root);
void build_binned(const Input& input, const Config& config, Progress& progress, Branch& root);

}  // namespace umbel::kdtree
