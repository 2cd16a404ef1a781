// Parallel locally-ordered clustering (Meister & Bittner, "Parallel Locally-Ordered Clustering for
// Bounding Volume Hierarchy Construction", 2018), for any executor: clusters in Morton order each
// look for the neighbour within a radius with which they have the smallest box; those that found
// each other merge, all at once, until one is left.
#pragma once

#include <cstdint>
#include <limits>
#include <utility>

#include "base/morton.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// A cluster that is not merged yet.
struct PlocCluster {
  Aabb box;
  Subtree subtree;
  uint32_t count;  ///< primitives
};

/// The cluster that is nearest to the i-th, of those that are no farther from it in the order: the
/// one with the least area of the common box; of pairs as near, first those that differ least in
/// the bits of their indices. That orders pairs totally, so that some two always find each other;
/// and among clusters that are all alike every one finds a partner.
template <typename Cluster>
UMBEL_HOST_DEVICE uint32_t nearest_within(const Cluster* clusters, uint32_t count, uint32_t i,
                                          uint32_t radius) {
  const uint32_t begin = i > radius ? i - radius : 0;
  const uint32_t end = count - i > radius + 1 ? i + radius + 1 : count;
  const Aabb box = clusters[i].box;
  float least = std::numeric_limits<float>::infinity();
  uint32_t least_bits = 0xffffffffu, nearest = i;
  for (uint32_t j = begin; j < end; ++j) {
    const float area = united_area(box, clusters[j].box);
    const uint32_t bits = i ^ j;
    // Without branches, which lanes of a warp would take by turns.
    const bool is_nearer = (bits != 0) & ((area < least) | ((area == least) & (bits < least_bits)));
    least = is_nearer ? area : least;
    least_bits = is_nearer ? bits : least_bits;
    nearest = is_nearer ? j : nearest;
  }
  return nearest;
}

template <typename Exec>
class Ploc {
 public:
  /// Writes the n - 1 merges of n > 0 boxes, and the root. Reads how many clusters are left after
  /// every round.
  void run(Exec& exec, const Aabb* boxes, uint32_t n, uint32_t radius, Merge* merges,
           Subtree* root) {
    const auto clusters = exec.template allocate<PlocCluster>(n);
    const auto others = exec.template allocate<PlocCluster>(n);
    const auto nearest = exec.template allocate<uint32_t>(n);
    const auto targets = exec.template allocate<uint64_t>(n + size_t{1});
    clusters_ = clusters.data();
    merged_ = others.data();
    nearest_ = nearest.data();
    targets_ = targets.data();
    gather(exec, boxes, n);
    uint32_t made = 0;
    for (uint32_t left = n; left > 1;) {
      uint32_t pairs = find_pairs(exec, left, radius);
      // Where boxes grow from one to the next, few find each other.
      if (pairs < left / kFew) pairs = pair_neighbors(exec, left);
      if (exec.counts()) break;
      merge(exec, left, made, merges);
      made += pairs;
      left -= pairs;
    }
    exec.for_each(1, [clusters = clusters_, root] UMBEL_DEVICE_LAMBDA(size_t) {
      *root = clusters[0].subtree;
    });
  }

  // The steps of `run`. They are public because CUDA takes no lambdas from private members.

  void gather(Exec& exec, const Aabb* boxes, uint32_t n) {
    const auto order = morton_order<uint64_t>(exec, boxes, n, 21);
    exec.for_each(
        n, [=, to = clusters_, primitives = order.primitives.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
          to[i] = {boxes[primitives[i]], Subtree::of_primitive(primitives[i]), 1};
        });
  }

  uint32_t find_pairs(Exec& exec, uint32_t count, uint32_t radius) {
    exec.for_each(count, [=, clusters = clusters_, to = nearest_] UMBEL_DEVICE_LAMBDA(size_t i) {
      to[i] = nearest_within(clusters, count, static_cast<uint32_t>(i), radius);
    });
    return count_pairs(exec, count);
  }

  uint32_t pair_neighbors(Exec& exec, uint32_t count) {
    exec.for_each(count, [=, to = nearest_] UMBEL_DEVICE_LAMBDA(size_t i) {
      const auto other = static_cast<uint32_t>(i ^ 1);
      to[i] = other < count ? other : static_cast<uint32_t>(i);
    });
    return count_pairs(exec, count);
  }

  /// Numbers the pairs, and the clusters that there will be.
  uint32_t count_pairs(Exec& exec, uint32_t count) {
    exec.exclusive_scan(
        count,
        [nearest = nearest_] UMBEL_DEVICE_LAMBDA(size_t i) -> uint64_t {
          const bool is_paired = nearest[nearest[i]] == i;
          return (is_paired && i < nearest[i] ? 1 : 0) |
                 (is_paired && nearest[i] < i ? 0 : uint64_t{1} << 32);
        },
        targets_);
    return static_cast<uint32_t>(exec.read(targets_ + count));
  }

  void merge(Exec& exec, uint32_t count, uint32_t made, Merge* merges) {
    exec.for_each(count, [=, from = clusters_, to = merged_, nearest = nearest_,
                          targets = targets_] UMBEL_DEVICE_LAMBDA(size_t i) {
      const uint32_t other = nearest[i];
      const bool is_pair = other != i && nearest[other] == i;
      if (is_pair && other < i) return;
      PlocCluster cluster = from[i];
      if (is_pair) {
        const PlocCluster& right = from[other];
        const uint32_t merge = made + static_cast<uint32_t>(targets[i]);
        cluster.box = united(cluster.box, right.box);
        cluster.count += right.count;
        merges[merge] = {cluster.box, cluster.subtree, right.subtree, cluster.count};
        cluster.subtree = Subtree::of_merge(merge);
      }
      to[targets[i] >> 32] = cluster;
    });
    std::swap(clusters_, merged_);
  }

 private:
  static constexpr uint32_t kFew = 64;

  // Pointers change places after each round; buffers must not, or their memory is not given back.
  PlocCluster *clusters_ = nullptr, *merged_ = nullptr;
  uint32_t* nearest_ = nullptr;
  uint64_t* targets_ =
      nullptr;  ///< the pairs before each, and above them the clusters there will be
};

}  // namespace umbel::bvh
