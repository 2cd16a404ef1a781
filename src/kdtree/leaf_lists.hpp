// What structures that list triangles in leaves share: which triangles they take, and how the
// lists become runs of the leaf store.
#pragma once

#include <span>
#include <vector>

#include "query/leaf_store.hpp"
#include "umbel/kdtree.hpp"

namespace umbel {

/// Calls visit(link) for the triangles of a leaf, eight at a time.
template <typename Visit>
void visit_links(const kdtree::Node& leaf, const Visit& visit) {
  for (uint32_t done = 0; done < leaf.count(); done += kMaxLeafTriangles)
    visit(
        LeafStore::leaf_link(leaf.first + done, std::min(kMaxLeafTriangles, leaf.count() - done)));
}

/// The triangles that a structure is built over. Throws as kdtree::build does.
std::vector<uint32_t> usable_triangles(const MeshView& mesh, bvh::InvalidTriangles invalid);

void check_masks(std::span<const uint32_t> masks, size_t triangles);

/// Takes the mesh's properties and the lists of the leaves among `nodes`, which follow each other
/// but where they are shared. `store.compact` is set before.
void fill_store(std::span<const kdtree::Node> nodes, std::span<const uint32_t> references,
                const MeshView& mesh, std::span<const uint32_t> masks, LeafStore& store);

}  // namespace umbel
