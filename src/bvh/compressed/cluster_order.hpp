// The order of triangles for a radix tree that has a subtree for every cluster, and above those a
// tree over the clusters: for any executor. A code has, from the highest bit down, the Morton code
// of the cluster in the scene, the cluster's rank by that, which no two have in common, and the
// Morton code of the triangle in its cluster.
#pragma once

#include <algorithm>

#include "base/bit_count.hpp"
#include "base/morton.hpp"
#include "cluster/frame/frame_mesh.hpp"

namespace umbel::bvh {

/// Clusters as ranges of the boxes that a tree is built over, in an executor's memory.
struct ClusterRanges {
  const uint32_t* offsets;
  const Aabb* boxes;
  const uint32_t* count;
  uint32_t most = 0;  ///< clusters; 0: the tree knows of none
};

/// How the bits of a code are shared out.
struct ClusterCodeBits {
  static constexpr uint32_t kOfTriangle = 8;  ///< an axis

  uint32_t rank;
  uint32_t of_cluster;  ///< an axis

  explicit ClusterCodeBits(uint32_t most)
      : rank(32 - leading_zeros(most - 1)),
        of_cluster(std::min((64 - 3 * kOfTriangle - rank) / 3, 10u)) {}
  /// All but those of the cluster's code, which the rank stands for.
  uint32_t below_cluster() const { return rank + 3 * kOfTriangle; }
};

/// A box around a point, but not around a NaN, whose minimum depends on the order.
UMBEL_HOST_DEVICE inline Aabb box_around(const Vec3& point) {
  Aabb box;
  extend(box, point);
  return box;
}

/// Codes of the triangles of the cluster with rank i.
struct CodeOneCluster {
  static constexpr uint32_t kLanes = 32;
  using Shared = NothingShared;

  ClusterRanges clusters;
  const Aabb* boxes;              ///< of triangles
  const uint32_t* codes_by_rank;  ///< of clusters
  const uint32_t* cluster_by_rank;
  uint32_t rank_bits;
  uint64_t* codes;
  uint32_t* primitives;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t rank, Shared&) const {
    const uint32_t cluster = cluster_by_rank[rank];
    const uint32_t begin = clusters.offsets[cluster], end = clusters.offsets[cluster + 1];
    Aabb centers;
    for (uint32_t i = begin + team.rank(); i < end; i += team.size())
      extend(centers, boxes[i].min + boxes[i].max);
    centers = team.reduce(centers, cluster::UniteBoxes{});
    constexpr uint32_t kBits = ClusterCodeBits::kOfTriangle;
    const MortonGrid grid = MortonGrid::around(centers, kBits);
    const uint64_t head = (uint64_t(codes_by_rank[rank]) << rank_bits | rank) << 3 * kBits;
    for (uint32_t i = begin + team.rank(); i < end; i += team.size()) {
      codes[i] = head | grid.code<uint32_t>(boxes[i]);
      primitives[i] = i;
    }
  }
};

/// n > 0 triangles, of which every cluster has some neighbouring ones.
template <typename Exec>
MortonOrder<Exec, uint64_t> cluster_order(Exec& exec, const Aabb* boxes, size_t n,
                                          const ClusterRanges& clusters) {
  const ClusterCodeBits bits(clusters.most);
  MortonOrder<Exec, uint64_t> order{exec.template allocate<uint64_t>(n),
                                    exec.template allocate<uint32_t>(n)};
  auto centers = exec.template allocate<Aabb>(1);
  auto codes = exec.template allocate<uint32_t>(clusters.most);
  auto ranked = exec.template allocate<uint32_t>(clusters.most);
  exec.reduce(
      clusters.most, Aabb{},
      [=] UMBEL_DEVICE_LAMBDA(size_t i) {
        if (i >= *clusters.count) return Aabb{};
        return box_around(clusters.boxes[i].min + clusters.boxes[i].max);
      },
      cluster::UniteBoxes{}, centers.data());
  exec.for_each(clusters.most, [=, around = centers.data(), codes = codes.data(),
                                ranked = ranked.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
    // What does not exist goes last.
    codes[i] = i < *clusters.count ? MortonGrid::around(*around, bits.of_cluster)
                                         .template code<uint32_t>(clusters.boxes[i])
                                   : (1u << 3 * bits.of_cluster) - 1;
    ranked[i] = static_cast<uint32_t>(i);
  });
  exec.radix_sort_pairs(clusters.most, codes.data(), ranked.data(), 0u, 3 * bits.of_cluster);
  exec.for_each_team_of(clusters.count, clusters.most,
                        CodeOneCluster{clusters, boxes, codes.data(), ranked.data(), bits.rank,
                                       order.codes.data(), order.primitives.data()});
  exec.radix_sort_pairs(n, order.codes.data(), order.primitives.data(), 0u, bits.below_cluster());
  return order;
}

}  // namespace umbel::bvh
