// Checks of everything that a caller may get wrong. Each failure is one sentence.
#pragma once

#include "base/simd/box4.hpp"
#include "umbel/cluster.hpp"

namespace umbel::cluster {

void validate_config(const ClusterConfig& config);

/// All but the boxes and centroids themselves, which are checked where they are read.
void validate_layout(const ClusterInput& input, const ClusterConfig& config);

/// Throws kInvalidMesh with the first item in [begin, end) whose box or centroid is not finite.
void validate_boxes(const ClusterInput& input, size_t begin, size_t end);

/// The same for all items, in parallel.
void validate_all_boxes(const ClusterInput& input);

/// A mesh that is to be clustered: indices within the positions, and finite positions where
/// triangles use them. Attributes do not matter. Returns a box that holds all triangles: theirs,
/// unless positions that no triangle uses lie outside of it.
Box4 validate_triangles(const MeshView& mesh, const ClusterConfig& config,
                        float shared_vertex_weight);

}  // namespace umbel::cluster
