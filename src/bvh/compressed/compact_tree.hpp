// From a binary tree of merges to the compact one of compact_bvh.hpp, for any executor: leaves by
// cost, bottom-up (as in Karras & Aila, "Fast parallel construction of high-quality bounding volume
// hierarchies", 2013); then nodes of 8 children from the top, a level at a time, each by opening
// the child with the largest area again and again (Wald, Benthin & Boulos, "Getting Rid of
// Packets", 2008), in slots by octants (Ylitie, Karras & Laine, 2017).
//
// On the way up every merge finds out how many nodes there would be below it if it became one. So
// on the way down each node knows where all below it goes, and the same bytes come out whatever the
// order in which nodes are done.
#pragma once

#include "bvh/compressed/compact_refit.hpp"
#include "bvh/tree/leaf_rule.hpp"
#include "bvh/tree/merge_parents.hpp"

namespace umbel::bvh {

/// A binary tree in an executor's memory.
struct BinaryTree {
  const Merge* merges;
  uint32_t merge_count;  ///< those that are not in the tree have a count of 0
  const Subtree* root;
  const Aabb* boxes;  ///< of the items
  uint32_t items;
};

/// What is below a merge.
struct CompactBelow {
  double cost;
  uint32_t nodes;    ///< if it became a node: with itself, and room for what may have to be evened
  uint16_t height;   ///< if it became a node: levels of nodes
  uint16_t is_leaf;  ///< it is cheaper as a leaf
};

/// Subtrees that are too deep are laid out by halving, or rather eighthing, their sequence of
/// items: parts of 8, 64, 512, ... items.
struct EvenSubtree {
  /// The size of each part but the last one, of more than 8 items.
  UMBEL_HOST_DEVICE static uint32_t part(uint32_t items) {
    uint64_t part = 8;
    while (part * 8 < items) part *= 8;
    return static_cast<uint32_t>(part);
  }
  /// Nodes for so many items.
  UMBEL_HOST_DEVICE static uint32_t nodes(uint32_t items) {
    uint32_t sum = 0;
    while (items > 8) {
      const uint32_t each = part(items);
      uint32_t full = 0;
      for (uint32_t size = 8; size < each; size *= 8) full = 8 * full + 1;
      sum += 1 + items / each * full;
      items %= each;
    }
    return sum;
  }
};

/// The tree on the way up and down.
struct CompactLayout {
  static constexpr uint32_t kEvenLevel = 10;  ///< of nodes that may be too deep
  static constexpr uint32_t kMostHeight = kMaxCompactDepth - kEvenLevel;

  BinaryTree tree;
  CompactBelow* below;  ///< a merge
  double traversal, intersection;
  uint32_t max_leaf_size;

  UMBEL_HOST_DEVICE static double area(const Aabb& b) {
    const double x = double(b.max.x) - double(b.min.x), y = double(b.max.y) - double(b.min.y),
                 z = double(b.max.z) - double(b.min.z);
    return x * y + y * z + z * x;
  }
  UMBEL_HOST_DEVICE const Aabb& box(Subtree s) const {
    return s.is_primitive() ? tree.boxes[s.index()] : tree.merges[s.index()].box;
  }
  UMBEL_HOST_DEVICE uint32_t count(Subtree s) const {
    return s.is_primitive() ? 1 : tree.merges[s.index()].count;
  }
  UMBEL_HOST_DEVICE bool is_leaf(Subtree s) const {
    return s.is_primitive() || below[s.index()].is_leaf != 0;
  }
  UMBEL_HOST_DEVICE uint32_t nodes(Subtree s) const {
    return is_leaf(s) ? 0 : below[s.index()].nodes;
  }
  /// Without area a line meets every node or none.
  UMBEL_HOST_DEVICE double weight(Subtree s) const {
    return area(box(*tree.root)) > 0 ? area(box(s)) : 1;
  }
  UMBEL_HOST_DEVICE double cost(Subtree s) const {
    return s.is_primitive() ? weight(s) * intersection : below[s.index()].cost;
  }

  /// The children of a merge that becomes a node. Returns how many.
  UMBEL_HOST_DEVICE uint32_t open(uint32_t merge, Subtree children[8]) const {
    float areas[8];
    uint32_t count = 0;
    const auto add = [&](uint32_t at, Subtree s) {
      children[at] = s;
      areas[at] = is_leaf(s) ? -1 : area_of(box(s));
    };
    add(count++, tree.merges[merge].left);
    add(count++, tree.merges[merge].right);
    while (count < 8) {
      uint32_t largest = 0;
      for (uint32_t i = 1; i < count; ++i)
        if (areas[i] > areas[largest]) largest = i;
      if (!(areas[largest] >= 0)) break;
      const Merge& opened = tree.merges[children[largest].index()];
      add(largest, opened.left);
      add(count++, opened.right);
    }
    return count;
  }

  /// What is below a merge whose children are done.
  UMBEL_HOST_DEVICE void sum_up(uint32_t id) const {
    const Merge& merge = tree.merges[id];
    const double whole = weight(Subtree::of_merge(id));
    const double split = whole * traversal + cost(merge.left) + cost(merge.right);
    const double leaf = whole * intersection * merge.count;
    CompactBelow& sum = below[id];
    sum = {split, 0, 0, uint16_t(merge.count <= max_leaf_size && leaf <= split)};
    if (sum.is_leaf) {
      sum.cost = leaf;
      return;
    }
    Subtree children[8];
    const uint32_t found = open(id, children);
    uint32_t height = 0;
    sum.nodes = 1;
    for (uint32_t i = 0; i < found; ++i) {
      if (is_leaf(children[i])) continue;
      const CompactBelow& child = below[children[i].index()];
      sum.nodes += child.nodes;
      if (child.height > height) height = child.height;
    }
    sum.height = static_cast<uint16_t>(height < 0xffff ? height + 1 : height);
    if (sum.height > kMostHeight) {
      const uint32_t even = EvenSubtree::nodes(merge.count);
      if (even > sum.nodes) sum.nodes = even;
    }
  }
};

/// A node to be made.
struct CompactTask {
  static constexpr uint32_t kEven = 0xffffffffu;

  uint32_t merge;     ///< kEven: none
  uint32_t items;     ///< of an even one
  uint32_t node;      ///< where it goes
  uint32_t below;     ///< where the nodes below it begin
  uint32_t triangle;  ///< where its triangles begin
};

/// Makes nodes from the top.
struct CompactTop {
  CompactLayout layout;
  CompactNode* nodes;
  uint32_t* order;     ///< which item each entry of the leaves is
  uint32_t* even_at;   ///< of a merge that was laid out evenly: kEvenBit, and where its items begin
  uint32_t* any_even;  ///< whether there are such
  CompactTask* next;
  uint32_t* next_count;

  static constexpr uint32_t kEvenBit = 0x80000000u;

  UMBEL_HOST_DEVICE void operator()(const CompactTask& task, uint32_t level) const {
    if (task.merge == CompactTask::kEven) return make_even(task);
    const bool is_tall = layout.below[task.merge].height > CompactLayout::kMostHeight;
    // Of the room below it, something may be left over.
    if (is_tall) clear_below(task);
    if (is_tall && level == CompactLayout::kEvenLevel)
      begin_even(task);
    else
      make(task);
  }
  /// The only node, where all is in one leaf.
  UMBEL_HOST_DEVICE void make_only(Subtree root) const {
    CompactNode node{};
    node.meta[0] = static_cast<uint8_t>(layout.count(root));
    write_leaf(root, 0);
    nodes[0] = node;
  }

 private:
  UMBEL_HOST_DEVICE void push(const CompactTask& task) const {
    next[atomic_count(next_count)] = task;
  }

  UMBEL_HOST_DEVICE void make(const CompactTask& task) const {
    Subtree children[8], slots[8];
    const uint32_t count = layout.open(task.merge, children);
    const uint32_t used = choose_slots(task.merge, children, count, slots);
    CompactNode node{};
    node.first_child = task.below;
    node.first_triangle = task.triangle;
    uint32_t triangle = task.triangle, inner = 0;
    for (uint32_t slot = 0; slot < 8; ++slot) {
      if ((used >> slot & 1) == 0) continue;
      const Subtree child = slots[slot];
      if (layout.is_leaf(child)) {
        node.meta[slot] = static_cast<uint8_t>(layout.count(child));
        triangle = write_leaf(child, triangle);
      } else {
        node.meta[slot] = CompactNode::kInner;
        node.inner |= static_cast<uint8_t>(1u << slot);
        ++inner;
      }
    }
    uint32_t next = task.below, below = task.below + inner;
    for (uint32_t slot = 0; slot < 8; ++slot) {
      if ((node.inner >> slot & 1) == 0) continue;
      const Subtree child = slots[slot];
      push({child.index(), 0, next++, below, triangle});
      below += layout.nodes(child) - 1;
      triangle += layout.count(child);
    }
    nodes[task.node] = node;
  }

  UMBEL_HOST_DEVICE void clear_below(const CompactTask& task) const {
    for (uint32_t i = 0; i + 1 < layout.below[task.merge].nodes; ++i)
      nodes[task.below + i] = CompactNode{};
  }

  UMBEL_HOST_DEVICE void begin_even(CompactTask task) const {
    even_at[task.merge] = kEvenBit | task.triangle;
    *any_even = 1;
    task.items = layout.tree.merges[task.merge].count;
    make_even(task);
  }
  UMBEL_HOST_DEVICE void make_even(const CompactTask& task) const {
    const uint32_t part = EvenSubtree::part(task.items);
    const uint32_t count = (task.items + part - 1) / part;
    const uint32_t last = task.items - (count - 1) * part;
    CompactNode node{};
    node.first_child = task.below;
    // Only the last one can be a leaf beside nodes, and the others come before it.
    node.first_triangle = task.triangle + (part > 8 ? (count - 1) * part : 0);
    uint32_t inner = 0;
    for (uint32_t slot = 0; slot < count; ++slot) {
      const uint32_t size = slot + 1 < count ? part : last;
      node.meta[slot] = size > 8 ? CompactNode::kInner : static_cast<uint8_t>(size);
      if (size > 8) node.inner |= static_cast<uint8_t>(1u << slot), ++inner;
    }
    uint32_t below = task.below + inner;
    for (uint32_t slot = 0; slot < inner; ++slot) {
      const uint32_t size = slot + 1 < count ? part : last;
      push({CompactTask::kEven, size, task.below + slot, below, task.triangle + slot * part});
      below += EvenSubtree::nodes(size) - 1;
    }
    nodes[task.node] = node;
  }

  /// Gives each child the slot of the corner that it lies towards, the clearest first. Returns the
  /// slots that are used, as bits.
  UMBEL_HOST_DEVICE uint32_t choose_slots(uint32_t merge, const Subtree* children, uint32_t count,
                                          Subtree slots[8]) const {
    const Aabb& whole = layout.tree.merges[merge].box;
    const Vec3 center = whole.min + whole.max;
    Vec3 away[8];
    for (uint32_t i = 0; i < count; ++i) {
      const Aabb& box = layout.box(children[i]);
      away[i] = box.min + box.max - center;
    }
    uint32_t placed = 0, used = 0;
    for (uint32_t round = 0; round < count; ++round) {
      float best = 0;
      uint32_t best_child = kNone, best_slot = 0;
      for (uint32_t i = 0; i < count; ++i) {
        if (placed >> i & 1) continue;
        for (uint32_t slot = 0; slot < 8; ++slot) {
          if (used >> slot & 1) continue;
          const float towards = (slot & 1 ? away[i].x : -away[i].x) +
                                (slot & 2 ? away[i].y : -away[i].y) +
                                (slot & 4 ? away[i].z : -away[i].z);
          if (best_child != kNone && !(towards > best)) continue;
          best = towards;
          best_child = i;
          best_slot = slot;
        }
      }
      placed |= 1u << best_child;
      used |= 1u << best_slot;
      slots[best_slot] = children[best_child];
    }
    return used;
  }

  /// The items below, of which there are at most 8. Returns the index behind them.
  UMBEL_HOST_DEVICE uint32_t write_leaf(Subtree leaf, uint32_t triangle) const {
    Subtree open[9];
    uint32_t size = 0;
    open[size++] = leaf;
    while (size > 0) {
      const Subtree s = open[--size];
      if (s.is_primitive()) {
        order[triangle++] = s.index();
      } else {
        open[size++] = layout.tree.merges[s.index()].right;
        open[size++] = layout.tree.merges[s.index()].left;
      }
    }
    return triangle;
  }
};

/// Lays out a tree of at least one item: the nodes without their boxes, info->nodes and
/// info->sah_cost, and which item each entry of the leaves is. max_leaf_size is at most 8.
/// Long, as it is one kernel after the other, all of which use the same arrays.
template <typename Exec>
void lay_out_compact(Exec& exec, const BinaryTree& tree, const CostModel& cost,
                     uint32_t max_leaf_size, CompactNode* nodes, CompactInfo* info,
                     uint32_t* order) {
  auto below = exec.template allocate<CompactBelow>(tree.merge_count);
  auto arrived = exec.template allocate<uint32_t>(tree.merge_count);
  auto parents_of_merges = exec.template allocate<uint32_t>(tree.merge_count);
  auto parents_of_items = exec.template allocate<uint32_t>(tree.items);
  const MergeParents parents{parents_of_merges.data(), parents_of_items.data()};
  find_parents(exec, tree.merges, tree.merge_count, tree.root, parents);
  const CompactLayout layout{tree, below.data(), cost.traversal, cost.intersection, max_leaf_size};
  exec.for_each(tree.merge_count,
                [arrived = arrived.data()] UMBEL_DEVICE_LAMBDA(size_t i) { arrived[i] = 0; });
  exec.for_each(tree.items,
                [layout, parents, arrived = arrived.data()] UMBEL_DEVICE_LAMBDA(size_t item) {
                  uint32_t merge = parents.of_items[item];
                  while (merge != kNone && is_last_to_arrive(&arrived[merge], 1)) {
                    layout.sum_up(merge);
                    merge = parents.of_merges[merge];
                  }
                });
  // Nodes of a level have two items each at least.
  const uint32_t most = tree.items / 2 + 1;
  auto list = exec.template allocate<CompactTask>(most);
  auto other = exec.template allocate<CompactTask>(most);
  auto counts = exec.template allocate<uint32_t>(kMaxCompactDepth + 2);
  uint32_t* any_even = counts.data() + kMaxCompactDepth + 1;
  const CompactTop top{layout, nodes, order, arrived.data(), any_even, nullptr, nullptr};
  exec.for_each(1, [=, list = list.data(), counts = counts.data()] UMBEL_DEVICE_LAMBDA(size_t) {
    for (uint32_t i = 0; i < kMaxCompactDepth + 2; ++i) counts[i] = 0;
    const Subtree root = *layout.tree.root;
    info->sah_cost = static_cast<float>(layout.cost(root) / layout.weight(root));
    info->nodes = layout.is_leaf(root) ? 1 : layout.nodes(root);
    if (layout.is_leaf(root)) {
      top.make_only(root);
    } else {
      counts[0] = 1;
      list[0] = {root.index(), 0, 0, 1, 0};
    }
  });
  exec.for_each_layer(counts.data(), kMaxCompactDepth, most, 1,
                      [=, list = list.data(), other = other.data(),
                       counts = counts.data()] UMBEL_DEVICE_LAMBDA(uint32_t level, size_t i) {
                        CompactTop own = top;
                        own.next = level % 2 == 0 ? other : list;
                        own.next_count = counts + level + 1;
                        own((level % 2 == 0 ? list : other)[i], level);
                      });
  exec.for_each(tree.items, [top, parents] UMBEL_DEVICE_LAMBDA(size_t item) {
    if (*top.any_even == 0) return;
    const Merge* merges = top.layout.tree.merges;
    Subtree child = Subtree::of_primitive(static_cast<uint32_t>(item));
    uint32_t before = 0;
    for (uint32_t merge = parents.of_items[item]; merge != kNone;
         merge = parents.of_merges[merge]) {
      if (merges[merge].right.link == child.link) before += top.layout.count(merges[merge].left);
      if (top.even_at[merge] & CompactTop::kEvenBit) {
        top.order[(top.even_at[merge] & ~CompactTop::kEvenBit) + before] =
            static_cast<uint32_t>(item);
        return;
      }
      child = Subtree::of_merge(merge);
    }
  });
}

}  // namespace umbel::bvh
