// How much the areas of clusters have grown since they were built, for any executor: boxes are
// refitted to new positions, and their areas compared with those at the build.
//
// Areas are shares of the area of the box of all, so that a mesh that is only scaled has no growth,
// and integers, so that sums do not depend on their order.
#pragma once

#include <cstdint>

#include "base/exec.hpp"
#include "cluster/frame/frame_mesh.hpp"

namespace umbel::cluster {

/// Shares; kWhole is that of the box of all. Below 2^23 clusters their sum fits.
struct AreaShares {
  static constexpr uint64_t kWhole = uint64_t(1) << 40;

  uint64_t* now;       ///< one a cluster
  uint64_t* at_build;  ///< one a cluster
  uint64_t* total;     ///< of `now` and of `at_build`
};

/// The boxes of clusters whose triangles have moved, by a team each.
struct RefitCluster {
  static constexpr uint32_t kLanes = 32;
  using Shared = NothingShared;

  FrameMesh ordered;  ///< the triangles in cluster order
  FrameClusters clusters;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t cluster, Shared&) const {
    if (cluster >= *clusters.count) return;
    const uint32_t end = clusters.offsets[cluster + 1];
    Aabb box;
    for (uint32_t i = clusters.offsets[cluster] + team.rank(); i < end; i += team.size())
      extend(box, ordered.box(i));
    box = team.reduce(box, UniteBoxes{});
    // Which of two equal zeros a minimum gives depends on the order.
    if (team.rank() == 0) clusters.boxes[cluster] = without_negative_zero(box);
  }
};

UMBEL_HOST_DEVICE inline double double_half_area(const Aabb& box) {
  const double x = double(box.max.x) - double(box.min.x), y = double(box.max.y) - double(box.min.y),
               z = double(box.max.z) - double(box.min.z);
  return x * y + y * z + z * x;
}

/// Of the box of all, whose area is `whole`. Positions that are not finite make boxes without a
/// size, which count as the whole; a box of nothing counts as none. So no share is above kWhole.
UMBEL_HOST_DEVICE inline uint64_t share_of(const Aabb& box, double whole) {
  const double area = is_empty(box) ? 0.0 : double_half_area(box);
  if (area < whole) return uint64_t(area / whole * double(AreaShares::kWhole));
  return area == 0 ? 0 : AreaShares::kWhole;
}

struct AddShares {
  UMBEL_HOST_DEVICE uint64_t operator()(uint64_t a, uint64_t b) const { return a + b; }
};

/// Measures clusters by their boxes. With `is_new` this is what they are compared with from now on.
template <typename Exec>
void measure_area_growth(Exec& exec, const FrameClusters& clusters, uint32_t most_clusters,
                         const AreaShares& shares, bool is_new) {
  const auto all = exec.template allocate<Aabb>(1);
  exec.reduce(
      most_clusters, Aabb{},
      [=] UMBEL_DEVICE_LAMBDA(size_t c) {
        return c < *clusters.count ? clusters.boxes[c] : Aabb{};
      },
      UniteBoxes{}, all.data());
  exec.for_each(most_clusters, [=, all = all.data()] UMBEL_DEVICE_LAMBDA(size_t c) {
    if (c >= *clusters.count) return;
    const double whole = double_half_area(*all);
    shares.now[c] = share_of(clusters.boxes[c], whole);
    if (is_new) shares.at_build[c] = shares.now[c];
  });
  const uint64_t* of[2] = {shares.now, shares.at_build};
  for (int k = 0; k < 2; ++k) {
    exec.reduce(
        most_clusters, uint64_t(0),
        [=, share = of[k]] UMBEL_DEVICE_LAMBDA(size_t c) -> uint64_t {
          return c < *clusters.count ? share[c] : 0;
        },
        AddShares{}, shares.total + k);
  }
}

}  // namespace umbel::cluster
