// k-means clustering from the top down (Meister & Bittner, "Parallel BVH Construction using
// k-means Clustering", 2016): a tree with up to k children a node, each of whose nodes then becomes
// a small binary tree, a treelet, by agglomerative clustering of its children.
//
// In the paper every treelet ends in one cluster. Here it may forward a few to the treelet above,
// so that those of neighbouring nodes can still join (as in Gu et al., "Efficient BVH Construction
// via Approximate Agglomerative Clustering", 2013): boxes of k-means clusters overlap along their
// common borders, which a treelet that ends in one cluster cannot repair. A treelet of clusters is
// also joined by a sweep, because planes sometimes divide better than agglomeration joins.
#include "base/polled_stage.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/kmeans_passes.hpp"
#include "bvh/build/kmeans_treelets.hpp"

namespace umbel::bvh {
namespace {

void report(const KmeansTimes& times, const BuildProgress& progress) {
  progress.stage_took("boxes", times.boxes);
  progress.stage_took("seeding", times.seeding);
  progress.stage_took("iterations", times.iterations);
  progress.stage_took("sizes", times.sizes);
  progress.stage_took("reordering", times.reordering);
  progress.stage_took("agglomeration", times.agglomeration);
}

template <uint32_t kMost>
Bvh2 build(Boxes boxes, const Config& config, BuildProgress& progress) {
  const KmeansConfig& settings = config.kmeans;
  const auto count = static_cast<uint32_t>(boxes.size());
  BigVector<Merge> merges(count);
  Subtree root{};
  {
    CpuExec exec;
    KmeansPasses<CpuExec, kMost> passes(exec, boxes.data(), count, settings,
                                        std::max(kFewForKmeans, settings.clusters));
    passes.run([&](double done) { progress.report(0.6 * done, "clustering"); });
    const PolledStage stage(progress, 0.6, "joining clusters");
    StageClock clock;
    KmeansTreelets<CpuExec, kMost>(exec, passes, LeafRule(config),
                                   forwarded_clusters<kMost>(settings), merges.data())
        .run(&root);
    clock.lap(passes.times().agglomeration);
    report(passes.times(), progress);
  }
  progress.report(0.9, "laying out");
  return emit(merges, root, boxes);
}

}  // namespace

Bvh2 build_kmeans(Boxes boxes, const Config& config, BuildProgress& progress) {
  return config.kmeans.clusters <= kMostKmeansClusters
             ? build<kMostKmeansClusters>(boxes, config, progress)
             : build<kMostKmeansClustersOnCpu>(boxes, config, progress);
}

}  // namespace umbel::bvh
