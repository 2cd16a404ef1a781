// ATRBVH (Domingues & Pedrini, "Bounding Volume Hierarchy Optimization through Agglomerative
// Treelet Restructuring", 2015): a linear BVH, and rounds of treelet restructuring. A hierarchical
// linear BVH to begin with, which is the default, makes better trees: restructuring mends what is
// near, but not what the first splits did.
#include "base/morton.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/radix_merges.hpp"
#include "bvh/optimize/treelet.hpp"

namespace umbel::bvh {
namespace {

/// As published.
Bvh2 linear_tree(Boxes boxes, Progress& progress) {
  CpuExec exec;
  const auto n = static_cast<uint32_t>(boxes.size());
  BigVector<Merge> merges(n - 1);
  progress.report(0.05, "sorting by Morton code");
  const auto order = morton_order<uint64_t>(exec, boxes.data(), n, 20);
  progress.report(0.1, "building the radix tree");
  Subtree root{};
  radix_merges(exec, order.codes.data(), order.primitives.data(), boxes.data(), n, merges.data(),
               &root);
  return emit(merges, root, boxes);
}

Bvh2 hierarchical_tree(Boxes boxes, const Config& config, BuildProgress& progress) {
  Config start = config;
  start.hlbvh_bits = config.atrbvh_bits;
  start.max_leaf_size = 1;
  return build_hlbvh(boxes, start, progress);
}

}  // namespace

Bvh2 build_atrbvh(Boxes boxes, const Config& config, BuildProgress& progress) {
  Bvh2 tree = config.atrbvh_bits == 0 ? linear_tree(boxes, progress)
                                      : hierarchical_tree(boxes, config, progress);
  if (boxes.size() > 2)
    restructure(tree, config.treelet_size, config.treelet_rounds, LeafRule(config), progress);
  progress.report(0.8, "laying out");
  return tree;
}

}  // namespace umbel::bvh
