// Hierarchical parallel locally-ordered clustering for any executor (Benthin, Meister, Barczak,
// Mehalwal, Tsakok & Kensler, "H-PLOC: Hierarchical Parallel Locally-Ordered Clustering for
// Bounding Volume Hierarchy Construction", 2024): teams climb the radix tree over the Morton codes,
// and at every node with many primitives merge the few clusters that its two children left, in
// rounds in shared memory, until few are left. All is one kernel, and nothing waits.
//
// What a node forwards depends on nothing but what is below it, and a merge takes the number of one
// of the two that it joins, so the same bytes come out whatever the order in which nodes are done.
#pragma once

#include "bvh/build/ploc.hpp"
#include "bvh/build/radix_splits.hpp"

namespace umbel::bvh {

/// A cluster, and the number that the merge it will be the right part of takes.
struct HplocCluster {
  Aabb box;
  Subtree subtree;
  uint32_t count;
  uint32_t slot;
};

/// What climbs have left at the nodes of the radix tree, one element a node; node i is where the
/// codes i and i + 1 part.
struct HplocNodes {
  uint32_t* arrived;
  uint32_t* begins;      ///< of the codes below
  uint32_t* ends;        ///< the last one
  uint32_t* left_kept;   ///< clusters that the left child forwarded
  uint32_t* right_kept;  ///< clusters that the right child forwarded
};

/// A team takes the leaves of kLanes codes.
struct HplocClimb {
  static constexpr uint32_t kLanes = 32;
  static constexpr uint32_t kKept = kLanes / 2;  ///< clusters that a node forwards, at most

  /// A node at which two children have met.
  struct Met {
    bool is_large;           ///< it has clusters to merge
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
  HplocNodes nodes;
  HplocCluster* clusters;  ///< those of a node begin where its codes begin
  Merge* merges;
  Subtree* root;

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
    uint32_t begin = leaf, end = leaf, kept = 1;
    while (team.count(is_active) > 0) {
      Met& met = shared.met[team.rank()];
      met.is_large = false;
      if (is_active) is_active = meet(begin, end, kept, met);
      team.sync();
      for (uint32_t lane = 0; lane < team.size(); ++lane) {
        if (!shared.met[lane].is_large) continue;
        const uint32_t left = merge_at(team, shared.met[lane], shared);
        if (lane == team.rank()) kept = left;
      }
      team.sync();
      if (is_active && end - begin == n - 1) {
        *root = clusters[0].subtree;
        is_active = false;
      }
    }
  }

  /// Goes up from the node of the codes [begin, end]; false for the first one that arrives there.
  UMBEL_HOST_DEVICE bool meet(uint32_t& begin, uint32_t& end, uint32_t& kept, Met& met) const {
    if (end - begin == n - 1) return true;  // the only leaf
    const bool is_right = end == n - 1 || (begin > 0 && common_bits(codes, begin - 1, begin) >
                                                            common_bits(codes, end, end + 1));
    const uint32_t parent = is_right ? begin - 1 : end;
    (is_right ? nodes.ends[parent] : nodes.begins[parent]) = is_right ? end : begin;
    (is_right ? nodes.right_kept[parent] : nodes.left_kept[parent]) = kept;
    if (!is_last_to_arrive(&nodes.arrived[parent], 1)) return false;
    begin = nodes.begins[parent];
    end = nodes.ends[parent];
    const uint32_t count = end - begin + 1;
    // Few are forwarded as they are: those of the right child follow those of the left one.
    kept = count;
    const bool is_root = count == n;
    met = {count > kKept || is_root,
           begin,
           parent + 1,
           nodes.left_kept[parent],
           nodes.right_kept[parent],
           is_root ? 1 : kKept};
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
      left += team.count(stays(shared.nearest, count, first + team.rank()));
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
      const uint32_t to = before + team.rank_among(is_left);
      before += team.count(is_left);
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
    const uint32_t higher = left.slot > right.slot ? left.slot : right.slot;
    left.slot = left.slot < right.slot ? left.slot : right.slot;
    left.box = united(left.box, right.box);
    left.count += right.count;
    merges[higher - 1] = {left.box, left.subtree, right.subtree, left.count};
    left.subtree = Subtree::of_merge(higher - 1);
  }
};

/// Writes the n - 1 merges of n > 0 primitives in the order of their codes, and the root.
/// Neighbours are searched within `radius` of the clusters of a node, of which there are at
/// most 32.
template <typename Exec>
void hploc_merges(Exec& exec, const uint64_t* codes, const uint32_t* primitives, const Aabb* boxes,
                  uint32_t n, uint32_t radius, Merge* merges, Subtree* root) {
  auto clusters = exec.template allocate<HplocCluster>(n);
  auto arrived = exec.template allocate<uint32_t>(n);
  auto begins = exec.template allocate<uint32_t>(n);
  auto ends = exec.template allocate<uint32_t>(n);
  auto left_kept = exec.template allocate<uint32_t>(n);
  auto right_kept = exec.template allocate<uint32_t>(n);
  exec.for_each(n, [=, clusters = clusters.data(),
                    arrived = arrived.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
    const uint32_t primitive = primitives[i];
    clusters[i] = {boxes[primitive], Subtree::of_primitive(primitive), 1, static_cast<uint32_t>(i)};
    arrived[i] = 0;
  });
  const HplocNodes nodes{arrived.data(), begins.data(), ends.data(), left_kept.data(),
                         right_kept.data()};
  exec.for_each_team((n + size_t{HplocClimb::kLanes} - 1) / HplocClimb::kLanes,
                     HplocClimb{codes, n, radius, nodes, clusters.data(), merges, root});
}

}  // namespace umbel::bvh
