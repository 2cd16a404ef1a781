// Linear BVH on the processor: the radix tree over sorted Morton codes (Karras, "Maximizing
// Parallelism in the Construction of BVHs, Octrees, and k-d Trees", 2012), cut into parts that
// MortonStack builds.
#include "base/morton.hpp"
#include "bvh/builders.hpp"
#include "bvh/config.hpp"
#include "bvh/radix_parts.hpp"

namespace umbel::bvh {
namespace {

template <typename Key>
Bvh2 build(Boxes boxes, uint32_t bits, const Config& config, Progress& progress) {
  CpuExec exec;
  const uint32_t n = static_cast<uint32_t>(boxes.size());
  const auto order = morton_order<Key>(exec, boxes.data(), n, bits);
  progress.report(0.5, "building subtrees");
  RadixParts<Key> parts(order.codes.data());
  parts.add({0, n});
  Bvh2 tree =
      parts.build(boxes, {order.primitives.data(), order.primitives.data() + n}, LeafRule(config));
  if (config.max_depth < 3 * bits + balanced_depth(n)) limit_depth(tree, config.max_depth);
  return tree;
}

}  // namespace

Bvh2 build_lbvh(Boxes boxes, const Config& config, Progress& progress) {
  return config.morton_bits <= 30 ? build<uint32_t>(boxes, 10, config, progress)
                                  : build<uint64_t>(boxes, 21, config, progress);
}

}  // namespace umbel::bvh
