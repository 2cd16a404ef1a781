// ATRBVH (Domingues & Pedrini, "Bounding Volume Hierarchy Optimization through Agglomerative
// Treelet Restructuring", 2015): a linear BVH, and rounds of treelet restructuring. And those
// rounds as a pass over any tree.
#include "base/morton.hpp"
#include "bvh/builders.hpp"
#include "bvh/radix_merges.hpp"
#include "bvh/treelet.hpp"

namespace umbel::bvh {
namespace {

void run_rounds(CpuExec& exec, const TreeletInput& tree, Subtree root, const LeafRule& rule,
                uint32_t size, uint32_t rounds, Progress& progress) {
  TreeletRounds<CpuExec> all(exec, tree, root, rule);
  for (uint32_t i = 0; i < rounds; ++i) {
    progress.report(0.2 + 0.6 * double(i) / double(rounds), "restructuring treelets");
    all.run_round(size);
  }
}

}  // namespace

Bvh2 build_atrbvh(Boxes boxes, const Config& config, Progress& progress) {
  CpuExec exec;
  const auto n = static_cast<uint32_t>(boxes.size());
  BigVector<Merge> merges(n - 1);
  Subtree root{};
  {
    progress.report(0.05, "sorting by Morton code");
    const auto order = morton_order<uint64_t>(exec, boxes.data(), n, 20);
    progress.report(0.1, "building the radix tree");
    root = radix_merges(exec, order.codes.data(), order.primitives.data(), boxes.data(), n,
                        merges.data());
  }
  if (n > 2)
    run_rounds(exec, {boxes.data(), nullptr, n, merges.data()}, root, LeafRule(config),
               config.treelet_size, config.treelet_rounds, progress);
  progress.report(0.8, "laying out");
  // NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage): radix_merges has set the root
  return emit(merges, root, boxes);
}

}  // namespace umbel::bvh
