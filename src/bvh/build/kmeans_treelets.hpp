// Binary trees of k-means clusters for any executor: the children of a cluster are joined, level by
// level from the bottom, treelets of one level side by side, each by a team.
#pragma once

#include <algorithm>

#include "bvh/build/kmeans_passes.hpp"
#include "bvh/tree/treelet_join.hpp"

namespace umbel::bvh {

/// Clusters of at most so many items are not divided: of few, agglomeration makes better trees than
/// random seeds do.
inline constexpr uint32_t kFewForKmeans = 64;

/// Items of a treelet, at most, where k is at most kMost.
template <uint32_t kMost>
inline constexpr uint32_t kMostInTreelet = kMost <= kMostKmeansClusters ? kMostJoined : 2 * kMost;

/// Subtrees that a treelet forwards to the one above it, at most.
template <uint32_t kMost = kMostKmeansClusters>
uint32_t forwarded_clusters(const KmeansConfig& config) {
  uint32_t most = kMostInTreelet<kMost> / config.clusters;
  // Where k is large there are nearly as many clusters as items: more would take much memory.
  if constexpr (kMost > kMostKmeansClusters) most = std::min(most, 4u);
  return config.forwarded_clusters == 0 || config.forwarded_clusters > most
             ? most
             : config.forwarded_clusters;
}

/// Joins one treelet of a level.
template <uint32_t kMostItems>
struct KmeansTreelet {
  static constexpr uint32_t kLanes = 64;
  struct Shared {
    TreeletJoinOf<kMostItems> join;
    union {  // one after the other
      TreeletAgglomerationOf<kMostItems> agglomeration;
      TreeletSweepOf<kMostItems> sweep;
    };
  };

  KmeansPoints items;
  const KmeansCluster* clusters;  ///< of the level
  uint32_t first_below;           ///< cluster of the level below
  bool is_top;
  LeafRule rule;
  uint32_t forwarded;
  Merge* merges;
  const JoinItem* below;  ///< what the level below forwards
  const uint32_t* below_counts;
  JoinItem* up;
  uint32_t* counts;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t i, Shared& shared) const {
    const KmeansCluster& cluster = clusters[i];
    TreeletJoinOf<kMostItems>& join = shared.join;
    gather(team, cluster, join);
    team.sync();
    join.agglomerate(team, rule, shared.agglomeration);
    if (forwarded > 1 && cluster.parts > 0) join.sweep(team, rule, shared.sweep);
    if (team.rank() == 0)
      counts[i] = join.forward(is_top ? 1 : forwarded, merges, up + i * forwarded);
  }

 private:
  template <typename Team>
  UMBEL_HOST_DEVICE void gather(const Team& team, const KmeansCluster& cluster,
                                TreeletJoinOf<kMostItems>& join) const {
    if (cluster.parts == 0) {
      if (team.rank() == 0) join.begin(cluster.count);
      for (uint32_t i = team.rank(); i < cluster.count; i += team.size()) {
        const uint32_t item = cluster.offset + i;
        const Aabb box = items.box(item);
        join.put(i, {box, Subtree::of_primitive(items.primitives[item]), 1, rule.leaf_cost(box, 1),
                     item});
      }
      return;
    }
    const uint32_t first = cluster.first - first_below;
    for (uint32_t part = team.rank(); part <= cluster.parts; part += team.size()) {
      uint32_t at = 0;
      for (uint32_t p = 0; p < part; ++p) at += below_counts[first + p];
      if (part == cluster.parts) {
        join.begin(at);
        break;
      }
      for (uint32_t s = 0; s < below_counts[first + part]; ++s)
        join.put(at + s, below[size_t(first + part) * forwarded + s]);
    }
  }
};

template <typename Exec, uint32_t kMost = kMostKmeansClusters>
class KmeansTreelets {
 public:
  /// A treelet forwards at most `forwarded`, so that those of `clusters` parts fit into one.
  KmeansTreelets(Exec& exec, const KmeansPasses<Exec, kMost>& passes, const LeafRule& rule,
                 uint32_t forwarded, Merge* merges)
      : exec_(exec), passes_(passes), rule_(rule), forwarded_(forwarded), merges_(merges) {}

  /// Makes all merges, and the root. A cluster of n items at `offset` has the slots of n
  /// merges from `offset` on, one more than it can need.
  void run(Subtree* root) {
    const std::vector<uint32_t>& levels = passes_.levels();
    const size_t most = passes_.most_of_level();
    for (auto& up : up_) up = exec_.template allocate<JoinItem>(most * forwarded_);
    for (auto& counts : counts_) counts = exec_.template allocate<uint32_t>(most);
    for (size_t level = levels.size() - 1; level-- > 0;) join_level(level);
    exec_.for_each(1,
                   [up = up_[0].data(), root] UMBEL_DEVICE_LAMBDA(size_t) { *root = up->subtree; });
  }

 private:
  template <typename T>
  using Buffer = typename Exec::template Buffer<T>;

  /// The treelets of the clusters of a level.
  void join_level(size_t level) {
    const uint32_t begin = passes_.levels()[level], end = passes_.levels()[level + 1];
    const size_t own = level % 2, below = 1 - own;
    exec_.for_each_team(
        end - begin, KmeansTreelet<kMostInTreelet<kMost>>{
                         passes_.items(level), passes_.clusters() + begin, end, begin == 0, rule_,
                         forwarded_, merges_, up_[below].data(), counts_[below].data(),
                         up_[own].data(), counts_[own].data()});
  }

  Exec& exec_;
  const KmeansPasses<Exec, kMost>& passes_;
  LeafRule rule_;
  uint32_t forwarded_;
  Merge* merges_;
  Buffer<JoinItem> up_[2];  ///< what the clusters of a level forward: `forwarded_` elements each
  Buffer<uint32_t> counts_[2];
};

}  // namespace umbel::bvh
