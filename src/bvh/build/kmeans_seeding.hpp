// The first representatives of a cluster's items, by a team: each is the best of a few random
// candidates, the one farthest from its nearest representative so far.
#pragma once

#include <limits>

#include "bvh/build/kmeans_points.hpp"

namespace umbel::bvh {

template <uint32_t kMost>
struct KmeansSeedingShared {
  KmeansPoint representatives[kMost];
};

/// Seeds one cluster. Every lane has one of these.
template <KmeansDistance kDistance, uint32_t kMost, typename Team>
class KmeansSeeding {
 public:
  using Shared = KmeansSeedingShared<kMost>;

  /// `nearest` has room for a number an item where teams are single threads.
  UMBEL_HOST_DEVICE KmeansSeeding(const Team& team, const KmeansPoints& points,
                                  const KmeansCluster& cluster, float* nearest, Shared& shared)
      : team_(team),
        points_(points),
        cluster_(cluster),
        nearest_(nearest),
        representatives_(shared.representatives),
        dice_(KmeansDice::of_cluster(cluster.offset, cluster.count)) {}

  /// Returns how many representatives there are: at least two, or one if all items are equal.
  UMBEL_HOST_DEVICE uint32_t run(uint32_t clusters, uint32_t candidates) {
    used_ = 0;
    keep(dice_.draw(0, cluster_.count));
    // Few items: a single thread keeps their distances. Many: only those of the candidates are
    // computed.
    const bool keeps = Team::kIsSerial && cluster_.count < candidates * clusters / 2;
    while (used_ < clusters && add_best(candidates, keeps)) {
    }
    return used_ > 1 ? used_ : choose_farthest();
  }

  /// Where the random candidates were all equal: the first item and the one farthest from it.
  UMBEL_HOST_DEVICE uint32_t choose_farthest() {
    team_.sync();  // what was there may still be read
    used_ = 0;
    keep(0);
    Candidate best;
    for (uint32_t i = 1 + team_.rank(); i < cluster_.count; i += team_.size())
      best.improve({kmeans_distance<kDistance>(representatives_[0], item(i)), i});
    best = farthest(best);
    if (best.distance > 0) keep(best.number);
    return used_;
  }

  /// Writes the representatives to memory.
  UMBEL_HOST_DEVICE void write(KmeansPoint* representatives) const {
    for (uint32_t r = team_.rank(); r < used_; r += team_.size())
      representatives[r] = representatives_[r];
  }

 private:
  static constexpr uint32_t kMostCandidates = 64;

  /// Of candidates equally far, the first counts.
  struct Candidate {
    float distance = 0;
    uint32_t number = 0xffffffffu;

    UMBEL_HOST_DEVICE void improve(const Candidate& o) {
      if (o.distance > distance || (o.distance == distance && o.number < number)) *this = o;
    }
  };
  UMBEL_HOST_DEVICE Candidate farthest(const Candidate& own) const {
    return team_.reduce(own, [](Candidate a, const Candidate& b) {
      a.improve(b);
      return a;
    });
  }

  UMBEL_HOST_DEVICE KmeansPoint item(uint32_t i) const { return points_.at(cluster_.offset + i); }
  UMBEL_HOST_DEVICE uint32_t drawn(uint32_t candidate) const {
    return dice_.draw(used_ * kMostCandidates + candidate, cluster_.count);
  }

  /// An item becomes the next representative.
  UMBEL_HOST_DEVICE void keep(uint32_t i) {
    if (team_.rank() == 0) representatives_[used_] = item(i);
    team_.sync();
    ++used_;
  }

  /// False if no candidate is apart from the representatives.
  UMBEL_HOST_DEVICE bool add_best(uint32_t candidates, bool keeps) {
    if (keeps) update_nearest();
    Candidate best;
    for (uint32_t c = team_.rank(); c < candidates; c += team_.size()) {
      const uint32_t i = drawn(c);
      best.improve({keeps ? nearest_[i] : distance_to_nearest(item(i)), c});
    }
    best = farthest(best);
    if (best.distance == 0) return false;
    keep(drawn(best.number));
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

  const Team& team_;
  const KmeansPoints& points_;
  const KmeansCluster& cluster_;
  float* nearest_;
  KmeansPoint* representatives_;
  KmeansDice dice_;
  uint32_t used_ = 0;
};

}  // namespace umbel::bvh
