// Linear BVH on the processor: the radix tree over sorted Morton codes (Karras, "Maximizing
// Parallelism in the Construction of BVHs, Octrees, and k-d Trees", 2012), cut into parts that
// MortonStack builds.

#include "base/morton.hpp"
#include "bvh/builders.hpp"
#include "bvh/config.hpp"
#include "bvh/morton_stack.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kMostCodes = 1u << 14;  // of a subtree: its nodes stay in the cache

/// Ranges of codes that are parts, and the nodes above them.
struct Cut {
  std::vector<Range> ranges;
  std::vector<TopNode> top;
};

/// Depends on nothing but the codes.
template <typename Key>
Cut cut_radix_tree(const Key* codes, uint32_t n) {
  Cut cut;
  struct Task {
    Range range;
    uint32_t parent;
    bool left;
  };
  std::vector<Task> tasks = {{{0, n}, kNone, false}};
  while (!tasks.empty()) {
    const Task task = tasks.back();
    tasks.pop_back();
    const auto [offset, count] = task.range;
    uint32_t id;
    if (count <= kMostCodes) {
      id = ~static_cast<uint32_t>(cut.ranges.size());
      cut.ranges.push_back(task.range);
    } else {
      id = static_cast<uint32_t>(cut.top.size());
      cut.top.push_back({});
      const uint32_t split = radix_split(codes, offset, offset + count);
      tasks.push_back({{split, offset + count - split}, id, false});
      tasks.push_back({{offset, split - offset}, id, true});
    }
    if (task.parent != kNone)
      (task.left ? cut.top[task.parent].left : cut.top[task.parent].right) = id;
  }
  return cut;
}

template <typename Key>
Bvh2 build(Boxes boxes, uint32_t bits, const Config& config, Progress& progress) {
  CpuExec exec;
  const uint32_t n = static_cast<uint32_t>(boxes.size());
  const auto order = morton_order<Key>(exec, boxes.data(), n, bits);
  progress.report(0.5, "sorting by Morton code");
  const Cut cut = cut_radix_tree(order.codes.data(), n);
  std::vector<TreePart> parts(cut.ranges.size());
  PartStore store(2 * size_t(n));
  parallel_for(cut.ranges.size(), 1, [&](size_t s) {
    const auto [offset, count] = cut.ranges[s];
    MortonStack<Key> stack(order.codes.data(), order.primitives.data(), boxes.data(),
                           LeafRule(config));
    parts[s] = stack.build(offset, offset + count, PartStore::scratch_end(2 * size_t(kMostCodes)));
    store.keep(parts[s]);
  });
  Bvh2 tree = join_parts(cut.top, parts, {order.primitives.data(), order.primitives.data() + n});
  if (config.max_depth < 3 * bits + balanced_depth(n)) limit_depth(tree, config.max_depth);
  return tree;
}

}  // namespace

Bvh2 build_lbvh(Boxes boxes, const Config& config, Progress& progress) {
  return config.morton_bits <= 30 ? build<uint32_t>(boxes, 10, config, progress)
                                  : build<uint64_t>(boxes, 21, config, progress);
}

}  // namespace umbel::bvh
