// Selection as a library of its own: what lod.hpp's views choose, with what lies outside a frustum
// or faces away left out, for any number of instances, and within a budget. It needs a DAG's tables
// and no geometry. docs/selection.md has the arithmetic of every test to the last bit.
//
// All three ways to select give the same clusters, element by element: `select` tests every
// cluster by itself, `select_hierarchy` goes down the hierarchy with a stack, and
// `select_breadth_first` goes down it a layer of nodes at a time, as a GPU does.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "umbel/cluster.hpp"
#include "umbel/lod.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::lod {

/// Throws kCorrupt, naming the first fault, unless every index in the tables leads to what it
/// should. Tables that were built or read from a file need not be asked; selection trusts them.
UMBEL_API void validate(const Tables& tables);

using umbel::Plane;

/// What need not be drawn. Nothing here changes which level of detail is right where.
struct Culling {
  /// Clusters wholly outside one of them are left out. Normals of unit length, to within 1e-5.
  std::span<const Plane> planes;
  /// One a cluster, or none: clusters that face away from View::eye as a whole are left out. Only
  /// for cameras, and for surfaces of which only the front is seen.
  std::span<const ClusterBounds> normal_cones;
};

/// Throws kInvalidArgument for values that no view or plane can have, for `normal_cones` of another
/// length than the clusters, and for `normal_cones` where the view is no camera.
UMBEL_API std::vector<uint32_t> select(const Tables& tables, const View& view,
                                       const Culling& culling);
UMBEL_API std::vector<uint32_t> select_hierarchy(const Tables& tables, const View& view,
                                                 const Culling& culling);
UMBEL_API std::vector<uint32_t> select_breadth_first(const Tables& tables, const View& view,
                                                     const Culling& culling = {});

/// Where a picture is taken from.
struct Perspective {
  Vec3 eye{0, 0, 0};
  Vec3 target{0, 0, -1};
  Vec3 up{0, 1, 0};      ///< must not be along the line of sight
  float fov_y = 1.0f;    ///< vertical field of view in radians, (0, pi)
  float aspect = 1.0f;   ///< width / height, > 0
  float near_plane = 0;  ///< distance from the eye, >= 0
  float far_plane = std::numeric_limits<float>::infinity();  ///< > near_plane
};

/// The planes of its frustum: left, right, bottom, top, near, and far unless that is infinite.
UMBEL_API std::vector<Plane> frustum_planes(const Perspective& perspective);

/// Cones and spheres for Culling::normal_cones, from a DAG's or an asset's geometry.
UMBEL_API std::vector<ClusterBounds> normal_cone_bounds(const Tables& tables,
                                                        const GeometryReader& geometry,
                                                        const BuildOptions& options = {});

// ---- instances ----------------------------------------------------------------------------

/// An affine map from a mesh's space to the scene's: three rows of four, the last column the
/// translation. Must be finite and invertible.
struct Transform {
  std::array<float, 12> rows{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  bool operator==(const Transform&) const = default;
};

/// The view of the scene as an instance's own space has it. Where the transform stretches
/// directions differently, it asks for enough detail in all of them.
UMBEL_API View to_object(const View& view, const Transform& transform);
/// The same half-space.
UMBEL_API Plane to_object(const Plane& plane, const Transform& transform);

/// Instance i shows clusters[offsets[i] .. offsets[i + 1]).
struct InstanceCuts {
  std::vector<uint32_t> offsets;
  std::vector<uint32_t> clusters;
};

/// Each instance's cut through the hierarchy, seen with `view` and `planes` of the scene;
/// `culling.normal_cones` is as for one.
UMBEL_API InstanceCuts select_instances(const Tables& tables, const View& view,
                                        const Culling& culling,
                                        std::span<const Transform> instances);

// ---- budgets ------------------------------------------------------------------------------

/// What each cluster costs: its triangles.
UMBEL_API std::vector<uint32_t> triangle_costs(const Tables& tables);
/// Its bytes: `vertex_bytes` a vertex and `triangle_bytes` a triangle.
UMBEL_API std::vector<uint32_t> byte_costs(const Tables& tables, uint32_t vertex_bytes,
                                           uint32_t triangle_bytes = 3);

/// The finest view, by error or by camera, that is not finer than `view` and whose cut costs no
/// more than `budget`: it has the smallest error or threshold of all that fit, exactly, so the cut
/// has the smallest possible largest error, as seen from there. Clusters that are left out cost
/// nothing. Where no cut is so cheap, the view of the coarsest one. With instances it is the view
/// of the scene, and the budget is for all of them together.
UMBEL_API View view_for_budget(const Tables& tables, const View& view,
                               std::span<const uint32_t> costs, uint64_t budget,
                               const Culling& culling = {},
                               std::span<const Transform> instances = {});

// ---- units --------------------------------------------------------------------------------

/// The angle in radians under which an error is seen from a distance at which it could be turned
/// towards the eye: asin(error / distance), and pi / 2 from where the distance is not larger.
UMBEL_API double angular_error(double error, double distance);
/// The same in pixels of a picture `height` pixels high with the vertical field of view `fov_y`, at
/// its centre: error / distance * height / (2 tan(fov_y / 2)).
UMBEL_API double pixel_error(double error, double distance, double fov_y, uint32_t height);

}  // namespace umbel::lod
