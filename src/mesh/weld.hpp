// Welding that says where each vertex came from.
#pragma once

#include <cstdint>
#include <vector>

#include "umbel/mesh.hpp"

namespace umbel {

struct TracedWeld {
  Mesh mesh;
  /// Of each vertex: the first vertex of the input, in the order in which triangles use them, that
  /// it stands for.
  std::vector<uint32_t> sources;
};

/// As `weld`.
TracedWeld weld_and_trace(const MeshView& mesh, const BuildOptions& options);

}  // namespace umbel
