#include "query/leaf_store.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "query/ray_frame.hpp"

namespace umbel {

namespace {

/// Triangles and their vertices are scattered in memory.
void fetch_ahead(const MeshView& mesh, std::span<const uint32_t> order, size_t at) {
  constexpr size_t kTriangles = 32, kVertices = 16;
  if (at + kTriangles >= order.size()) return;
  __builtin_prefetch(&mesh.triangles[order[at + kTriangles]]);
  for (const uint32_t vertex : mesh.triangles[order[at + kVertices]])
    __builtin_prefetch(&mesh.positions[vertex]);
}

}  // namespace

std::vector<uint32_t> collect_vertices(const MeshView& mesh, std::span<const uint32_t> order,
                                       BigVector<Vec3>& vertices) {
  std::vector<uint32_t> vertex_ids(mesh.positions.size(), kNone);
  for (const uint32_t primitive : order)
    for (const uint32_t vertex : mesh.triangles[primitive]) {
      if (vertex_ids[vertex] != kNone) continue;
      vertex_ids[vertex] = static_cast<uint32_t>(vertices.size());
      vertices.push_back(mesh.positions[vertex]);
    }
  return vertex_ids;
}

void fill_leaf(const MeshView& mesh, std::span<const uint32_t> masks,
               std::span<const uint32_t> vertex_ids, std::span<const uint32_t> order, uint32_t link,
               LeafStore& out) {
  const uint32_t first = LeafStore::first_reference(link), n = LeafStore::leaf_size(link);
  uint32_t* const words = out.leaves.data() + size_t{first} * out.reference_words();
  const uint32_t corners = out.corner_words();
  for (uint32_t i = 0; i < n; ++i) {
    fetch_ahead(mesh, order, first + i);
    const uint32_t primitive = order[first + i];
    const Triangle& triangle = mesh.triangles[primitive];
    for (uint32_t corner = 0; corner < 3; ++corner) {
      if (out.compact) {
        words[corner * n + i] = vertex_ids[triangle[corner]];
        continue;
      }
      const Vec3& p = mesh.positions[triangle[corner]];
      words[(3 * corner) * n + i] = std::bit_cast<uint32_t>(p.x);
      words[(3 * corner + 1) * n + i] = std::bit_cast<uint32_t>(p.y);
      words[(3 * corner + 2) * n + i] = std::bit_cast<uint32_t>(p.z);
    }
    words[corners * n + i] = primitive;
    if (out.masked) words[(corners + 1) * n + i] = masks[primitive];
  }
}

void prepare_scale(LeafStore& store) {
  store.scale = store.unscale = 1;
  if (store.reference_count == 0) return;
  const Vec3 &low = store.bounds.min, &high = store.bounds.max;
  store.max_abs_coord[0] = std::max(std::fabs(low.x), std::fabs(high.x));
  store.max_abs_coord[1] = std::max(std::fabs(low.y), std::fabs(high.y));
  store.max_abs_coord[2] = std::max(std::fabs(low.z), std::fabs(high.z));
  const float furthest =
      std::max({store.max_abs_coord[0], store.max_abs_coord[1], store.max_abs_coord[2]});
  if (furthest > 0x1p20f || (furthest < 0x1p-20f && furthest > 0)) {
    store.scale = power_of_two(std::clamp(-exponent_of(furthest), -126, 126));
    store.unscale = 1 / store.scale;
  }
}

}  // namespace umbel
