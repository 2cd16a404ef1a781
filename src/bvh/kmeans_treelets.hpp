// Binary trees of k-means clusters for any executor: the children of a cluster are joined, level by
// level from the bottom, treelets of one level side by side.
#pragma once

#include "bvh/kmeans_passes.hpp"
#include "bvh/treelet_join.hpp"

namespace umbel::bvh {

/// Clusters of at most so many items are not divided: agglomeration is better at few than the dice.
inline constexpr uint32_t kFewForKmeans = 64;

/// Subtrees that a treelet hands up at most.
inline uint32_t handed_up(const KmeansConfig& config) {
  const uint32_t most = kMostJoined / config.clusters;
  return config.handed_up == 0 || config.handed_up > most ? most : config.handed_up;
}

template <typename Exec>
class KmeansTreelets {
 public:
  /// A treelet hands up at most `handed`, so that those of `clusters` parts fit into one.
  KmeansTreelets(Exec& exec, const KmeansPasses<Exec>& passes, const LeafRule& rule,
                 uint32_t handed, Merge* merges)
      : exec_(exec), passes_(passes), rule_(rule), handed_(handed), merges_(merges) {}

  /// Makes all merges, and the root. A cluster of n items at `offset` has the slots of n
  /// merges from `offset` on, one more than it can need.
  void run(Subtree* root) {
    const std::vector<uint32_t>& levels = passes_.levels();
    up_ = exec_.template allocate<JoinItem>(size_t(levels.back()) * handed_);
    counts_ = exec_.template allocate<uint32_t>(levels.back());
    for (size_t level = levels.size() - 1; level-- > 0;) {
      const uint32_t begin = levels[level];
      exec_.for_each(
          levels[level + 1] - begin,
          [=, items = passes_.items(level), clusters = passes_.clusters(), rule = rule_,
           handed = handed_, merges = merges_, up = up_.data(),
           counts = counts_.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
            const uint32_t id = begin + static_cast<uint32_t>(i);
            const KmeansCluster& cluster = clusters[id];
            TreeletJoin join(rule);
            for (uint32_t part = cluster.first; part < cluster.first + cluster.parts; ++part)
              for (uint32_t k = 0; k < counts[part]; ++k) join.add(up[size_t(part) * handed + k]);
            if (cluster.parts == 0) add_items(items, cluster, rule, join);
            join.agglomerate();
            if (handed > 1 && cluster.parts > 0) join.sweep();
            counts[id] = join.hand_up(id == 0 ? 1 : handed, merges, up + size_t(id) * handed);
          },
          kGrain);
    }
    exec_.for_each(1, [up = up_.data(), root] UMBEL_DEVICE_LAMBDA(size_t) { *root = up->subtree; });
  }

 private:
  static constexpr size_t kGrain = 8;  ///< treelets of one task

  UMBEL_HOST_DEVICE static void add_items(const KmeansPoints& items, const KmeansCluster& cluster,
                                          const LeafRule& rule, TreeletJoin& join) {
    for (uint32_t i = cluster.offset; i < cluster.offset + cluster.count; ++i) {
      const Aabb box = items.box(i);
      join.add({box, Subtree::of_primitive(items.primitives[i]), 1, rule.leaf_cost(box, 1), i});
    }
  }

  template <typename T>
  using Buffer = typename Exec::template Buffer<T>;

  Exec& exec_;
  const KmeansPasses<Exec>& passes_;
  LeafRule rule_;
  uint32_t handed_;
  Merge* merges_;
  Buffer<JoinItem> up_;  ///< what each cluster hands up: `handed_` places each
  Buffer<uint32_t> counts_;
};

}  // namespace umbel::bvh
