// From a mesh to the leaf store of a structure whose leaves list triangles: which triangles it
// takes, and how its lists become leaves of up to eight.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "query/leaf_store.hpp"

namespace umbel {

using TriangleCorners = std::array<Vec3, 3>;

inline TriangleCorners corners_of(const MeshView& mesh, uint32_t triangle) {
  const Triangle& t = mesh.triangles[triangle];
  return {mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]};
}

/// Calls visit(link) for the leaves of a list of references.
template <typename Visit>
void visit_links(const Range& list, const Visit& visit) {
  for (uint32_t done = 0; done < list.count; done += kMaxLeafTriangles)
    visit(LeafStore::leaf_link(list.offset + done, std::min(kMaxLeafTriangles, list.count - done)));
}

/// The triangles that a structure is built over. A NaN or infinite vertex in a triangle throws
/// kInvalidMesh, unless such triangles are dropped; so does an index out of range in any case.
std::vector<uint32_t> usable_triangles(const MeshView& mesh, bool drops_invalid);

void check_masks(std::span<const uint32_t> masks, size_t triangles);

/// Fills the store with the triangles of `references`; each of `lists` is a range of them. Ranges
/// follow each other; one that begins before the last one ended shares its references. The caller
/// has set `store.compact`.
void fill_store(std::span<const Range> lists, std::span<const uint32_t> references,
                const MeshView& mesh, std::span<const uint32_t> masks, LeafStore& store);

}  // namespace umbel
