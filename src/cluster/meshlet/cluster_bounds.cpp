// Bounding sphere and cone of normals of each cluster. meshoptimizer finds the sphere's centre and
// the cone's axis (Ritter, "An efficient bounding sphere", 1990; Larsson, "Fast and tight fitting
// bounding spheres", 2008); it is given the cluster moved to the origin and scaled to unit size, so
// that no mesh is too large, too small or too far away. Radius, cutoff and apex are then made from
// those in double precision and rounded outwards: a cutoff from a cosine near 1 in floats would
// call flat clusters invisible that are seen at a grazing angle.
#include <meshoptimizer.h>
#include <tbb/enumerable_thread_specific.h>

#include <cmath>
#include <optional>
#include <string>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "cluster/meshlet/meshlet.hpp"

namespace umbel {
namespace {

using cluster::Meshlet;

constexpr size_t kBoundsBatch = 1 << 12;
// Wider cones than about 168 degrees cull nothing worth the test, and their apex is far away.
constexpr double kLeastCosine = 0.1;
// What a test in floats may lose in normalising two vectors and multiplying them.
constexpr double kCutoffSlack = 2e-6;

Vec3 narrow(const Vec3d& a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}
// A plane through a triangle, in the unit cluster.
struct TrianglePlane {
  Vec3d point, normal;
};

/// A cluster within [-1, 1] on every axis: (p - center) * scale.
struct Unit {
  Vec3d center{};
  double scale = 1;
  std::vector<Vec3> points;
  std::vector<unsigned> indices;
  std::vector<TrianglePlane> planes;

  Vec3d inward(const Vec3& p) const { return (to_double(p) - center) * scale; }
  Vec3d outward(const Vec3d& p) const { return p * (1 / scale) + center; }

  void load(const MeshView& mesh, const Meshlet& meshlet);
};

void Unit::load(const MeshView& mesh, const Meshlet& meshlet) {
  Aabb box;
  for (const uint32_t v : meshlet.vertices) extend(box, mesh.positions[v]);
  center = (to_double(box.min) + to_double(box.max)) * 0.5;
  const Vec3d half = (to_double(box.max) - to_double(box.min)) * 0.5;
  const double largest = std::max({half.x, half.y, half.z});
  // A power of two, so that scaling does not round.
  scale = largest > 0 ? std::exp2(-std::ceil(std::log2(largest))) : 1;
  points.clear();
  indices.clear();
  planes.clear();
  for (const uint32_t v : meshlet.vertices) points.push_back(narrow(inward(mesh.positions[v])));
  for (const auto& t : meshlet.corners) {
    const auto at = [&](int k) { return to_double(mesh.positions[meshlet.vertices[t[k]]]); };
    indices.insert(indices.end(), t.begin(), t.end());
    // Of the corners as they are: moving them to the cluster's centre may leave nothing of a
    // triangle that is tiny beside the cluster.
    const Vec3d a = at(0), normal = cross(at(1) - a, at(2) - a);
    const double size = length(normal);
    if (size > 0)
      planes.push_back({inward(mesh.positions[meshlet.vertices[t[0]]]), normal * (1 / size)});
  }
}

float radius_around(const MeshView& mesh, const Meshlet& meshlet, const Vec3& center) {
  double radius = 0;
  for (const uint32_t v : meshlet.vertices)
    radius = std::max(radius, length(to_double(mesh.positions[v]) - to_double(center)));
  // The square root and the sums before it are a few roundings in double.
  return round_up(radius * (1 + 1e-14));
}

// The sine of the largest angle between the axis and a normal; nothing if the cone is too wide.
std::optional<double> sine_of(const Unit& unit, const Vec3d& axis) {
  double sine = 0;
  for (const TrianglePlane& plane : unit.planes) {
    if (dot(plane.normal, axis) <= kLeastCosine) return std::nullopt;
    sine = std::max(sine, length(cross(plane.normal, axis)));
  }
  return sine;
}

// The first point from the centre against the axis that is behind every plane, even once it is
// rounded to the floats of the mesh.
std::optional<Vec3> apex_of(const Unit& unit, const Vec3& center, const Vec3d& axis) {
  const Vec3d from = unit.inward(center);
  const auto way_behind = [&](const Vec3d& p) {
    double way = -HUGE_VAL;
    for (const TrianglePlane& plane : unit.planes)
      way = std::max(way, dot(p - plane.point, plane.normal) / dot(axis, plane.normal));
    return way;
  };
  double way = std::max(0.0, way_behind(from)), margin = 1e-12;
  for (int tries = 0; tries < 64; ++tries, margin *= 2) {
    const Vec3 apex = narrow(unit.outward(from - axis * (way + margin)));
    if (!is_finite(apex)) return std::nullopt;
    if (way_behind(unit.inward(apex)) <= 0) return apex;
  }
  return std::nullopt;
}

ClusterBounds bounds_of(const MeshView& mesh, const Meshlet& meshlet, Unit& unit) {
  unit.load(mesh, meshlet);
  const float* points = &unit.points[0].x;
  const meshopt_Bounds found = meshopt_computeClusterBounds(
      unit.indices.data(), unit.indices.size(), points, unit.points.size(), sizeof(Vec3));
  const meshopt_Bounds ball =
      meshopt_computeSphereBounds(points, unit.points.size(), sizeof(Vec3), nullptr, 0);
  ClusterBounds bounds{};
  bounds.cone_cutoff = 1;
  bounds.sphere.center = narrow(unit.outward({ball.center[0], ball.center[1], ball.center[2]}));
  bounds.sphere.radius = radius_around(mesh, meshlet, bounds.sphere.center);
  bounds.cone_apex = bounds.sphere.center;
  const Vec3 axis{found.cone_axis[0], found.cone_axis[1], found.cone_axis[2]};
  const double size = length(to_double(axis));
  if (unit.planes.empty() || !(size > 0.5)) return bounds;
  const Vec3d unit_axis = to_double(axis) * (1 / size);
  const std::optional<double> sine = sine_of(unit, unit_axis);
  if (!sine) return bounds;
  const std::optional<Vec3> apex = apex_of(unit, bounds.sphere.center, unit_axis);
  if (!apex) return bounds;
  bounds.cone_apex = *apex;
  bounds.cone_axis = axis;
  bounds.cone_cutoff = round_up(*sine + kCutoffSlack);
  return bounds;
}

void check_positions(const MeshView& mesh, const Meshlet& meshlet) {
  for (const uint32_t v : meshlet.vertices)
    if (!is_finite(mesh.positions[v]))
      throw Error(ErrorCode::kInvalidMesh,
                  "the position of vertex " + std::to_string(v) + " is NaN or infinite");
}

}  // namespace

std::vector<ClusterBounds> cluster_bounds(const MeshView& mesh, const Clusters& clusters,
                                          const BuildOptions& options) {
  cluster::validate_clusters(mesh, clusters);
  const size_t count = clusters.ranges.size();
  Progress progress(options);
  std::vector<ClusterBounds> bounds(count);
  struct Scratch {
    Meshlet meshlet;
    Unit unit;
  };
  tbb::enumerable_thread_specific<Scratch> scratch;
  for (size_t begin = 0; begin < count; begin += kBoundsBatch) {
    progress.report(double(begin) / double(count), "bounding clusters");
    with_threads(options.threads, [&] {
      parallel_for(std::min(kBoundsBatch, count - begin), 16, [&](size_t i) {
        Scratch& s = scratch.local();
        s.meshlet.load(mesh, clusters, begin + i);
        check_positions(mesh, s.meshlet);
        bounds[begin + i] = bounds_of(mesh, s.meshlet, s.unit);
      });
    });
  }
  progress.report(1, "bounding clusters");
  return bounds;
}

}  // namespace umbel
