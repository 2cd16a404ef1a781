// The first representatives of a cluster's items: each is the best of a few random candidates, the
// one farthest from its nearest representative so far.
#pragma once

#include <limits>

#include "bvh/kmeans_points.hpp"

namespace umbel::bvh {

/// Seeds one cluster, on one thread.
template <KmeansDistance kDistance>
class KmeansSeeding {
 public:
  /// `nearest` has room for a number an item, and `representatives` for `clusters` points.
  UMBEL_HOST_DEVICE KmeansSeeding(const KmeansPoints& points, const KmeansCluster& cluster,
                                  float* nearest, KmeansPoint* representatives)
      : points_(points),
        cluster_(cluster),
        nearest_(nearest),
        representatives_(representatives),
        dice_(KmeansDice::of_cluster(cluster.offset, cluster.count)) {}

  /// Returns how many representatives there are: at least two, or one if all items are at one
  /// place.
  UMBEL_HOST_DEVICE uint32_t run(uint32_t clusters, uint32_t candidates) {
    representatives_[0] = item(dice_.draw(0, cluster_.count));
    used_ = 1;
    // Few items: their distances are kept. Many: only those of the candidates are computed.
    const bool keeps = cluster_.count < candidates * clusters / 2;
    while (used_ < clusters && add_best(candidates, keeps)) {
    }
    return used_ > 1 ? used_ : choose_farthest();
  }

  /// Where the dice found only one place: the first item and the one farthest from it.
  UMBEL_HOST_DEVICE uint32_t choose_farthest() {
    representatives_[0] = item(0);
    float farthest = 0;
    for (uint32_t i = 1; i < cluster_.count; ++i) {
      const KmeansPoint p = item(i);
      const float distance = kmeans_distance<kDistance>(representatives_[0], p);
      if (distance <= farthest) continue;
      farthest = distance;
      representatives_[1] = p;
    }
    return farthest > 0 ? 2 : 1;
  }

 private:
  UMBEL_HOST_DEVICE KmeansPoint item(uint32_t i) const { return points_.at(cluster_.offset + i); }

  /// False if no candidate is apart from the representatives.
  UMBEL_HOST_DEVICE bool add_best(uint32_t candidates, bool keeps) {
    if (keeps) update_nearest();
    float farthest = 0;
    for (uint32_t c = 0; c < candidates; ++c) {
      const uint32_t drawn = dice_.draw(used_ * kMostKmeansClusters + c, cluster_.count);
      const KmeansPoint candidate = item(drawn);
      const float nearest = keeps ? nearest_[drawn] : distance_to_nearest(candidate);
      if (nearest <= farthest) continue;
      farthest = nearest;
      representatives_[used_] = candidate;
    }
    if (farthest == 0) return false;
    ++used_;
    return true;
  }

  UMBEL_HOST_DEVICE void update_nearest() {
    const KmeansPoint last = representatives_[used_ - 1];
    for (uint32_t i = 0; i < cluster_.count; ++i) {
      const float distance = kmeans_distance<kDistance>(item(i), last);
      if (used_ == 1 || distance < nearest_[i]) nearest_[i] = distance;
    }
  }

  UMBEL_HOST_DEVICE float distance_to_nearest(const KmeansPoint& p) const {
    float nearest = std::numeric_limits<float>::max();
    for (uint32_t r = 0; r < used_; ++r) {
      const float distance = kmeans_distance<kDistance>(p, representatives_[r]);
      if (distance < nearest) nearest = distance;
    }
    return nearest;
  }

  const KmeansPoints& points_;
  const KmeansCluster& cluster_;
  float* nearest_;
  KmeansPoint* representatives_;
  KmeansDice dice_;
  uint32_t used_ = 0;
};

}  // namespace umbel::bvh
