// Hierarchical linear BVH (Pantaleoni & Luebke, "HLBVH: Hierarchical LBVH Construction for
// Real-Time Ray Tracing of Dynamic Geometry", 2010; Garanzha, Pantaleoni & McAllister, "Simpler and
// Faster HLBVH with Work Queues", 2011): primitives whose 60-bit Morton codes agree in the leading
// bits are a treelet, built as a radix tree; the tree above the treelets is built by the surface
// area heuristic, here by the full sweep, as there are few of them.
#include <numeric>
#include <vector>

#include "base/morton.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/radix_parts.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kBits = 20;  ///< of a code, an axis

/// Treelets: runs of codes with the same leading bits, in the order of their codes.
struct Treelets {
  std::vector<uint32_t> starts;  ///< one more than treelets
  std::vector<uint32_t> counts;
  std::vector<Aabb> boxes;
};

Treelets find_treelets(CpuExec& exec, const MortonOrder<CpuExec, uint64_t>& order, Boxes boxes,
                       uint32_t leading_bits) {
  const size_t n = boxes.size();
  auto prefixes = exec.allocate<uint32_t>(n);
  exec.for_each(n, [codes = order.codes.data(), to = prefixes.data(),
                    shift = 3 * kBits - leading_bits] UMBEL_DEVICE_LAMBDA(size_t i) {
    to[i] = static_cast<uint32_t>(codes[i] >> shift);
  });
  auto starts = exec.allocate<uint32_t>(n + 1);
  auto count = exec.allocate<uint32_t>(1);
  exec.run_length(n, prefixes.data(), starts.data(), count.data());
  const uint32_t treelets = exec.read(count.data());
  Treelets all;
  all.starts.assign(starts.data(), starts.data() + treelets + 1);
  all.counts.resize(treelets);
  all.boxes.resize(treelets);
  exec.for_each(treelets,
                [from = starts.data(), primitives = order.primitives.data(), in = boxes.data(),
                 counts = all.counts.data(), out = all.boxes.data()] UMBEL_DEVICE_LAMBDA(size_t t) {
                  Aabb box;
                  for (uint32_t i = from[t]; i < from[t + 1]; ++i) extend(box, in[primitives[i]]);
                  out[t] = box;
                  counts[t] = from[t + 1] - from[t];
                });
  return all;
}

/// Codes and primitives, treelet by treelet in the order of the tree above them.
struct Gathered {
  std::vector<uint64_t> codes;
  std::vector<uint32_t> primitives;
  std::vector<Range> ranges;  ///< of the leaves of the tree above, by where they are in it
};

Gathered gather(const MortonOrder<CpuExec, uint64_t>& order, const Treelets& treelets,
                const Bvh2& above) {
  Gathered out;
  out.codes.resize(order.codes.size());
  out.primitives.resize(order.primitives.size());
  uint32_t offset = 0;
  for (const uint32_t t : above.primitives) {
    out.ranges.push_back({offset, treelets.counts[t]});
    offset += treelets.counts[t];
  }
  parallel_for(out.ranges.size(), 64, [&](size_t i) {
    const auto [to, count] = out.ranges[i];
    const uint32_t from = treelets.starts[above.primitives[i]];
    std::copy_n(&order.codes[from], count, &out.codes[to]);
    std::copy_n(&order.primitives[from], count, &out.primitives[to]);
  });
  return out;
}

/// The parts below node `index` of the tree above the treelets.
void add_parts(const Bvh2& above, const std::vector<Range>& ranges, RadixParts<uint64_t>& parts) {
  std::vector<uint32_t> inner(above.nodes.size(), kNone);
  for (size_t i = 0; i < above.nodes.size(); ++i)
    if (!above.nodes[i].is_leaf()) inner[i] = parts.add_inner();
  const auto child = [&](uint32_t i) {
    const Node& node = above.nodes[i];
    return node.is_leaf() ? parts.add(ranges[node.first]) : inner[i];
  };
  for (size_t i = 0; i < above.nodes.size(); ++i) {
    const Node& node = above.nodes[i];
    if (node.is_leaf()) continue;
    const uint32_t left = child(node.first), right = child(node.first + 1);
    parts.set_children(inner[i], left, right);
  }
  if (above.nodes[0].is_leaf()) parts.add(ranges[0]);
}

}  // namespace

Bvh2 build_hlbvh(Boxes boxes, const Config& config, BuildProgress& progress) {
  progress.report(0.05, "sorting by Morton code");
  CpuExec exec;
  const auto order = morton_order<uint64_t>(exec, boxes.data(), boxes.size(), kBits);
  progress.report(0.4, "finding treelets");
  const Treelets treelets = find_treelets(exec, order, boxes, config.hlbvh_bits);
  progress.report(0.5, "sweeping treelets");
  const Bvh2 above = sweep_clusters(treelets.boxes, treelets.counts, config);
  progress.report(0.7, "building subtrees");
  Gathered gathered = gather(order, treelets, above);
  RadixParts<uint64_t> parts(gathered.codes.data());
  add_parts(above, gathered.ranges, parts);
  return parts.build(boxes, std::move(gathered.primitives), LeafRule(config));
}

}  // namespace umbel::bvh
