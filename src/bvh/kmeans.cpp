// k-means clustering from the top down (Meister & Bittner, "Parallel BVH Construction using
// k-means Clustering", 2016): a tree with up to k children a node, each of whose nodes then becomes
// a small binary tree by agglomerative clustering of its children.
#include "base/parallel.hpp"
#include "bvh/builders.hpp"
#include "bvh/kmeans_recursion.hpp"
#include "bvh/merge_tree.hpp"
#include "bvh/treelet_agglomeration.hpp"

namespace umbel::bvh {
namespace {

/// Makes binary trees. A cluster of n items at `offset` has the n - 1 merges from `offset` on, so
/// of each part but the last one is left for joining the parts.
class BinaryMaker {
 public:
  using Result = MergeItem;

  BinaryMaker(Boxes boxes, Merge* merges) : boxes_(boxes), merges_(merges) {}

  BinaryMaker for_task() const { return *this; }
  const Result& adopt(BinaryMaker& /*of_task*/, const Result& result) const { return result; }

  Result leaf(const KmeansItem* items, uint32_t offset, uint32_t count) {
    treelet_.clear();
    for (uint32_t i = 0; i < count; ++i)
      treelet_.add({{items[i].min, items[i].max}, Subtree::of_primitive(items[i].primitive), 1});
    return treelet_.run(merges_, [&](uint32_t i) { return offset + i; });
  }

  Result inner(std::span<const Result> parts, uint32_t offset) {
    treelet_.clear();
    for (const Result& part : parts) treelet_.add(part);
    uint32_t end = offset;
    return treelet_.run(merges_, [&](uint32_t i) { return (end += parts[i].count) - 1; });
  }

 private:
  Boxes boxes_;
  Merge* merges_;
  TreeletAgglomeration treelet_;
};

}  // namespace

Bvh2 build_kmeans(Boxes boxes, const Config& config, Progress& progress) {
  // Agglomeration is better at few primitives than the dice.
  constexpr uint32_t kFew = 64;
  BigVector<Merge> merges(boxes.size() - 1);
  MergeItem root;
  {
    KmeansRecursion<BinaryMaker> recursion(boxes, config.kmeans,
                                           std::max(config.kmeans.clusters, kFew));
    BinaryMaker maker(boxes, merges.data());
    root = recursion.run(maker, progress);
  }
  progress.report(0.95, "laying out");
  return emit(merges, root.subtree, boxes);
}

}  // namespace umbel::bvh
