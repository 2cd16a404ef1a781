// What a KdTree holds.
#pragma once

#include "query/leaf_lists.hpp"
#include "umbel/kdtree.hpp"

namespace umbel {

/// Deepest leaf that there may be.
inline constexpr uint32_t kMaxKdDepth = 64;

/// The cell of a leaf and, for each of its faces, the smallest subtree that has all of its
/// neighbours there; kNone where the face is the border. Faces: low x, high x, low y, ...
struct RopeLeaf {
  Aabb cell;
  uint32_t ropes[6];
};

struct KdTreeData : LeafStore {
  BigVector<kdtree::Node> nodes;  ///< a leaf's references are those of the leaf store
  kdtree::Statistics statistics{};
  bvh::CostModel cost;

  // Never stored.
  kdtree::Traversal traversal = kdtree::Traversal::kStack;
  Simd simd = Simd::kAuto;  ///< as asked for
  BigVector<RopeLeaf> rope_leaves;
  BigVector<uint32_t> rope_leaf_of;  ///< by node; only those of leaves mean anything
};

/// Only a name for KdTree's private part.
struct kdtree::KdTree::Data : KdTreeData {};
inline kdtree::KdTree::Data& kdtree::KdTree::data() { return static_cast<Data&>(*store_); }
inline const kdtree::KdTree::Data& kdtree::KdTree::data() const {
  return static_cast<const Data&>(*store_);
}

/// Makes rope_leaves and rope_leaf_of.
void make_ropes(KdTreeData& data);

/// Chooses kernels and makes ropes where they are needed. Throws kUnsupported where the machine
/// lacks the instructions asked for.
void prepare_rays(KdTreeData& data);

}  // namespace umbel
