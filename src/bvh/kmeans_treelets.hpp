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
    const size_t most = passes_.most_of_level();
    for (auto& up : up_) up = exec_.template allocate<JoinItem>(most * handed_);
    for (auto& counts : counts_) counts = exec_.template allocate<uint32_t>(most);
    for (size_t level = levels.size() - 1; level-- > 0;) join_level(level);
    exec_.for_each(1,
                   [up = up_[0].data(), root] UMBEL_DEVICE_LAMBDA(size_t) { *root = up->subtree; });
  }

  /// The treelets of the clusters of a level. It is public because CUDA takes no lambdas from
  /// private members.
  void join_level(size_t level) {
    const uint32_t begin = passes_.levels()[level], end = passes_.levels()[level + 1];
    exec_.for_each(
        end - begin,
        [=, items = passes_.items(level), clusters = passes_.clusters(), rule = rule_,
         handed = handed_, merges = merges_, from = up_[(level + 1) % 2].data(),
         from_counts = counts_[(level + 1) % 2].data(), to = up_[level % 2].data(),
         to_counts = counts_[level % 2].data()] UMBEL_DEVICE_LAMBDA(size_t i) {
          const KmeansCluster& cluster = clusters[begin + i];
          TreeletJoin join(rule);
          for (uint32_t k = 0; k < cluster.parts; ++k) {
            const size_t part = cluster.first + k - end;  // within the level below
            for (uint32_t s = 0; s < from_counts[part]; ++s) join.add(from[part * handed + s]);
          }
          if (cluster.parts == 0) add_items(items, cluster, rule, join);
          join.agglomerate();
          if (handed > 1 && cluster.parts > 0) join.sweep();
          to_counts[i] = join.hand_up(begin == 0 ? 1 : handed, merges, to + i * handed);
        },
        kGrain);
  }

  UMBEL_HOST_DEVICE static void add_items(const KmeansPoints& items, const KmeansCluster& cluster,
                                          const LeafRule& rule, TreeletJoin& join) {
    for (uint32_t i = cluster.offset; i < cluster.offset + cluster.count; ++i) {
      const Aabb box = items.box(i);
      join.add({box, Subtree::of_primitive(items.primitives[i]), 1, rule.leaf_cost(box, 1), i});
    }
  }

 private:
  static constexpr size_t kGrain = 8;  ///< treelets of one task

  template <typename T>
  using Buffer = typename Exec::template Buffer<T>;

  Exec& exec_;
  const KmeansPasses<Exec>& passes_;
  LeafRule rule_;
  uint32_t handed_;
  Merge* merges_;
  Buffer<JoinItem> up_[2];  ///< what the clusters of a level hand up: `handed_` places each
  Buffer<uint32_t> counts_[2];
};

}  // namespace umbel::bvh
