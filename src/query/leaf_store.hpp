// How the triangles of leaves are laid out.
#pragma once

#include <span>
#include <vector>

#include "bvh/wide/triangle_bvh_data.hpp"

namespace umbel {

/// The vertices that the triangles in `order` use, in the order in which these come to them, and
/// for each vertex of the mesh its place among them.
std::vector<uint32_t> collect_vertices(const MeshView& mesh, std::span<const uint32_t> order,
                                       BigVector<Vec3>& vertices);

/// Writes the leaf of a link; its triangles are those at the same places of `order`. `masks` is
/// needed where the store is masked, `places` (see collect_vertices) where it is compact.
void fill_leaf(const MeshView& mesh, std::span<const uint32_t> masks,
               std::span<const uint32_t> places, std::span<const uint32_t> order, uint32_t link,
               LeafStore& out);

/// To be called when the bounds are known or have changed.
void prepare_scale(LeafStore& store);

}  // namespace umbel
