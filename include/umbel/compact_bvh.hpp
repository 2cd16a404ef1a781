// The memory form of a hierarchy that is built and traced on a device: 8 children a node in 80
// bytes, as in Ylitie, Karras & Laine, "Efficient Incoherent Ray Traversal on GPUs Through
// Compressed Wide BVHs", 2017, but with leaves of up to 8 triangles.
#pragma once

#include <cstdint>

#include "umbel/types.hpp"

namespace umbel::bvh {

/// A node with up to 8 children. Plane q of an axis is at origin + q * 2^(exponent - 127), rounded
/// to the nearest float, and at most the largest one; boxes are rounded outwards.
///
/// Children that are nodes lie one after the other from nodes[first_child] on, in the order of
/// their slots; the triangles of children that are leaves lie one after the other from
/// triangles[first_triangle] on, in the order of their slots. So
///
///     node of slot s     = first_child + (slots < s with meta == kInner)
///     triangle of slot s = first_triangle + sum of meta of slots < s that are leaves
///
/// Slots are chosen so that the children of a node come about front to back in the order of
/// (slot ^ octant), where octant = (dx < 0 ? 1 : 0) | (dy < 0 ? 2 : 0) | (dz < 0 ? 4 : 0) of a
/// ray's direction; slots without a child may lie anywhere. Any order gives the right hits.
struct CompactNode {
  static constexpr uint8_t kInner = 0x80;  ///< meta of a child that is a node

  Vec3 origin;              ///< the lowest corner of all below
  uint8_t exponent[3];      ///< of the size of a cell along x, y, z: 1..254
  uint8_t inner;            ///< bit s: the child in slot s is a node
  uint32_t first_child;     ///< index of a node
  uint32_t first_triangle;  ///< index of a triangle
  uint8_t meta[8];          ///< 0: no child; 1..8: a leaf of so many triangles; kInner: a node
  uint8_t low[3][8];        ///< planes along x, y, z of each slot; without a meaning where empty
  uint8_t high[3][8];
};
static_assert(sizeof(CompactNode) == 80);

/// A triangle of a leaf, with the very floats of the mesh. What has a NaN or an infinite corner is
/// in the tree, as a point, but no ray hits it.
struct CompactTriangle {
  Vec3 p0;
  uint32_t primitive;  ///< its number in the mesh
  Vec3 p1;
  uint32_t reserved1;  ///< 0
  Vec3 p2;
  uint32_t reserved2;  ///< 0
};
static_assert(sizeof(CompactTriangle) == 48);

/// What holds of a whole tree. nodes[0] is the root; with no triangles there are no nodes, and with
/// a few the root has only leaves.
struct CompactInfo {
  uint32_t nodes;      ///< from 0 to compact_node_capacity(triangles)
  uint32_t triangles;  ///< of all leaves: with spatial splits a primitive may be there repeatedly
  Aabb bounds;         ///< of all triangles that can be hit; empty if there are none
  float sah_cost;      ///< of the binary tree that the nodes were made of, with its leaves
  float reserved;      ///< 0
};
static_assert(sizeof(CompactInfo) == 40);

/// Levels of nodes on the way from the root to a leaf, at most; so a stack of one entry a level
/// needs no more.
inline constexpr uint32_t kMaxCompactDepth = 32;

/// Most nodes that so many triangles in leaves can need.
constexpr uint32_t compact_node_capacity(uint32_t triangles) {
  return static_cast<uint32_t>(uint64_t{triangles} * 4 / 7) + 2;
}

}  // namespace umbel::bvh
