#include "lod/dag/cluster_set.hpp"

#include <algorithm>

#include "base/big_vector.hpp"
#include "base/parallel.hpp"

namespace umbel::lod {

ClusterSet gather_clusters(std::span<const ClusterRef> clusters) {
  ClusterSet out;
  out.vertex_offsets.resize(clusters.size() + 1);
  out.triangle_offsets.resize(clusters.size() + 1);
  for (size_t i = 0; i < clusters.size(); ++i) {
    const auto [set, c] = clusters[i];
    out.vertex_offsets[i + 1] =
        out.vertex_offsets[i] + static_cast<uint32_t>(set->cluster_vertices(c).size());
    out.triangle_offsets[i + 1] =
        out.triangle_offsets[i] + set->triangle_offsets[c + 1] - set->triangle_offsets[c];
  }
  reserve_big(out.vertices, out.vertex_offsets.back());
  out.vertices.resize(out.vertex_offsets.back());
  reserve_big(out.corners, 3 * size_t{out.triangle_offsets.back()});
  out.corners.resize(3 * size_t{out.triangle_offsets.back()});
  out.generating_group.resize(clusters.size());
  out.material.resize(clusters.size());
  out.boxes.resize(clusters.size());
  parallel_for(clusters.size(), 128, [&](size_t i) {
    const auto [set, c] = clusters[i];
    std::ranges::copy(set->cluster_vertices(c), out.vertices.begin() + out.vertex_offsets[i]);
    std::ranges::copy(set->cluster_corners(c),
                      out.corners.begin() + 3 * size_t{out.triangle_offsets[i]});
    out.generating_group[i] = set->generating_group[c];
    out.material[i] = set->material[c];
    out.boxes[i] = set->boxes[c];
  });
  return out;
}

}  // namespace umbel::lod
