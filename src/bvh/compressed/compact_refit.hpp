// The boxes of a compact tree from those of its triangles, for any executor: a thread climbs from
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

/// Makes the boxes of one node, and returns what holds them all.
struct CompactBoxes {
  CompactArrays tree;
  const Aabb* parts;  ///< of each triangle in leaves; null: whole triangles
  const Aabb* exact;  ///< of nodes that are done

  UMBEL_HOST_DEVICE Aabb box_of(uint32_t triangle) const {
    const CompactTriangle& t = tree.triangles[triangle];
    const Aabb whole = box_of_finite(t.p0, t.p1, t.p2);
    return parts && !is_empty(whole) ? parts[triangle] : whole;
  }
  UMBEL_HOST_DEVICE Aabb operator()(uint32_t index) const {
    CompactNode& node = tree.nodes[index];
    uint32_t child = node.first_child, triangle = node.first_triangle;
    Aabb boxes[8];
    for (uint32_t slot = 0; slot < 8; ++slot) {
      if (node.meta[slot] == CompactNode::kInner) {
        boxes[slot] = exact[child++];
      } else {
        for (uint32_t k = 0; k < node.meta[slot]; ++k) extend(boxes[slot], box_of(triangle++));
      }
    }
    return set_compact_boxes(node, boxes);
  }
};

/// Of a tree over at most `triangles`. `parts`, if any, are the boxes that its triangles count for.
template <typename Exec>
void refit_compact(Exec& exec, const CompactArrays& tree, uint32_t triangles, const Aabb* parts) {
  const uint32_t most = compact_node_capacity(triangles);
  auto parents = exec.template allocate<uint32_t>(most);
  auto arrived = exec.template allocate<uint32_t>(most);
  auto exact = exec.template allocate<Aabb>(most);
  exec.for_each_of(&tree.info->nodes, most, 1,
                   [nodes = tree.nodes, parents = parents.data(),
                    arrived = arrived.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
                     arrived[i] = 0;
                     if (i == 0) parents[0] = kNone;
                     const uint32_t children = count_bits(nodes[i].inner);
                     for (uint32_t k = 0; k < children; ++k)
                       parents[nodes[i].first_child + k] = static_cast<uint32_t>(i);
                   });
  exec.for_each_of(&tree.info->nodes, most, 1,
                   [tree, parts, parents = parents.data(), arrived = arrived.data(),
                    exact = exact.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
                     const CompactBoxes boxes{tree, parts, exact};
                     auto node = static_cast<uint32_t>(i);
                     uint32_t children = 0;
                     for (const uint8_t meta : tree.nodes[node].meta) children |= meta;
                     // Without any child it is a gap in the array.
                     if (children == 0 || tree.nodes[node].inner != 0) return;
                     while (true) {
                       // Not returned into the array, where GCC hides the write from sanitizers.
                       const Aabb box = boxes(node);
                       exact[node] = box;
                       const uint32_t parent = parents[node];
                       if (parent == kNone) break;
                       const uint32_t children = count_bits(tree.nodes[parent].inner);
                       if (!is_last_to_arrive(&arrived[parent], children - 1)) return;
                       node = parent;
                     }
                     tree.info->bounds = exact[0];
                   });
}

}  // namespace umbel::bvh
