// What the builds of the uniform structures have in common.
#pragma once

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "query/leaf_lists.hpp"
#include "umbel/mesh.hpp"

namespace umbel {

/// Runs build(geometry), the mesh's positions and triangles alone, on options.threads.
template <typename Build>
void build_over(const MeshView& mesh, std::span<const uint32_t> masks, const BuildOptions& options,
                const Build& build) {
  check_masks(masks, mesh.triangles.size());
  Progress progress(options);
  progress.report(0, "building");
  with_threads(options.threads, [&] {
    MeshView geometry;
    geometry.positions = mesh.positions;
    geometry.triangles = mesh.triangles;
    build(geometry);
  });
  progress.report(1, "building");
}

}  // namespace umbel
