#include "bvh/two_level/cluster_bvh.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/math.hpp"
#include "query/triangle_test.hpp"
#include "trace/vector.hpp"
#include "umbel/bvh_traverse.hpp"

namespace umbel::trace {
namespace {

Vec3 turned(const std::array<float, 12>& m, const Vec3& v) {
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
          m[8] * v.x + m[9] * v.y + m[10] * v.z};
}

std::array<float, 12> inverse_of(const std::array<float, 12>& m) {
  const double a = m[0], b = m[1], c = m[2], d = m[4], e = m[5], f = m[6], g = m[8], h = m[9],
               i = m[10];
  const double determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
  const double s = 1 / determinant;
  const double r[9] = {(e * i - f * h) * s, (c * h - b * i) * s, (b * f - c * e) * s,
                       (f * g - d * i) * s, (a * i - c * g) * s, (c * d - a * f) * s,
                       (d * h - e * g) * s, (b * g - a * h) * s, (a * e - b * d) * s};
  std::array<float, 12> out;
  for (int row = 0; row < 3; ++row) {
    for (int k = 0; k < 3; ++k) out[4 * row + k] = static_cast<float>(r[3 * row + k]);
    out[4 * row + 3] =
        static_cast<float>(-(r[3 * row] * m[3] + r[3 * row + 1] * m[7] + r[3 * row + 2] * m[11]));
  }
  return out;
}

/// Where a ray enters a box, or infinity.
class Slabs {
 public:
  explicit Slabs(const Ray& ray) : origin_(ray.origin), t_min_(ray.t_min) {
    const auto inverse = [](float d) { return 1 / (std::fabs(d) < 1e-30f ? 1e-30f : d); };
    inverse_ = {inverse(ray.direction.x), inverse(ray.direction.y), inverse(ray.direction.z)};
  }
  float entry(const Aabb& box, float t_max) const {
    const Vec3 a = (box.min - origin_) * inverse_, b = (box.max - origin_) * inverse_;
    const float enter = std::max(std::max(std::min(a.x, b.x), std::min(a.y, b.y)),
                                 std::max(std::min(a.z, b.z), t_min_));
    const float leave = std::min(std::min(std::max(a.x, b.x), std::max(a.y, b.y)),
                                 std::min(std::max(a.z, b.z), t_max));
    // Wider by more than the roundings above (Ize 2013).
    return enter <= leave * 1.000002f + 1e-30f ? enter : std::numeric_limits<float>::infinity();
  }

 private:
  Vec3 origin_, inverse_;
  float t_min_;
};

/// A ray in the space of one transform.
struct LocalRay {
  uint32_t transform = kNone;
  bool is_sound = false;
  Ray ray;
  RayFrame frame;
  std::optional<Slabs> slabs;
};

}  // namespace

InstanceTransform::InstanceTransform(const Transform& to_world)
    : to_world_(to_world.rows), to_object_(inverse_of(to_world.rows)), scale_(0) {
  float squares = 0;
  for (int i = 0; i < 12; ++i) {
    if (i % 4 != 3) squares += to_world_[i] * to_world_[i];
    if (!std::isfinite(to_object_[i]))
      throw Error(ErrorCode::kInvalidArgument, "a transform of the scene cannot be inverted");
  }
  scale_ = std::sqrt(squares);
}

Vec3 InstanceTransform::point_to_world(const Vec3& p) const {
  return turned(to_world_, p) + Vec3{to_world_[3], to_world_[7], to_world_[11]};
}
Vec3 InstanceTransform::point_to_object(const Vec3& p) const {
  return turned(to_object_, p) + Vec3{to_object_[3], to_object_[7], to_object_[11]};
}
Vec3 InstanceTransform::vector_to_object(const Vec3& v) const { return turned(to_object_, v); }

Vec3 InstanceTransform::normal_to_world(const Vec3& n) const {
  const auto& m = to_object_;
  return {m[0] * n.x + m[4] * n.y + m[8] * n.z, m[1] * n.x + m[5] * n.y + m[9] * n.z,
          m[2] * n.x + m[6] * n.y + m[10] * n.z};
}

Aabb InstanceTransform::box_to_world(const Aabb& box) const {
  Aabb out;
  for (int corner = 0; corner < 8; ++corner)
    extend(out,
           point_to_world({corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                           corner & 4 ? box.max.z : box.min.z}));
  const Vec3 slack = (max(out.max, out.min * -1.0f) - min(out.min, out.max * -1.0f)) * 1e-6f;
  return {out.min - slack, out.max + slack};
}

ClusterBvh::ClusterBvh(std::vector<TracedPart> parts, std::vector<ClusterInstance> instances,
                       std::vector<InstanceTransform> transforms,
                       const std::vector<Vec3>& positions, const std::vector<Triangle>& triangles)
    : parts_(std::move(parts)), transforms_(std::move(transforms)) {
  corners_.reserve(triangles.size());
  for (const Triangle& t : triangles)
    corners_.push_back({positions[t[0]], positions[t[1]], positions[t[2]]});
  for (const Vec3& p : positions) {
    space_.reach[0] = std::max(space_.reach[0], std::fabs(p.x));
    space_.reach[1] = std::max(space_.reach[1], std::fabs(p.y));
    space_.reach[2] = std::max(space_.reach[2], std::fabs(p.z));
  }
  camera_ = top_of(instances, kCameraRays);
  for (const ClusterInstance& at : camera_.instances)
    instanced_triangles_ += parts_[at.part].triangles.count;
  has_others_ = std::any_of(instances.begin(), instances.end(),
                            [](const ClusterInstance& at) { return at.rays != kAllRays; });
  if (has_others_) others_ = top_of(instances, kOtherRays);
}

ClusterBvh::Top ClusterBvh::top_of(const std::vector<ClusterInstance>& instances,
                                   RayKinds kind) const {
  Top top;
  std::vector<Aabb> boxes;
  for (const ClusterInstance& at : instances) {
    if (!(at.rays & kind)) continue;
    top.instances.push_back(at);
    boxes.push_back(transforms_[at.transform].box_to_world(parts_[at.part].tree.nodes[0].box()));
  }
  top.tree = bvh::build(boxes, bvh::preset("quality"));
  return top;
}

template <typename Found>
void ClusterBvh::visit(const Top& top, const Ray& ray, const RayOptions& options,
                       const Found& found) const {
  const Slabs world(ray);
  float limit = ray.t_max;
  LocalRay local;
  bvh::traverse_ordered(
      top.tree, [&](const bvh::Node& node) { return world.entry(node.box(), limit); },
      [&](std::span<const uint32_t> leaf) {
        for (const uint32_t p : leaf) {
          const ClusterInstance& at = top.instances[p];
          const TracedPart& part = parts_[at.part];
          if (!(part.mask & options.mask)) continue;
          if (local.transform != at.transform) {
            const InstanceTransform& transform = transforms_[at.transform];
            local.transform = at.transform;
            local.ray = ray;
            local.ray.origin = transform.point_to_object(ray.origin);
            local.ray.direction = transform.vector_to_object(ray.direction);
            local.is_sound = make_frame(space_, local.ray, local.frame);
            local.slabs.emplace(local.ray);
          }
          if (!local.is_sound) continue;
          bvh::traverse_ordered(
              part.tree,
              [&](const bvh::Node& node) { return local.slabs->entry(node.box(), limit); },
              [&](std::span<const uint32_t> primitives) {
                for (const uint32_t i : primitives) {
                  const uint32_t triangle = part.triangles.offset + i;
                  const auto& c = corners_[triangle];
                  const RayFrame& f = local.frame;
                  const auto axes = [&](const Vec3& v, float* out) {
                    const float all[3] = {v.x, v.y, v.z};
                    out[0] = all[f.kx], out[1] = all[f.ky], out[2] = all[f.kz];
                  };
                  FrameTriangle shape;
                  axes(c[0], shape.a), axes(c[1], shape.b), axes(c[2], shape.c);
                  TriangleHit hit;
                  if (!test_triangle(f, shape, options.cull_back_faces, hit)) continue;
                  const float t = hit.t * f.t_unit;
                  if (!(t >= ray.t_min) || !(t <= limit)) continue;
                  SceneHit best;
                  best.t = t;
                  best.primitive = triangle;
                  best.u = hit.v / hit.determinant;
                  best.v = hit.w / hit.determinant;
                  best.transform = at.transform;
                  limit = found(best) ? t : -std::numeric_limits<float>::infinity();
                }
                return limit;
              });
        }
        return limit;
      });
}

SceneHit ClusterBvh::intersect(const Ray& ray, const RayOptions& options, RayKinds kind) const {
  SceneHit best;
  visit(top_for(kind), ray, options, [&](const SceneHit& hit) {
    // Clusters that share an edge hit it at the same t; the lower one is taken whatever the order.
    if (hit.t < best.t || (hit.t == best.t && hit.primitive < best.primitive)) best = hit;
    return true;
  });
  return best;
}

bool ClusterBvh::occluded(const Ray& ray, const RayOptions& options, RayKinds kind) const {
  bool is_hit = false;
  visit(top_for(kind), ray, options, [&](const SceneHit&) {
    is_hit = true;
    return false;
  });
  return is_hit;
}

Aabb ClusterBvh::bounds() const {
  return camera_.tree.nodes.empty() ? Aabb{} : camera_.tree.nodes[0].box();
}

uint64_t ClusterBvh::bytes() const {
  const auto of_tree = [](const bvh::Bvh2& tree) {
    return tree.nodes.capacity() * sizeof(bvh::Node) + tree.primitives.capacity() * 4;
  };
  uint64_t bytes =
      corners_.capacity() * sizeof corners_[0] + transforms_.capacity() * sizeof(InstanceTransform);
  for (const Top* top : {&camera_, &others_})
    bytes += of_tree(top->tree) + top->instances.capacity() * sizeof(ClusterInstance);
  for (const TracedPart& part : parts_) bytes += sizeof part + of_tree(part.tree);
  return bytes;
}

}  // namespace umbel::trace
