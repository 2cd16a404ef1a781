// Whether a tree from an unknown source is one.
#include <string>

#include "base/math.hpp"
#include "kdtree/tree_data.hpp"
#include "query/cells.hpp"

namespace umbel::kdtree {
namespace {

[[noreturn]] void fail(size_t node, const char* what) {
  throw Error(ErrorCode::kCorrupt, "node " + std::to_string(node) + " " + what);
}

struct Visit {
  uint32_t node, depth;
  Aabb cell;
};

/// The leaves' lists so far, which follow each other.
struct Lists {
  std::vector<uint32_t> count_at;  ///< of the list that begins at a reference
  uint32_t end = 0;
};

/// A leaf has a list that comes after all before, or one of those.
void check_list(const Tree& tree, uint32_t index, Lists& lists) {
  const uint32_t first = tree.nodes[index].first, count = tree.nodes[index].count();
  if (count == 0) return;
  if (uint64_t{first} + count > tree.references.size())
    fail(index, "is a leaf of references that are not there");
  if (first == lists.end) {
    lists.count_at[first] = count;
    lists.end += count;
  } else if (lists.count_at[first] != count) {
    fail(index, "is a leaf whose list overlaps another");
  }
  for (uint32_t i = first + 1; i < first + count; ++i)
    if (tree.references[i] <= tree.references[i - 1])
      fail(index, "is a leaf whose references do not ascend");
}

}  // namespace

void check(const Tree& tree, uint32_t triangle_count) {
  if (tree.nodes.empty()) {
    if (!tree.references.empty() || !is_empty(tree.bounds))
      throw Error(ErrorCode::kCorrupt, "it has no nodes, but is not empty");
    return;
  }
  if (!is_finite(tree.bounds.min) || !is_finite(tree.bounds.max) || is_empty(tree.bounds))
    throw Error(ErrorCode::kCorrupt, "its bounds are empty or not finite");
  for (size_t i = 0; i < tree.references.size(); ++i)
    if (tree.references[i] >= triangle_count)
      throw Error(ErrorCode::kCorrupt, "reference " + std::to_string(i) +
                                           " is to a triangle that "
                                           "is not there");
  // Depth-first order means that nodes come off the stack in the order of their numbers.
  uint32_t next = 0;
  Lists lists;
  lists.count_at.resize(tree.references.size());
  std::vector<Visit> stack{{0, 0, tree.bounds}};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    if (visit.node != next || next >= tree.nodes.size()) fail(next, "is not in depth-first order");
    const Node& node = tree.nodes[next++];
    if (node.is_leaf()) {
      check_list(tree, visit.node, lists);
      continue;
    }
    if (visit.depth >= kMaxKdDepth) fail(visit.node, "is too deep");
    if (!(node.at >= component(visit.cell.min, node.axis()) &&
          node.at <= component(visit.cell.max, node.axis())))
      fail(visit.node, "has its plane outside its cell");
    stack.push_back({node.above(), visit.depth + 1, cell_above(visit.cell, node.axis(), node.at)});
    stack.push_back({next, visit.depth + 1, cell_below(visit.cell, node.axis(), node.at)});
  }
  if (next != tree.nodes.size()) fail(next, "is not reached from the root");
  if (lists.end != tree.references.size())
    throw Error(ErrorCode::kCorrupt, "there are references that are in no leaf");
}

}  // namespace umbel::kdtree
