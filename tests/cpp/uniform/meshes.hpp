// Meshes for the tests of uniform structures.
#pragma once

#include <vector>

#include "bvh/oracle.hpp"

namespace umbel::testing {

/// One as it is, very small, very large, and far from the origin.
inline std::vector<Mesh> balls_of_all_sizes() {
  const Mesh ball = shapes::blob(3, 2);
  return {ball, transformed(ball, 1e-12f), transformed(ball, 1e12f),
          transformed(ball, 1, {1000, -3000, 500})};
}

inline std::vector<uint32_t> mixed_masks(const Mesh& mesh) {
  std::vector<uint32_t> masks(mesh.triangles.size());
  for (uint32_t i = 0; i < masks.size(); ++i) masks[i] = 1 + i % 3;
  return masks;
}

}  // namespace umbel::testing
