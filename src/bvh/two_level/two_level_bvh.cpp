#include "bvh/two_level/two_level_bvh.hpp"

#include <algorithm>
#include <cmath>

#include "base/math.hpp"
#include "bvh/tree/scale.hpp"
#include "query/triangle_test.hpp"
#include "umbel/bvh_traverse.hpp"

namespace umbel::bvh {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

void grow_space(LeafStore& space, const Vec3& p) {
  for (uint32_t axis = 0; axis < 3; ++axis)
    space.max_abs_coord[axis] = std::max(space.max_abs_coord[axis], std::fabs(component(p, axis)));
}

/// A ray in one space, ready for tests.
struct FramedRay {
  uint32_t transform = kNone;
  bool is_sound = false;  ///< if not, it hits nothing
  RayFrame frame;
  float inverse_unit = 1;

  void set(const LeafStore& space, const Ray& ray) {
    is_sound = make_frame(space, ray, frame);
    if (is_sound) inverse_unit = 1 / frame.t_unit;
  }
  /// Where it enters a box by its own t, or infinity.
  float entry(const Aabb& box, float limit) const {
    return box_entry(frame, box, limit * inverse_unit) * frame.t_unit;
  }
};

FrameTriangle along_axes(const RayFrame& frame, const std::array<Vec3, 3>& corners) {
  const auto axes = [&](const Vec3& v, float* out) {
    out[0] = component(v, frame.kx), out[1] = component(v, frame.ky),
    out[2] = component(v, frame.kz);
  };
  FrameTriangle triangle;
  axes(corners[0], triangle.a), axes(corners[1], triangle.b), axes(corners[2], triangle.c);
  return triangle;
}

}  // namespace

TwoLevelBvh::TwoLevelBvh(std::vector<BottomTree> clusters,
                         std::span<const ClusterInstance> instances,
                         std::vector<InstanceTransform> transforms, std::span<const Vec3> positions,
                         std::span<const Triangle> triangles)
    : clusters_(std::move(clusters)), transforms_(std::move(transforms)) {
  for (const BottomTree& cluster : clusters_)
    scales_.push_back(cluster.tree.nodes.empty() ? 1 : moderate_scale(cluster.tree.nodes[0].box()));
  corners_.reserve(triangles.size());
  for (const Triangle& t : triangles)
    corners_.push_back({positions[t[0]], positions[t[1]], positions[t[2]]});
  for (const Vec3& p : positions) grow_space(space_, p);
  primary_ = top_level_of(instances, kPrimaryRays);
  for (const ClusterInstance& instance : primary_.instances)
    instanced_triangles_ += clusters_[instance.cluster].triangles.count;
  has_secondary_ =
      std::any_of(instances.begin(), instances.end(), [](const ClusterInstance& instance) {
        return instance.ray_kinds != (kPrimaryRays | kSecondaryRays);
      });
  if (has_secondary_) secondary_ = top_level_of(instances, kSecondaryRays);
}

TwoLevelBvh::TopLevel TwoLevelBvh::top_level_of(std::span<const ClusterInstance> instances,
                                                uint32_t ray_kind) const {
  TopLevel top;
  std::vector<Aabb> boxes;
  for (const ClusterInstance& instance : instances) {
    if (!(instance.ray_kinds & ray_kind)) continue;
    top.instances.push_back(instance);
    boxes.push_back(transforms_[instance.transform].box_to_world(
        clusters_[instance.cluster].tree.nodes[0].box()));
    grow_space(top.space, boxes.back().min);
    grow_space(top.space, boxes.back().max);
  }
  top.tree = build(boxes, preset("quality"));
  return top;
}

template <typename Found>
void TwoLevelBvh::visit(const TopLevel& top, const Ray& ray, const RayOptions& options,
                        const Found& found) const {
  FramedRay world, local;
  world.set(top.space, ray);
  if (!world.is_sound) return;
  float limit = std::min(ray.t_max, std::numeric_limits<float>::max());
  traverse_ordered(
      top.tree, [&](const Node& node) { return world.entry(node.box(), limit); },
      [&](std::span<const uint32_t> leaf) {
        for (const uint32_t i : leaf) {
          const ClusterInstance& instance = top.instances[i];
          if (!(clusters_[instance.cluster].mask & options.mask)) continue;
          if (local.transform != instance.transform) {
            const InstanceTransform& transform = transforms_[instance.transform];
            Ray transformed = ray;
            transformed.origin = transform.point_to_object(ray.origin);
            transformed.direction = transform.vector_to_object(ray.direction);
            local.transform = instance.transform;
            local.set(space_, transformed);
          }
          if (!local.is_sound) continue;
          local.frame.scale = scales_[instance.cluster];
          local.frame.unscale = 1 / local.frame.scale;
          visit_cluster(instance, local, options, limit, found);
        }
        return limit;
      });
}

template <typename LocalRay, typename Found>
void TwoLevelBvh::visit_cluster(const ClusterInstance& instance, const LocalRay& local,
                                const RayOptions& options, float& limit, const Found& found) const {
  const BottomTree& cluster = clusters_[instance.cluster];
  const RayFrame& frame = local.frame;
  traverse_ordered(
      cluster.tree, [&](const Node& node) { return local.entry(node.box(), limit); },
      [&](std::span<const uint32_t> primitives) {
        for (const uint32_t i : primitives) {
          const uint32_t triangle = cluster.triangles.offset + i;
          TriangleHit hit;
          if (!test_triangle(frame, along_axes(frame, corners_[triangle]), options.cull_back_faces,
                             hit))
            continue;
          const float t = hit.t * frame.t_unit;
          if (!(hit.t >= frame.t_min) || !(t <= limit)) continue;
          InstanceHit best;
          best.t = t;
          best.primitive = triangle;
          best.u = hit.v / hit.determinant;
          best.v = hit.w / hit.determinant;
          best.transform = instance.transform;
          limit = found(best, limit);
        }
        return limit;
      });
}

InstanceHit TwoLevelBvh::intersect(const Ray& ray, const RayOptions& options,
                                   uint32_t ray_kind) const {
  InstanceHit best;
  visit(top_level_for(ray_kind), ray, options, [&](const InstanceHit& hit, float) {
    // Clusters that share an edge hit it at the same t; the first one is taken whatever the order.
    if (hit.precedes(best)) best = hit;
    return hit.t;
  });
  return best;
}

InstanceHit TwoLevelBvh::next(Ray ray, const InstanceHit& after, const RayOptions& options,
                              uint32_t ray_kind, std::vector<InstanceHit>& ahead) const {
  InstanceHit best;
  ray.t_min = after.t;
  ahead.clear();
  visit(top_level_for(ray_kind), ray, options, [&](InstanceHit hit, float limit) {
    if (!after.precedes(hit)) return limit;
    if (hit.t < best.t) ahead.clear();
    if (hit.precedes(best)) std::swap(hit, best);
    if (hit.t == best.t) ahead.push_back(hit);
    return best.t;
  });
  std::ranges::sort(ahead,
                    [](const InstanceHit& a, const InstanceHit& b) { return b.precedes(a); });
  // An instance that is given twice is hit once.
  ahead.erase(std::unique(ahead.begin(), ahead.end()), ahead.end());
  if (!ahead.empty() && ahead.back() == best) ahead.pop_back();
  return best;
}

bool TwoLevelBvh::occluded(const Ray& ray, const RayOptions& options, uint32_t ray_kind) const {
  bool is_hit = false;
  visit(top_level_for(ray_kind), ray, options, [&](const InstanceHit&, float) {
    is_hit = true;
    return -kInfinity;
  });
  return is_hit;
}

Aabb TwoLevelBvh::bounds() const {
  return primary_.tree.nodes.empty() ? Aabb{} : primary_.tree.nodes[0].box();
}

uint64_t TwoLevelBvh::bytes() const {
  const auto of_tree = [](const Bvh2& tree) {
    return tree.nodes.capacity() * sizeof(Node) + tree.primitives.capacity() * 4;
  };
  uint64_t bytes =
      corners_.capacity() * sizeof corners_[0] + transforms_.capacity() * sizeof(InstanceTransform);
  for (const TopLevel* top : {&primary_, &secondary_})
    bytes += of_tree(top->tree) + top->instances.capacity() * sizeof(ClusterInstance);
  for (const BottomTree& cluster : clusters_)
    bytes += sizeof cluster + sizeof scales_[0] + of_tree(cluster.tree);
  return bytes;
}

}  // namespace umbel::bvh
