// A hierarchy of two levels: a tree over the triangles of each cluster (a bottom-level structure),
// and one over all instances of clusters (the top level). Bottom trees stay with their clusters;
// the top is rebuilt when the cut changes. Rays are transformed into the space of what they meet,
// and keep their t.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "bvh/two_level/instance_transform.hpp"
#include "query/leaf_store.hpp"
#include "umbel/bvh.hpp"

namespace umbel::bvh {

struct InstanceHit : Hit {
  uint32_t transform = 0;  ///< of the instance that was hit
  /// In the order in which hits are found.
  bool precedes(const InstanceHit& other) const {
    if (t != other.t) return t < other.t;
    return primitive != other.primitive ? primitive < other.primitive : transform < other.transform;
  }
  bool operator==(const InstanceHit&) const = default;
};

/// A cluster's triangles among all, and the tree over them.
struct BottomTree {
  Range triangles;
  uint32_t mask;
  Bvh2 tree;
};

/// Kinds of rays, which may meet different instances.
inline constexpr uint32_t kPrimaryRays = 1, kSecondaryRays = 2;

struct ClusterInstance {
  uint32_t cluster, transform;
  uint32_t ray_kinds = kPrimaryRays | kSecondaryRays;
};

class TwoLevelBvh {
 public:
  /// `triangles` index `positions`, which are in the space of their cluster.
  TwoLevelBvh(std::vector<BottomTree> clusters, std::span<const ClusterInstance> instances,
              std::vector<InstanceTransform> transforms, std::span<const Vec3> positions,
              std::span<const Triangle> triangles);

  /// `ray_kind` is kPrimaryRays or kSecondaryRays.
  InstanceHit intersect(const Ray& ray, const RayOptions& options, uint32_t ray_kind) const;
  bool occluded(const Ray& ray, const RayOptions& options, uint32_t ray_kind) const;
  /// The first hit that `after`, one of the same ray, precedes. The others at its t go to `ahead`,
  /// the last one first.
  InstanceHit next(Ray ray, const InstanceHit& after, const RayOptions& options, uint32_t ray_kind,
                   std::vector<InstanceHit>& ahead) const;

  const InstanceTransform& transform(uint32_t index) const { return transforms_[index]; }
  /// Of what primary rays meet.
  Aabb bounds() const;
  uint64_t instanced_triangles() const { return instanced_triangles_; }
  uint64_t bytes() const;

 private:
  /// The instances that rays of a kind meet, and the tree over them.
  struct TopLevel {
    std::vector<ClusterInstance> instances;
    Bvh2 tree;
    LeafStore space;  ///< for make_frame: the largest coordinates
  };

  TopLevel top_level_of(std::span<const ClusterInstance> instances, uint32_t ray_kind) const;
  const TopLevel& top_level_for(uint32_t ray_kind) const {
    return ray_kind == kSecondaryRays && has_secondary_ ? secondary_ : primary_;
  }
  template <typename Found>
  void visit(const TopLevel& top, const Ray& ray, const RayOptions& options,
             const Found& found) const;
  template <typename LocalRay, typename Found>
  void visit_cluster(const ClusterInstance& instance, const LocalRay& local,
                     const RayOptions& options, float& limit, const Found& found) const;

  std::vector<BottomTree> clusters_;
  std::vector<float> scales_;  ///< of clusters: what brings their triangles into a safe range
  std::vector<InstanceTransform> transforms_;
  std::vector<std::array<Vec3, 3>> corners_;
  LeafStore space_;  ///< for make_frame: the largest coordinates of clusters
  TopLevel primary_, secondary_;
  bool has_secondary_ = false;  ///< if not, all rays meet what primary rays do
  uint64_t instanced_triangles_ = 0;
};

}  // namespace umbel::bvh
