// k-means clustering from the top down (Meister & Bittner, "Parallel BVH Construction using
// k-means Clustering", 2016): a tree with up to k children a node, each of whose nodes then becomes
// a small binary tree, a treelet, by agglomerative clustering of its children.
//
// In the paper every treelet ends in one cluster. Here it may hand up a few, so that those of
// neighbouring nodes can still join (as in Gu et al., "Efficient BVH Construction via Approximate
// Agglomerative Clustering", 2013): boxes of k-means clusters overlap along their common borders,
// and a treelet that is closed cannot mend that. And a treelet of clusters is also joined by a
// sweep, for where planes divide better than agglomeration joins.
#include "bvh/build/builders.hpp"
#include "bvh/build/kmeans_passes.hpp"
#include "bvh/build/kmeans_treelets.hpp"

namespace umbel::bvh {

Bvh2 build_kmeans(Boxes boxes, const Config& config, Progress& progress) {
  const KmeansConfig& settings = config.kmeans;
  const auto count = static_cast<uint32_t>(boxes.size());
  BigVector<Merge> merges(count);
  Subtree root{};
  {
    CpuExec exec;
    KmeansPasses<CpuExec> passes(exec, boxes.data(), count, settings, kFewForKmeans);
    passes.run([&](double done) { progress.report(0.6 * done, "clustering"); });
    progress.report(0.6, "joining clusters");
    StageClock clock;
    KmeansTreelets<CpuExec>(exec, passes, LeafRule(config), handed_up(settings), merges.data())
        .run(&root);
    clock.lap(passes.times().agglomeration);
    if (settings.times) *settings.times = passes.times();
  }
  progress.report(0.9, "laying out");
  return emit(merges, root, boxes);
}

}  // namespace umbel::bvh
