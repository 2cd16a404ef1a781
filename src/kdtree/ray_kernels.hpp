// The ray queries, one table of functions for each traversal and instruction set.
#pragma once

#include "kdtree/tree_data.hpp"

namespace umbel {

/// Each takes a tree with at least one node and any ray.
struct KdRayKernels {
  Hit (*intersect)(const KdTreeData& tree, const Ray& ray, const RayOptions& options);
  bool (*occluded)(const KdTreeData& tree, const Ray& ray, const RayOptions& options);
  size_t (*all_hits)(const KdTreeData& tree, const Ray& ray, std::span<Hit> hits,
                     const RayOptions& options);
};

const KdRayKernels* portable_kd_kernels(kdtree::Traversal traversal);
/// Null where they are not compiled for this processor family.
const KdRayKernels* avx2_kd_kernels(kdtree::Traversal traversal);

}  // namespace umbel
