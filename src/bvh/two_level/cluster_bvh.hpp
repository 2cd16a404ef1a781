// Clusters that stand in many places: a small tree for each cluster, and one over all the places.
// The small ones come with their clusters and stay; the large one is rebuilt when the cut changes.
// Rays are turned into the space of what they meet, and keep their t.
#pragma once

#include <array>
#include <vector>

#include "bvh/wide/triangle_bvh_data.hpp"
#include "umbel/bvh.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {

/// A hit, and the place of what was hit.
struct SceneHit : Hit {
  uint32_t transform = 0;
};

/// An affine map and its inverse.
class InstanceTransform {
 public:
  /// Throws kInvalidArgument if it cannot be inverted.
  explicit InstanceTransform(const Transform& to_world);

  Vec3 point_to_world(const Vec3& p) const;
  Vec3 point_to_object(const Vec3& p) const;
  Vec3 vector_to_object(const Vec3& v) const;
  /// Not of unit length.
  Vec3 normal_to_world(const Vec3& n) const;
  Aabb box_to_world(const Aabb& box) const;
  float scale() const { return scale_; }  ///< most that a length grows, or a little more

 private:
  std::array<float, 12> to_world_, to_object_;
  float scale_;
};

/// A cluster's triangles among all, and the tree over them.
struct TracedPart {
  Range triangles;
  uint32_t mask;
  bvh::Bvh2 tree;
};

class ClusterBvh {
 public:
  /// `corners(triangle)` are its three positions in the space of its part.
  ClusterBvh(std::vector<TracedPart> parts, std::vector<ClusterInstance> instances,
             std::vector<InstanceTransform> transforms, const std::vector<Vec3>& positions,
             const std::vector<Triangle>& triangles);

  /// `kind`: of RayKinds.
  SceneHit intersect(const Ray& ray, const RayOptions& options, RayKinds kind) const;
  bool occluded(const Ray& ray, const RayOptions& options, RayKinds kind) const;

  const InstanceTransform& transform(uint32_t transform) const { return transforms_[transform]; }
  Aabb bounds() const;
  uint64_t instanced_triangles() const { return instanced_triangles_; }
  uint64_t bytes() const;

 private:
  /// The places that rays of a kind meet, and the tree over them.
  struct Top {
    std::vector<ClusterInstance> instances;
    bvh::Bvh2 tree;
  };

  Top top_of(const std::vector<ClusterInstance>& instances, RayKinds kind) const;
  const Top& top_for(RayKinds kind) const {
    return kind == kOtherRays && has_others_ ? others_ : camera_;
  }
  template <typename Found>
  void visit(const Top& top, const Ray& ray, const RayOptions& options, const Found& found) const;

  std::vector<TracedPart> parts_;
  std::vector<InstanceTransform> transforms_;
  std::vector<std::array<Vec3, 3>> corners_;
  Top camera_, others_;
  bool has_others_ = false;  ///< if not, all rays meet what the camera's do
  LeafStore space_;          // for make_frame: how far coordinates reach
  uint64_t instanced_triangles_ = 0;
};

}  // namespace umbel::trace
