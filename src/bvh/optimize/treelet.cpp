// Treelet restructuring as a pass over any tree. See the header.
#include "bvh/optimize/treelet.hpp"

#include <string>

#include "bvh/tree/config.hpp"

namespace umbel::bvh {
namespace {

/// A tree whose leaves are items, whatever they hold.
struct Items {
  std::vector<Aabb> boxes;
  std::vector<uint32_t> counts;
  std::vector<uint32_t> firsts;  ///< of their primitives
  BigVector<Merge> merges;
  Subtree root;
};

Items take_leaves(const Bvh2& tree) {
  Items items;
  std::vector<Subtree> links(tree.nodes.size());
  items.merges.resize(tree.nodes.size() / 2);
  uint32_t merge = 0;
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    const Node& node = tree.nodes[i];
    if (node.is_leaf()) {
      links[i] = Subtree::of_primitive(static_cast<uint32_t>(items.boxes.size()));
      items.boxes.push_back(node.box());
      items.counts.push_back(node.count);
      items.firsts.push_back(node.first);
      continue;
    }
    const auto count = [&](Subtree s) {
      return s.is_primitive() ? 1 : items.merges[s.index()].count;
    };
    const Subtree left = links[node.first], right = links[node.first + 1];
    items.merges[merge] = {node.box(), left, right, count(left) + count(right)};
    links[i] = Subtree::of_merge(merge++);
  }
  items.root = links[0];
  return items;
}

/// `over_items` has one item a leaf; the result has its primitives.
Bvh2 put_back(const Bvh2& tree, const Items& items, Bvh2 over_items) {
  Bvh2 result;
  result.primitives.reserve(tree.primitives.size());
  std::vector<uint32_t> firsts;
  for (const uint32_t item : over_items.primitives) {
    firsts.push_back(static_cast<uint32_t>(result.primitives.size()));
    const auto from = tree.primitives.begin() + items.firsts[item];
    result.primitives.insert(result.primitives.end(), from, from + items.counts[item]);
  }
  result.nodes = std::move(over_items.nodes);
  for (Node& node : result.nodes) {
    if (!node.is_leaf()) continue;
    node.count = items.counts[over_items.primitives[node.first]];
    node.first = firsts[node.first];
  }
  return result;
}

void check_arguments(uint32_t size, uint32_t rounds) {
  if (size < 3 || size > TreeletMemory::kMost)
    throw Error(ErrorCode::kInvalidArgument,
                "treelet_size is " + std::to_string(size) + ", but must be from 3 to 15");
  if (rounds > 16)
    throw Error(ErrorCode::kInvalidArgument,
                "rounds is " + std::to_string(rounds) + ", but must be from 0 to 16");
}

}  // namespace

void restructure(Bvh2& tree, uint32_t size, uint32_t rounds, const LeafRule& rule,
                 Progress& progress) {
  CpuExec exec;
  Items items = take_leaves(tree);
  const auto count = static_cast<uint32_t>(items.boxes.size());
  const TreeletInput input{items.boxes.data(), items.counts.data(), count, items.merges.data()};
  TreeletRounds<CpuExec> all(exec, input, &items.root, rule);
  for (uint32_t i = 0; i < rounds; ++i) {
    progress.report(0.2 + 0.6 * double(i) / double(rounds), "restructuring treelets");
    all.run_round(size);
  }
  tree = put_back(tree, items, emit(items.merges, items.root, items.boxes));
}

void restructure_treelets(Bvh2& tree, uint32_t treelet_size, uint32_t rounds, const CostModel& cost,
                          const BuildOptions& options) {
  check_arguments(treelet_size, rounds);
  check_cost(cost);
  if (tree.nodes.size() < 5 || rounds == 0) return;
  Progress progress(options);
  // Leaves stay as they are, so none of the joins may become one.
  with_threads(options.threads,
               [&] { restructure(tree, treelet_size, rounds, LeafRule(cost, 0), progress); });
  progress.report(1, "restructuring treelets");
}

}  // namespace umbel::bvh
