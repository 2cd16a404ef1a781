// What every structure over triangles answers: rays, distances and overlaps.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "umbel/types.hpp"

namespace umbel {

/// Points origin + t * direction for t_min <= t <= t_max. The direction need not have unit length.
struct Ray {
  Vec3 origin{};
  float t_min = 0.0f;
  Vec3 direction{};
  float t_max = std::numeric_limits<float>::infinity();
};

/// Where a ray meets triangle `primitive`, at (1 - u - v) p0 + u p1 + v p2.
struct Hit {
  float t = std::numeric_limits<float>::infinity();
  uint32_t primitive = kNone;  ///< kNone where nothing was hit
  float u = 0.0f, v = 0.0f;
  bool hit() const { return primitive != kNone; }
  bool operator==(const Hit&) const = default;
};

struct RayOptions {
  uint32_t mask = 0xffffffffu;   ///< sees triangles whose mask shares a bit with this
  bool cull_back_faces = false;  ///< pass through triangles whose corners run clockwise
};

/// The point of the surface that is nearest to a query point.
struct ClosestPoint {
  Vec3 point{};
  float distance = std::numeric_limits<float>::infinity();
  uint32_t primitive = kNone;  ///< kNone where nothing lies within the distance asked for
  float u = 0.0f, v = 0.0f;    ///< as in Hit
};

/// The points with dot(normal, p) + offset >= 0 for every plane.
struct Plane {
  Vec3 normal;
  float offset;
};
using Frustum = std::array<Plane, 6>;

/// Which instructions the queries use. Results are the same for all, bit by bit.
enum class Simd : uint32_t { kAuto, kPortable, kAvx2, kAvx512 };

struct LeafStore;

/// The base of Bvh, kdtree::KdTree and the structures of uniform.hpp: the same queries, and
/// the same results bit by bit (but for overlaps of a frustum). Queries may run at the same time
/// from any number of threads.
class UMBEL_API TriangleQueries {
 public:
  virtual ~TriangleQueries();
  TriangleQueries(const TriangleQueries&) = delete;
  TriangleQueries& operator=(const TriangleQueries&) = delete;

  // Rays. A ray with a NaN, a zero direction or an empty interval hits nothing, and none hits what
  // lies at a t that is too large for a float: every hit has a finite t. Watertight (Woop
  // et al. 2013): no ray through an edge or a vertex that triangles share passes between them, for
  // coordinates from 1e-15 to 1e15. Of hits at the same t the lowest primitive is reported.
  Hit intersect(const Ray& ray, const RayOptions& options = {}) const;
  bool occluded(const Ray& ray, const RayOptions& options = {}) const;
  /// The nearest hits.size() hits in the order of (t, primitive); each triangle at most once.
  /// Returns how many were written.
  size_t all_hits(const Ray& ray, std::span<Hit> hits, const RayOptions& options = {}) const;

  // Batches, in parallel (threads: 0 means all cores). Both spans have the same length.
  void intersect(std::span<const Ray> rays, std::span<Hit> hits, const RayOptions& options = {},
                 uint32_t threads = 0) const;
  void occluded(std::span<const Ray> rays, std::span<uint8_t> results,
                const RayOptions& options = {}, uint32_t threads = 0) const;

  // Distances. Points with a NaN find nothing.
  ClosestPoint closest_point(const Vec3& point,
                             float max_distance = std::numeric_limits<float>::infinity()) const;
  void closest_point(std::span<const Vec3> points, std::span<ClosestPoint> results,
                     float max_distance = std::numeric_limits<float>::infinity(),
                     uint32_t threads = 0) const;
  /// Inside a closed mesh, by the winding number's parity; for other meshes the answer is
  /// deterministic but means nothing.
  bool contains(const Vec3& point) const;
  void contains(std::span<const Vec3> points, std::span<uint8_t> results,
                uint32_t threads = 0) const;
  /// Distance to the surface, negative inside.
  float signed_distance(const Vec3& point) const;
  void signed_distance(std::span<const Vec3> points, std::span<float> results,
                       uint32_t threads = 0) const;

  // Overlaps: the triangles that touch a region (exact for the box, in double precision for the
  // sphere; for the frustum separating planes alone, so a few near its edges may be too many),
  // sorted, each once.
  std::vector<uint32_t> overlaps(const Aabb& box) const;
  std::vector<uint32_t> overlaps(const Sphere& sphere) const;
  std::vector<uint32_t> overlaps(const Frustum& frustum) const;

  Aabb bounds() const;
  uint32_t triangle_count() const;  ///< of the mesh, dropped ones included

 protected:
  explicit TriangleQueries(std::unique_ptr<LeafStore> store);
  void swap(TriangleQueries& other) noexcept { store_.swap(other.store_); }

  std::unique_ptr<LeafStore> store_;
};

}  // namespace umbel
