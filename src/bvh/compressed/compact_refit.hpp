// The boxes of a compact tree from those of its triangles, for any executor: 8 lanes climb from
// every node that has only leaves, and of those that meet at a node the last one makes its boxes
// and climbs on (as Karras, "Maximizing Parallelism in the Construction of BVHs, Octrees, and k-d
// Trees", 2012, makes those of binary trees). One atomic operation a node.
#pragma once

#include "base/bit_count.hpp"
#include "bvh/compressed/compact_node.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// The arrays of a compact tree. See compact_bvh.hpp.
struct CompactArrays {
  CompactNode* nodes;
  CompactTriangle* triangles;
  CompactInfo* info;
};

/// The way up from a node that has only leaves. A lane makes the boxes of a slot.
struct CompactClimb {
  static constexpr uint32_t kLanes = 8;
  struct Shared {
    Aabb boxes[8];
  };

  CompactArrays tree;
  const Aabb* parts;  ///< of each triangle in leaves; null: whole triangles
  const uint32_t* parents;
  uint32_t* arrived;
  Aabb* exact;  ///< of nodes that are done

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    auto node = static_cast<uint32_t>(index);
    if (!has_only_leaves(tree.nodes[node])) return;
    while (true) {
      const Aabb whole = make_boxes(team, node, shared);
      const uint32_t parent = parents[node];
      if (parent == kNone) {
        if (team.rank() == 0) tree.info->bounds = whole;
        return;
      }
      uint32_t is_last = 0;
      if (team.rank() == 0) {
        exact[node] = whole;
        is_last = is_last_to_arrive(&arrived[parent], count_bits(tree.nodes[parent].inner) - 1);
      }
      if (team.reduce(is_last, Any{}) == 0) return;
      node = parent;
    }
  }

 private:
  struct Any {
    UMBEL_HOST_DEVICE uint32_t operator()(uint32_t a, uint32_t b) const { return a | b; }
  };
  struct Unite {
    UMBEL_HOST_DEVICE Aabb operator()(const Aabb& a, const Aabb& b) const { return united(a, b); }
  };

  /// Without any child it is a gap in the array.
  UMBEL_HOST_DEVICE static bool has_only_leaves(const CompactNode& node) {
    uint32_t children = 0;
    for (const uint8_t meta : node.meta) children |= meta;
    return children != 0 && node.inner == 0;
  }
  UMBEL_HOST_DEVICE Aabb box_of(uint32_t triangle) const {
    const CompactTriangle& t = tree.triangles[triangle];
    const Aabb whole = box_of_finite(t.p0, t.p1, t.p2);
    return parts && !is_empty(whole) ? parts[triangle] : whole;
  }
  UMBEL_HOST_DEVICE Aabb box_in(const CompactNode& node, uint32_t slot) const {
    const uint8_t meta = node.meta[slot];
    if (meta == CompactNode::kInner) return exact[compact_child(node, slot)];
    Aabb box;
    const uint32_t first = compact_leaf(node, slot);
    for (uint32_t k = 0; k < meta; ++k) extend(box, box_of(first + k));
    return box;
  }
  /// Writes the boxes of a node, and returns what holds them all.
  template <typename Team>
  UMBEL_HOST_DEVICE Aabb make_boxes(const Team& team, uint32_t index, Shared& shared) const {
    CompactNode& node = tree.nodes[index];
    Aabb all;
    // Each lane reads what it wrote itself.
    for (uint32_t slot = team.rank(); slot < 8; slot += team.size())
      extend(all, shared.boxes[slot] = box_in(node, slot));
    // Which zero is the lowest depends on the order.
    all = without_negative_zero(team.reduce(all, Unite{}));
    const CompactGrid grid(all);
    if (team.rank() == 0) grid.write(node);
    for (uint32_t slot = team.rank(); slot < 8; slot += team.size())
      grid.write(node, slot, shared.boxes[slot]);
    return all;
  }
};

/// Of a tree over at most `triangles`, and so many nodes or none. `parts`, if any, are the boxes
/// that its triangles count for.
template <typename Exec>
void refit_compact(Exec& exec, const CompactArrays& tree, const uint32_t* nodes, uint32_t triangles,
                   const Aabb* parts) {
  const uint32_t most = compact_node_capacity(triangles);
  auto parents = exec.template allocate<uint32_t>(most);
  auto arrived = exec.template allocate<uint32_t>(most);
  auto exact = exec.template allocate<Aabb>(most);
  exec.for_each_of(nodes, most, 1,
                   [nodes = tree.nodes, parents = parents.data(),
                    arrived = arrived.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
                     arrived[i] = 0;
                     if (i == 0) parents[0] = kNone;
                     const uint32_t children = count_bits(nodes[i].inner);
                     for (uint32_t k = 0; k < children; ++k)
                       parents[nodes[i].first_child + k] = static_cast<uint32_t>(i);
                   });
  exec.for_each_team_of(nodes, most,
                        CompactClimb{tree, parts, parents.data(), arrived.data(), exact.data()});
}

}  // namespace umbel::bvh
