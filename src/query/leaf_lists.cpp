#include "query/leaf_lists.hpp"

#include <algorithm>
#include <numeric>
#include <string>

#include "base/parallel.hpp"
#include "mesh/streams.hpp"

namespace umbel {

std::vector<uint32_t> usable_triangles(const MeshView& mesh, bool drops_invalid) {
  if (!drops_invalid) {
    validate(mesh);
    std::vector<uint32_t> all(mesh.triangles.size());
    std::iota(all.begin(), all.end(), 0u);
    return all;
  }
  check_indices(mesh);
  std::vector<uint32_t> usable;
  usable.reserve(mesh.triangles.size());
  for (size_t i = 0; i < mesh.triangles.size(); ++i)
    if (first_invalid_corner(mesh, i) == 3) usable.push_back(static_cast<uint32_t>(i));
  return usable;
}

void check_masks(std::span<const uint32_t> masks, size_t triangles) {
  if (!masks.empty() && masks.size() != triangles)
    throw Error(ErrorCode::kInvalidArgument, "masks must be empty or one a triangle: there are " +
                                                 std::to_string(masks.size()) + " masks and " +
                                                 std::to_string(triangles) + " triangles");
}

void fill_store(std::span<const Range> lists, std::span<const uint32_t> references,
                const MeshView& mesh, std::span<const uint32_t> masks, LeafStore& store) {
  store.masked = std::any_of(masks.begin(), masks.end(), [](uint32_t m) { return m != ~0u; });
  store.triangle_count = static_cast<uint32_t>(mesh.triangles.size());
  store.reference_count = static_cast<uint32_t>(references.size());
  if (references.empty()) return;
  std::vector<uint32_t> links;
  uint32_t filled = 0;
  for (const Range& list : lists) {
    if (list.offset < filled) continue;
    visit_links(list, [&](uint32_t link) { links.push_back(link); });
    filled += list.count;
  }
  std::vector<uint32_t> vertex_ids;
  if (store.compact) vertex_ids = collect_vertices(mesh, references, store.vertices);
  store.leaves.resize(size_t{store.reference_count} * store.reference_words() + kLeafPadding);
  parallel_for(links.size(), 1024,
               [&](size_t i) { fill_leaf(mesh, masks, vertex_ids, references, links[i], store); });
}

}  // namespace umbel
