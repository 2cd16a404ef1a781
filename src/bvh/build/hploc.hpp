// Hierarchical parallel locally-ordered clustering for any executor (Benthin, Meister, Barczak,
// Mehalwal, Tsakok & Kensler, "H-PLOC: Hierarchical Parallel Locally-Ordered Clustering for
// Bounding Volume Hierarchy Construction", 2024): teams climb the radix tree over the Morton codes,
// and at every node with many primitives merge the few clusters that its two children left, in
// rounds in shared memory, until few are left. All is one kernel, and nothing waits.
//
// What a node forwards depends on nothing but what is below it, and a merge takes the number of one
// of the two that it joins, so the same bytes come out whatever the order in which nodes are done.
#pragma once

#include "base/bit_count.hpp"
#include "bvh/build/ploc.hpp"
#include "bvh/build/radix_splits.hpp"
#include "bvh/tree/merge_sums.hpp"

namespace umbel::bvh {

/// A cluster, and the number that the merge it will be the right part of takes.
struct HplocCluster {
  Aabb box;
  Subtree subtree;
  uint32_t count;
  uint32_t slot;
};

/// A team takes the leaves of kLanes codes.
template <typename Sums>
struct HplocClimb {
  static constexpr uint32_t kLanes = 32;
  static constexpr uint32_t kKept = kLanes / 2;  ///< clusters that a node forwards, at most

  /// A node at which two children have met, and which has clusters to merge.
  struct Met {
    uint32_t begin, middle;  ///< where the codes of its children begin
    uint32_t left, right;    ///< clusters of its children
    uint32_t most;           ///< that it may forward
  };
  struct Shared {
    Met met[kLanes];
    HplocCluster clusters[kLanes], merged[kLanes];
    uint32_t nearest[kLanes];
  };

  const uint64_t* codes;
  uint32_t n;
  uint32_t radius;
  /// Of the nodes of the radix tree: the far end of the child that came first, and the clusters
  /// that it forwarded.
  uint64_t* first_child;
  HplocCluster* clusters;  ///< those of a node begin where its codes begin
  Merge* merges;
  Subtree* root;
  Sums sums;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    for (uint32_t first = 0; first < kLanes; first += team.size()) {
      const uint32_t own = first + team.rank();
      const size_t leaf = index * kLanes + own;
      climb(team, own < kLanes && leaf < n, static_cast<uint32_t>(leaf), shared);
    }
  }

 private:
  /// Every lane from a leaf of its own.
  template <typename Team>
  UMBEL_HOST_DEVICE void climb(const Team& team, bool is_active, uint32_t leaf,
                               Shared& shared) const {
    RadixClimb up{};
    if (is_active) up = RadixClimb::from(codes, n, leaf);
    uint32_t kept = 1;
    while (team.ballot(is_active) != 0) {
      bool is_large = false;
      if (is_active) is_active = meet(up, kept, shared.met[team.rank()], is_large);
      uint32_t large = team.ballot(is_large);
      team.sync();
      while (large != 0) {
        const auto lane = lowest_bit(large);
        large &= large - 1;
        const uint32_t left = merge_at(team, shared.met[lane], shared);
        if (lane == team.rank()) kept = left;
      }
      team.sync();
      if (is_active && up.is_all()) {
        *root = clusters[0].subtree;
        is_active = false;
      }
    }
  }

  /// Goes up to the next node; false for the first one that arrives there.
  UMBEL_HOST_DEVICE bool meet(RadixClimb& up, uint32_t& kept, Met& met, bool& is_large) const {
    if (up.is_all()) return true;  // the only leaf
    const bool is_right = up.is_right();
    const uint32_t parent = up.parent();
    uint64_t other = 0;
    if (!is_second_to_meet(&first_child[parent], uint64_t{up.far_end()} << 32 | kept, other))
      return false;
    up.go_up(static_cast<uint32_t>(other >> 32));
    const bool is_root = up.is_all();
    is_large = up.count() > kKept || is_root;
    if (is_large) {
      const auto other_kept = static_cast<uint32_t>(other);
      met.begin = up.begin;
      met.middle = parent + 1;
      met.left = is_right ? other_kept : kept;
      met.right = is_right ? kept : other_kept;
      met.most = is_root ? 1 : kKept;
    }
    // Few are forwarded as they are: those of the right child follow those of the left one.
    kept = up.count();
    return true;
  }

  /// Returns how many clusters are left, which the team may read after its next sync().
  template <typename Team>
  UMBEL_HOST_DEVICE uint32_t merge_at(const Team& team, const Met& met, Shared& shared) const {
    uint32_t count = met.left + met.right;
    for (uint32_t i = team.rank(); i < count; i += team.size())
      shared.clusters[i] = clusters[i < met.left ? met.begin + i : met.middle + (i - met.left)];
    team.sync();
    while (count > met.most) count = merge_round(team, count, shared);
    for (uint32_t i = team.rank(); i < count; i += team.size())
      clusters[met.begin + i] = shared.clusters[i];
    return count;
  }

  /// All that have found each other merge. Returns how many clusters are left.
  template <typename Team>
  UMBEL_HOST_DEVICE uint32_t merge_round(const Team& team, uint32_t count, Shared& shared) const {
    for (uint32_t i = team.rank(); i < count; i += team.size())
      shared.nearest[i] = nearest_within(shared.clusters, count, i, radius);
    team.sync();
    uint32_t left = 0;
    for (uint32_t first = 0; first < count; first += team.size())
      left += count_bits(team.ballot(stays(shared.nearest, count, first + team.rank())));
    if (left == count) {
      // Only where areas are no numbers.
      team.sync();
      for (uint32_t i = team.rank(); i < count; i += team.size())
        shared.nearest[i] = (i ^ 1) < count ? i ^ 1 : i;
      team.sync();
      left = (count + 1) / 2;
    }
    uint32_t before = 0;
    for (uint32_t first = 0; first < count; first += team.size()) {
      const uint32_t i = first + team.rank();
      const bool is_left = stays(shared.nearest, count, i);
      const uint32_t all_left = team.ballot(is_left);
      const uint32_t to = before + count_bits(all_left & ((uint32_t{1} << team.rank()) - 1));
      before += count_bits(all_left);
      if (!is_left) continue;
      HplocCluster cluster = shared.clusters[i];
      const uint32_t other = shared.nearest[i];
      if (other != i && shared.nearest[other] == i) merge(cluster, shared.clusters[other]);
      shared.merged[to] = cluster;
    }
    team.sync();
    for (uint32_t i = team.rank(); i < left; i += team.size())
      shared.clusters[i] = shared.merged[i];
    team.sync();
    return left;
  }

  /// It is not the right one of a pair.
  UMBEL_HOST_DEVICE static bool stays(const uint32_t* nearest, uint32_t count, uint32_t i) {
    return i < count && !(nearest[i] < i && nearest[nearest[i]] == i);
  }

  /// Of n slots the lowest one is never taken, and the others are one too high.
  UMBEL_HOST_DEVICE void merge(HplocCluster& left, const HplocCluster& right) const {
    const uint32_t id = (left.slot > right.slot ? left.slot : right.slot) - 1;
    const typename Sums::Sum of_left = sums.of(left.subtree, left.box),
                             of_right = sums.of(right.subtree, right.box);
    left.slot = left.slot < right.slot ? left.slot : right.slot;
    left.box = united(left.box, right.box);
    left.count += right.count;
    const Merge merge{left.box, left.subtree, right.subtree, left.count};
    merges[id] = merge;
    sums.join(id, merge, of_left, of_right);
    left.subtree = Subtree::of_merge(id);
  }
};

/// Writes the n - 1 merges of n > 0 primitives in the order of their codes, and the root.
/// Neighbours are searched within `radius` of the clusters of a node, of which there are at
/// most 32.
template <typename Exec, typename Sums = NoMergeSums>
void hploc_merges(Exec& exec, const uint64_t* codes, const uint32_t* primitives, const Aabb* boxes,
                  uint32_t n, uint32_t radius, Merge* merges, Subtree* root,
                  const Sums& sums = {}) {
  auto clusters = exec.template allocate<HplocCluster>(n);
  auto first_child = exec.template allocate<uint64_t>(n);
  exec.for_each(n, [=, clusters = clusters.data(),
                    first_child = first_child.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
    const uint32_t primitive = primitives[i];
    clusters[i] = {boxes[primitive], Subtree::of_primitive(primitive), 1, static_cast<uint32_t>(i)};
    first_child[i] = kNobodyMet;
  });
  exec.for_each_team(
      (n + size_t{HplocClimb<Sums>::kLanes} - 1) / HplocClimb<Sums>::kLanes,
      HplocClimb<Sums>{codes, n, radius, first_child.data(), clusters.data(), merges, root, sums});
}

}  // namespace umbel::bvh
