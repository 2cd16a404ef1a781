// k-means clustering from the top down (Meister & Bittner, "Parallel BVH Construction using
// k-means Clustering", 2016): a tree with up to k children a node, each of whose nodes then becomes
// a small binary tree, a treelet, by agglomerative clustering of its children.
//
// In the paper every treelet ends in one cluster. Here it may hand up a few, so that those of
// neighbouring nodes can still join (as in Gu et al., "Efficient BVH Construction via Approximate
// Agglomerative Clustering", 2013): boxes of k-means clusters overlap along their common borders,
// and a treelet that is closed cannot mend that.
#include "base/parallel.hpp"
#include "bvh/builders.hpp"
#include "bvh/kmeans_recursion.hpp"
#include "bvh/merge_tree.hpp"
#include "bvh/treelet_agglomeration.hpp"

namespace umbel::bvh {
namespace {

/// What a cluster hands up to the treelet above it.
struct HandedUp {
  MergeItem items[TreeletAgglomeration::kMost / 2];
  uint32_t count;
};

/// Makes binary trees. A cluster of n items at `offset` has the slots of n merges from `offset` on,
/// one more than it can need.
class BinaryMaker {
 public:
  using Result = HandedUp;

  BinaryMaker(Merge* merges, uint32_t handed) : merges_(merges), handed_(handed) {}

  BinaryMaker for_task() const { return *this; }
  Result adopt(BinaryMaker& /*of_task*/, const Result& result) const { return result; }

  Result leaf(const KmeansItem* items, uint32_t offset, uint32_t count) {
    treelet_.clear();
    for (uint32_t i = 0; i < count; ++i)
      treelet_.add(
          {{items[i].min, items[i].max}, Subtree::of_primitive(items[i].primitive), 1, offset + i});
    return hand_up(handed_);
  }

  Result inner(std::span<const Result> parts, uint32_t /*offset*/) {
    treelet_.clear();
    for (const Result& part : parts)
      for (uint32_t i = 0; i < part.count; ++i) treelet_.add(part.items[i]);
    return hand_up(handed_);
  }

  Subtree finish(const Result& root) {
    treelet_.clear();
    for (uint32_t i = 0; i < root.count; ++i) treelet_.add(root.items[i]);
    return hand_up(1).items[0].subtree;
  }

 private:
  Result hand_up(uint32_t left) {
    treelet_.run(merges_, left);
    Result result;
    result.count = treelet_.size();
    for (uint32_t i = 0; i < result.count; ++i) result.items[i] = treelet_.item(i);
    return result;
  }

  Merge* merges_;
  uint32_t handed_;
  TreeletAgglomeration treelet_;
};

}  // namespace

Bvh2 build_kmeans(Boxes boxes, const Config& config, Progress& progress) {
  // Agglomeration is better at few primitives than the dice.
  constexpr uint32_t kFew = 64, kMost = TreeletAgglomeration::kMost;
  const KmeansConfig& settings = config.kmeans;
  const uint32_t asked = settings.handed_up == 0 ? kMost : settings.handed_up;
  BigVector<Merge> merges(boxes.size());
  Subtree root{};
  {
    KmeansRecursion<BinaryMaker> recursion(boxes, settings, std::max(settings.clusters, kFew));
    BinaryMaker maker(merges.data(), std::min(asked, kMost / settings.clusters));
    root = maker.finish(recursion.run(maker, progress));
    if (settings.times) *settings.times = recursion.times();
  }
  progress.report(0.95, "laying out");
  return emit(merges, root, boxes);
}

}  // namespace umbel::bvh
