// The tree of k-means clusters itself, with up to k children a node, which Meister & Bittner name
// as future work.
#include <algorithm>
#include <string>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/kmeans_passes.hpp"
#include "bvh/tree/config.hpp"
#include "bvh/tree/scale.hpp"

namespace umbel::bvh {
namespace {

void check_kmeans_boxes(Boxes boxes) {
  if (boxes.size() > kMaxPrimitives)
    throw Error(ErrorCode::kInvalidArgument,
                std::to_string(boxes.size()) + " boxes are more than a tree can hold");
  for (size_t i = 0; i < boxes.size(); ++i) {
    const bool finite = is_finite(boxes[i].min) && is_finite(boxes[i].max);
    if (finite && !is_empty(boxes[i])) continue;
    throw Error(ErrorCode::kInvalidMesh,
                "box " + std::to_string(i) + (finite ? " is empty" : " is not finite"));
  }
}

/// Copies of the boxes at a scale at which squares of distances neither overflow nor vanish.
std::vector<Aabb> moderate_boxes(Boxes boxes) {
  Aabb all;
  for (const Aabb& box : boxes) extend(all, box);
  const float scale = moderate_scale(all);
  std::vector<Aabb> copies(boxes.begin(), boxes.end());
  for (Aabb& box : copies) box = scaled(box, scale);
  return copies;
}

/// Clusters as nodes: those of a level are neighbours, and parts come after wholes already.
KaryTree tree_of(const KmeansPasses<CpuExec>& passes, Boxes boxes) {
  const std::vector<uint32_t>& levels = passes.levels();
  KaryTree tree;
  tree.primitives.resize(boxes.size());
  tree.nodes.resize(levels.back());
  for (size_t level = levels.size() - 1; level-- > 0;) {
    const uint32_t* items = passes.items(level).primitives;
    parallel_for(levels[level + 1] - levels[level], 256, [&](size_t i) {
      const KmeansCluster& cluster = passes.clusters()[levels[level] + i];
      Aabb box;
      for (uint32_t k = 0; k < cluster.parts; ++k) extend(box, tree.nodes[cluster.first + k].box());
      if (cluster.parts == 0) {
        uint32_t* to = &tree.primitives[cluster.offset];
        std::copy_n(items + cluster.offset, cluster.count, to);
        std::sort(to, to + cluster.count);
        for (uint32_t k = 0; k < cluster.count; ++k) extend(box, boxes[to[k]]);
      }
      const bool is_leaf = cluster.parts == 0;
      tree.nodes[levels[level] + i] = {box.min, is_leaf ? cluster.offset : cluster.first, box.max,
                                       static_cast<uint16_t>(cluster.parts),
                                       static_cast<uint16_t>(is_leaf ? cluster.count : 0)};
    });
  }
  return tree;
}

}  // namespace

KaryTree build_kmeans_kary(std::span<const Aabb> boxes, const Config& config,
                           const BuildOptions& options) {
  check_config(config, boxes.size());
  if (config.kmeans.clusters > kMostKmeansClusters)
    throw Error(ErrorCode::kInvalidArgument, "kmeans.clusters is " +
                                                 std::to_string(config.kmeans.clusters) +
                                                 ", but must be from 2 to 64 in k-ary trees");
  check_kmeans_boxes(boxes);
  KaryTree tree;
  Progress progress(options);
  progress.report(0, "clustering");
  with_threads(options.threads, [&] {
    if (boxes.empty()) return;
    CpuExec exec;
    const std::vector<Aabb> copies = moderate_boxes(boxes);
    KmeansPasses<CpuExec> passes(exec, copies.data(), static_cast<uint32_t>(boxes.size()),
                                 config.kmeans, config.max_leaf_size);
    passes.run([&](double done) { progress.report(done, "clustering"); });
    // At the input's own scale, which is not exactly the scaled one where that underflows.
    tree = tree_of(passes, boxes);
  });
  progress.report(1, "clustering");
  return tree;
}

}  // namespace umbel::bvh
