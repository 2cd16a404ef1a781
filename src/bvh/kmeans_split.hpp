// One step of k-means clustering: divides the items of one cluster among at most k representatives
// (Meister & Bittner, "Parallel BVH Construction using k-means Clustering", 2016). What is summed
// is integers, so the result does not depend on how the work is divided among threads.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/exec.hpp"
#include "base/hash.hpp"
#include "base/math.hpp"
#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// A primitive's box, as it is moved from cluster to cluster.
struct KmeansItem {
  Vec3 min;
  uint32_t primitive;
  Vec3 max;
  uint32_t label;  ///< the representative that it was assigned to last
};
static_assert(sizeof(KmeansItem) == 32);

/// A box as a point of six dimensions.
struct KmeansPoint {
  float v[6];
};

UMBEL_HOST_DEVICE inline KmeansPoint point_of(const KmeansItem& item) {
  return {{item.min.x, item.min.y, item.min.z, item.max.x, item.max.y, item.max.z}};
}

template <KmeansDistance kDistance>
UMBEL_HOST_DEVICE inline float distance_along(float a, float b) {
  const float d = a - b;
  if constexpr (kDistance == KmeansDistance::kEuclidean) return d * d;
  return d < 0 ? -d : d;
}

/// Summed in the order of the components, here as everywhere.
template <KmeansDistance kDistance>
UMBEL_HOST_DEVICE inline float kmeans_distance(const KmeansPoint& a, const KmeansPoint& b) {
  float sum = distance_along<kDistance>(a.v[0], b.v[0]);
  for (int c = 1; c < 6; ++c) sum += distance_along<kDistance>(a.v[c], b.v[c]);
  return sum;
}

/// Coordinates as integers, so that sums of them are exact.
struct KmeansGrid {
  Vec3 origin;
  float scale;  ///< a power of two: 2^30 or less for the longest side of the scene
  double cell;  ///< 1 / scale

  static KmeansGrid around(const Aabb& scene);
};

/// Sums over the items of one representative.
struct KmeansSum {
  int64_t v[6];
  uint64_t count;
};

/// Random numbers that depend on nothing but the cluster's place.
struct KmeansDice {
  uint64_t key;

  UMBEL_HOST_DEVICE static KmeansDice of_cluster(uint32_t offset, uint32_t count) {
    return {mix64(uint64_t(offset) << 32 | count)};
  }
  /// Uniform in [0, count).
  UMBEL_HOST_DEVICE uint32_t draw(uint32_t number, uint32_t count) const {
    return static_cast<uint32_t>(((mix64(key + number) >> 32) * count) >> 32);
  }
};

inline KmeansTimes operator+(const KmeansTimes& a, const KmeansTimes& b) {
  return {a.seeding + b.seeding, a.iterations + b.iterations, a.reordering + b.reordering,
          a.agglomeration + b.agglomeration};
}

/// Adds the time since the last lap, or since it was made, to a stage.
class StageClock {
 public:
  void lap(double& stage) {
    const auto now = std::chrono::steady_clock::now();
    stage += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Divides clusters. Keeps its memory from one to the next, so make one a thread.
class KmeansSplitter {
 public:
  KmeansSplitter(const KmeansConfig& config, const KmeansGrid& grid)
      : config_(config), grid_(grid) {}

  /// Moves the `count` items of the cluster at `offset`, at least two, from `items` to `moved`,
  /// those of each new cluster together and in their old order, and returns the sizes of the new
  /// clusters, at least two. With `parallel` uses all threads.
  std::span<const uint32_t> split(KmeansItem* items, KmeansItem* moved, uint32_t offset,
                                  uint32_t count, bool parallel);

  /// The same for items that distance does not tell apart: parts of about equal size, in order.
  std::span<const uint32_t> split_evenly(const KmeansItem* items, KmeansItem* moved,
                                         uint32_t count);

  /// Of all splits so far.
  const KmeansTimes& times() const { return times_; }

 private:
  static constexpr uint32_t kMost = 64;     ///< representatives
  static constexpr uint32_t kChunk = 4096;  ///< items of one unit of parallel work

  struct Cluster {
    KmeansItem* items;
    uint32_t count;
    bool parallel;
  };

  template <KmeansDistance kDistance>
  std::span<const uint32_t> split_by(Cluster cluster, KmeansItem* moved, KmeansDice dice);
  template <KmeansDistance kDistance>
  void choose_representatives(Cluster cluster, KmeansDice dice);
  template <KmeansDistance kDistance>
  bool add_best_candidate(Cluster cluster, KmeansDice dice);
  template <KmeansDistance kDistance>
  bool choose_farthest(Cluster cluster);
  template <KmeansDistance kDistance>
  bool assign(Cluster cluster);
  template <KmeansDistance kDistance>
  bool assign_chunk(KmeansItem* items, uint32_t count, KmeansSum* sums) const;
  uint32_t nonempty() const;
  void move_to_means();
  void move_to_medians(Cluster cluster);
  std::span<const uint32_t> gather(Cluster cluster, KmeansItem* moved);

  template <typename Body>
  void each_chunk(Cluster cluster, const Body& body) const;

  KmeansConfig config_;
  KmeansGrid grid_;
  uint32_t used_ = 0;  ///< representatives, at most config_.clusters
  KmeansPoint representatives_[kMost];
  KmeansSum sums_[kMost];
  std::vector<KmeansSum> chunk_sums_;  ///< kMost a chunk
  std::vector<float> nearest_;         ///< distance of each item to its nearest representative
  std::vector<float> values_;          ///< of one component, grouped by representative
  std::vector<uint32_t> sizes_;
  KmeansTimes times_;
};

}  // namespace umbel::bvh
