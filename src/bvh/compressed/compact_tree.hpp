// From a binary tree of merges to the compact one of compact_bvh.hpp, for any executor: nodes of 8
// children from the top, a level at a time, in slots by octants (Ylitie, Karras & Laine, 2017).
//
// On the way up (compact_sums.hpp) every merge found out how many nodes there would be below it if
// it became one. So on the way down each node knows where all below it goes, and the same bytes
// come out whatever the order in which nodes are done.
//
// Boxes of nodes are those of the merges that became their children. Only a tree of which that is
// not so needs refit_compact(): items that are not what they count for in the end, or nodes that
// are no merges.
#pragma once

#include <cstring>

#include "bvh/compressed/compact_refit.hpp"
#include "bvh/compressed/compact_sums.hpp"
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

/// The tree on the way down.
struct CompactLayout {
  BinaryTree tree;
  CompactSums sums;

  UMBEL_HOST_DEVICE const Aabb& box(Subtree s) const {
    return s.is_primitive() ? tree.boxes[s.index()] : tree.merges[s.index()].box;
  }
  UMBEL_HOST_DEVICE uint32_t count(Subtree s) const {
    return s.is_primitive() ? 1 : tree.merges[s.index()].count;
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

/// Makes nodes from the top, each by a team, of which a lane has a child or a slot.
struct CompactTop {
  static constexpr uint32_t kLanes = 8;
  struct Shared {
    Subtree ids[8];  ///< of the children
    CompactBelow below[8];
    Aabb boxes[8];
    uint32_t counts[8];  ///< items
    CompactNode node;
  };

  CompactLayout layout;
  CompactNode* nodes;
  uint32_t* order;     ///< which item each entry of the leaves is
  uint32_t* any_even;  ///< not 0: there are merges that were laid out evenly
  uint32_t* unfitted;  ///< nodes, if their boxes must be found from below
  CompactInfo* info;
  CompactTask* lists[2];
  uint32_t* list_sizes;  ///< of each level

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, uint32_t level, size_t index,
                                    Shared& shared) const {
    const CompactTask task = lists[level % 2][index];
    if (task.merge == CompactTask::kEven) {
      if (team.rank() == 0) make_even(task, level);
      return;
    }
    const CompactBelow whole = layout.sums.below[task.merge];
    if (!whole.is_tall()) return make(team, task, whole, level, shared);
    // Of the room below it, something may be left over.
    for (uint32_t i = team.rank(); i + 1 < whole.nodes(); i += team.size())
      nodes[task.below + i] = CompactNode{};
    if (level != CompactBelow::kEvenLevel) return make(team, task, whole, level, shared);
    team.sync();  // all have read what it is
    if (team.rank() == 0) begin_even(task, level);
  }
  /// The only node, where all is in one leaf.
  UMBEL_HOST_DEVICE void make_only(Subtree root) const {
    CompactNode node{};
    node.meta[0] = static_cast<uint8_t>(layout.count(root));
    write_leaf(root, 0);
    const Aabb box = without_negative_zero(layout.box(root));
    const CompactGrid grid(box);
    grid.write(node);
    grid.write(node, 0, box);
    info->bounds = box;
    nodes[0] = node;
  }

 private:
  UMBEL_HOST_DEVICE void push(uint32_t level, const CompactTask& task) const {
    lists[(level + 1) % 2][atomic_count(&list_sizes[level + 1])] = task;
  }

  template <typename Team>
  UMBEL_HOST_DEVICE void make(const Team& team, const CompactTask& task, const CompactBelow& whole,
                              uint32_t level, Shared& shared) const {
    const uint32_t count = open(team, whole, shared);
    // Which zero is the lowest depends on the order.
    const Aabb box = without_negative_zero(layout.tree.merges[task.merge].box);
    uint32_t used = 0;  // slots, as bits
    const uint32_t child_in = choose_slots(team, box, count, shared, used);
    const CompactGrid grid(box);
    if (team.rank() == 0) {
      grid.write(shared.node);
      shared.node.first_child = task.below;
      shared.node.first_triangle = task.triangle;
      if (level == 0) info->bounds = box;
    }
    for (uint32_t slot = team.rank(); slot < 8; slot += team.size()) {
      const bool is_used = used >> slot & 1;
      const uint32_t k = child_in >> 4 * slot & 7;
      const Before before = count_before(slot, used, child_in, shared);
      const bool is_inner = before.inner >> slot & 1;
      shared.node.meta[slot] = !is_used   ? uint8_t{0}
                               : is_inner ? CompactNode::kInner
                                          : static_cast<uint8_t>(shared.counts[k]);
      grid.write(shared.node, slot, is_used ? shared.boxes[k] : Aabb{});
      if (slot == 0) shared.node.inner = static_cast<uint8_t>(before.inner);
      if (is_inner) {
        push(level, {shared.ids[k].index(), 0, task.below + before.children,
                     task.below + count_bits(before.inner) + before.nodes,
                     task.triangle + before.in_nodes});
      } else if (is_used) {
        write_leaf(shared.ids[k], task.triangle + before.in_leaves);
      }
    }
    team.sync();
    write_node(team, shared.node, nodes[task.node]);
  }

  /// What comes before a slot: first the triangles of all leaves, then those below the nodes.
  struct Before {
    uint32_t inner = 0;  ///< slots with a node, as bits: all of them
    uint32_t in_leaves = 0, in_nodes = 0;
    uint32_t children = 0, nodes = 0;  ///< those that are nodes, and the nodes below them
  };
  UMBEL_HOST_DEVICE static Before count_before(uint32_t slot, uint32_t used, uint32_t child_in,
                                               const Shared& shared) {
    Before before;
    for (uint32_t other = 0; other < 8; ++other) {
      if ((used >> other & 1) == 0) continue;
      const uint32_t k = child_in >> 4 * other & 7, count = shared.counts[k];
      const CompactBelow& below = shared.below[k];
      if (below.is_leaf()) {
        before.in_nodes += count;
        if (other < slot) before.in_leaves += count;
      } else {
        before.inner |= 1u << other;
        if (other >= slot) continue;
        before.in_nodes += count;
        before.nodes += below.nodes() - 1;
        ++before.children;
      }
    }
    return before;
  }

  /// Lanes write words side by side.
  template <typename Team>
  UMBEL_HOST_DEVICE static void write_node(const Team& team, const CompactNode& from,
                                           CompactNode& to) {
    constexpr uint32_t kWords = sizeof(CompactNode) / sizeof(uint32_t);
    for (uint32_t i = team.rank(); i < kWords; i += team.size()) {
      uint32_t word;
      memcpy(&word, reinterpret_cast<const char*>(&from) + i * sizeof(word), sizeof(word));
      memcpy(reinterpret_cast<char*>(&to) + i * sizeof(word), &word, sizeof(word));
    }
  }

  /// Finds the children of a node as CompactSums::open() does, and all that is to be known of them.
  /// Returns how many there are; their boxes and counts are there after the next sync().
  template <typename Team>
  UMBEL_HOST_DEVICE uint32_t open(const Team& team, const CompactBelow& whole,
                                  Shared& shared) const {
    const auto put = [&](uint32_t left_at, uint32_t right_at, const CompactBelow& opened) {
      for (uint32_t side = team.rank(); side < 2; side += team.size()) {
        const Subtree child = side == 0 ? opened.left : opened.right;
        shared.ids[side == 0 ? left_at : right_at] = child;
        shared.below[side == 0 ? left_at : right_at] = layout.sums.look(child);
      }
      team.sync();
    };
    put(0, 1, whole);
    uint32_t count = 2;
    for (; count < 8; ++count) {
      Largest largest;
      for (uint32_t i = team.rank(); i < count; i += team.size())
        largest = Largest::of(largest, {shared.below[i].area, i});
      largest = team.reduce(largest, OfLargest{});
      if (!(largest.value >= 0)) break;
      const CompactBelow opened = shared.below[largest.place];
      team.sync();  // all have read it
      put(largest.place, count, opened);
    }
    for (uint32_t i = team.rank(); i < count; i += team.size()) {
      shared.boxes[i] = layout.box(shared.ids[i]);
      shared.counts[i] = layout.count(shared.ids[i]);
    }
    return count;
  }

  /// A number and where it is; of equal ones the first place counts.
  struct Largest {
    static constexpr float kNone = -3e38f;  // no area, and less than any sum of coordinates

    float value = kNone;
    uint32_t place = 0xffffffffu;

    UMBEL_HOST_DEVICE static Largest of(const Largest& a, const Largest& b) {
      return b.value > a.value || (b.value == a.value && b.place < a.place) ? b : a;
    }
  };
  struct OfLargest {
    UMBEL_HOST_DEVICE Largest operator()(const Largest& a, const Largest& b) const {
      return Largest::of(a, b);
    }
  };

  /// Gives each child the slot of the corner that it lies towards, the clearest first. Returns the
  /// child of each slot that is used, four bits a slot.
  template <typename Team>
  UMBEL_HOST_DEVICE uint32_t choose_slots(const Team& team, const Aabb& whole, uint32_t count,
                                          const Shared& shared, uint32_t& used) const {
    const Vec3 center = whole.min + whole.max;
    uint32_t placed = 0, child_in = 0;
    for (uint32_t round = 0; round < count; ++round) {
      Largest best;
      for (uint32_t i = team.rank(); i < count; i += team.size()) {
        if (placed >> i & 1) continue;
        // Twice the way from the node's centre to the child's.
        const Vec3 away = shared.boxes[i].min + shared.boxes[i].max - center;
        UMBEL_UNROLL
        for (uint32_t slot = 0; slot < 8; ++slot) {
          if (used >> slot & 1) continue;
          const float towards = (slot & 1 ? away.x : -away.x) + (slot & 2 ? away.y : -away.y) +
                                (slot & 4 ? away.z : -away.z);
          best = Largest::of(best, {towards, 8 * i + slot});
        }
      }
      best = team.reduce(best, OfLargest{});
      const uint32_t child = best.place / 8, slot = best.place % 8;
      placed |= 1u << child;
      used |= 1u << slot;
      child_in |= child << 4 * slot;
    }
    return child_in;
  }

  UMBEL_HOST_DEVICE void begin_even(CompactTask task, uint32_t level) const {
    CompactBelow& even = layout.sums.below[task.merge];
    even.area = CompactBelow::kEven;
    even.packed = task.triangle;
    *any_even = 1;
    *unfitted = info->nodes;
    task.items = layout.tree.merges[task.merge].count;
    make_even(task, level);
  }
  UMBEL_HOST_DEVICE void make_even(const CompactTask& task, uint32_t level) const {
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
      push(level,
           {CompactTask::kEven, size, task.below + slot, below, task.triangle + slot * part});
      below += EvenSubtree::nodes(size) - 1;
    }
    nodes[task.node] = node;
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

/// Lays out a tree of at least one item, once all merges are summed up: the nodes, `info`, and
/// which item each entry of the leaves is. *unfitted becomes how many nodes there are if their
/// boxes are still to be made, by refit_compact(), else 0; it is not 0 before if that is known
/// already.
/// Long, as it is one kernel after the other, all of which use the same arrays.
template <typename Exec>
void lay_out_compact(Exec& exec, const BinaryTree& tree, const CompactSums& sums,
                     CompactNode* nodes, CompactInfo* info, uint32_t* order, uint32_t* unfitted) {
  const CompactLayout layout{tree, sums};
  // Nodes of a level have two items each at least.
  const uint32_t most = tree.items / 2 + 1;
  auto list = exec.template allocate<CompactTask>(most);
  auto other = exec.template allocate<CompactTask>(most);
  auto counts = exec.template allocate<uint32_t>(kMaxCompactDepth + 2);
  uint32_t* any_even = counts.data() + kMaxCompactDepth + 1;
  const CompactTop top{
      layout, nodes, order, any_even, unfitted, info, {list.data(), other.data()}, counts.data()};
  exec.for_each(1, [=, list = list.data(), counts = counts.data()] UMBEL_DEVICE_LAMBDA(size_t) {
    for (uint32_t i = 0; i < kMaxCompactDepth + 2; ++i) counts[i] = 0;
    const Subtree root = *layout.tree.root;
    const Aabb box = layout.box(root);
    const CompactSums::Sum sum = layout.sums.of(root, box);
    CompactInfo whole{};
    whole.triangles = layout.tree.items;
    whole.nodes = sum.below.is_leaf() ? 1 : sum.below.nodes();
    whole.sah_cost = static_cast<float>(sum.cost / layout.sums.weight(box));
    *info = whole;
    if (*unfitted != 0) *unfitted = whole.nodes;
    if (sum.below.is_leaf()) {
      top.make_only(root);
    } else {
      counts[0] = 1;
      list[0] = {root.index(), 0, 0, 1, 0};
    }
  });
  exec.for_each_layer_team(counts.data(), kMaxCompactDepth, most, top);
  // Trees are seldom that deep: otherwise two kernels whose threads do nothing.
  auto parents_of_merges = exec.template allocate<uint32_t>(tree.merge_count);
  auto parents_of_items = exec.template allocate<uint32_t>(tree.items);
  const MergeParents parents{parents_of_merges.data(), parents_of_items.data()};
  exec.for_each_of(any_even, 1, tree.merge_count + 1, [=] UMBEL_DEVICE_LAMBDA(size_t i) {
    parents.set_below(tree.merges, tree.merge_count, *tree.root, i);
  });
  exec.for_each_of(any_even, 1, tree.items, [layout, order, parents] UMBEL_DEVICE_LAMBDA(size_t i) {
    const Merge* merges = layout.tree.merges;
    const auto item = static_cast<uint32_t>(i);
    Subtree child = Subtree::of_primitive(item);
    uint32_t before = 0;
    for (uint32_t merge = parents.of_items[item]; merge != kNone;
         merge = parents.of_merges[merge]) {
      if (merges[merge].right.link == child.link) before += layout.count(merges[merge].left);
      const CompactBelow& even = layout.sums.below[merge];
      if (even.area == CompactBelow::kEven) {
        order[even.packed + before] = item;
        return;
      }
      child = Subtree::of_merge(merge);
    }
  });
}

/// Sums up the merges of a tree that is there.
template <typename Exec>
void sum_up(Exec& exec, const BinaryTree& tree, const CompactSums& sums) {
  auto arrived = exec.template allocate<uint32_t>(tree.merge_count);
  auto parents_of_merges = exec.template allocate<uint32_t>(tree.merge_count);
  auto parents_of_items = exec.template allocate<uint32_t>(tree.items);
  const MergeParents parents{parents_of_merges.data(), parents_of_items.data()};
  exec.for_each(tree.merge_count + size_t{1},
                [=, arrived = arrived.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
                  if (i < tree.merge_count) arrived[i] = 0;
                  parents.set_below(tree.merges, tree.merge_count, *tree.root, i);
                });
  exec.for_each(tree.items, [=, arrived = arrived.data()] UMBEL_DEVICE_LAMBDA(size_t item) {
    uint32_t id = parents.of_items[item];
    while (id != kNone && is_last_to_arrive(&arrived[id], 1)) {
      const Merge merge = tree.merges[id];
      const auto sum_of = [&](Subtree s) {
        return sums.of(s, s.is_primitive() ? tree.boxes[s.index()] : Aabb{});
      };
      sums.join(id, merge, sum_of(merge.left), sum_of(merge.right));
      id = parents.of_merges[id];
    }
  });
}

}  // namespace umbel::bvh
