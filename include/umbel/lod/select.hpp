// Selecting what to draw: the cut that a view asks for, without what lies outside a frustum or
// faces away, for one mesh or many instances, within a budget. It needs a DAG's tables and no
// geometry. docs/selection.md specifies the arithmetic of every test to the last bit.
//
//   const View view = lod::view_camera(eye, fov_y, height, 1.0f);  // errors of a pixel
//   const auto planes = lod::frustum_planes(camera, width / height);
//   const auto cut = lod::select_hierarchy(dag.tables, view, {planes, {}});
//
// Three functions select, and give the same clusters in the same order: `select` tests every
// cluster by itself, `select_hierarchy` descends the hierarchy with a stack, and
// `select_breadth_first` descends it a layer of nodes at a time, as a GPU does. They trust the
// tables: call validate (lod/verify.hpp) for tables of unknown origin.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "umbel/camera.hpp"
#include "umbel/cluster.hpp"
#include "umbel/lod/types.hpp"
#include "umbel/triangle_queries.hpp"
#include "umbel/types.hpp"

namespace umbel::lod {

// ---- views --------------------------------------------------------------------------------

/// Decides whether a group must be refined. Made by one of the functions below.
struct View {
  enum class Kind : uint32_t { kError, kCamera, kLevel } kind = Kind::kError;
  float error = 0;      ///< kError: refine where group error > this
  Vec3 eye{0, 0, 0};    ///< kCamera: refine where error > threshold * max(distance, 0), with
  float threshold = 0;  ///<   distance from the eye to the group's sphere (negative inside)
  uint32_t level = 0;   ///< kLevel: refine where group level >= this, and roots
};
UMBEL_API View view_error(float error);
/// `pixel_error` pixels of a picture `height` pixels high with the vertical field of view
/// `fov_y` in radians, seen from `eye`.
UMBEL_API View view_camera(const Vec3& eye, float fov_y, uint32_t height, float pixel_error);
/// The same from a point of the world, of what is relative to `origin` (AssetInfo::origin).
inline View view_camera(const Vec3d& eye, const Vec3d& origin, float fov_y, uint32_t height,
                        float pixel_error) {
  return view_camera(relative_to(origin, eye), fov_y, height, pixel_error);
}
UMBEL_API View view_level(uint32_t level);

/// The test of one group: 32-bit floats in the order of src/lod/select/refine.hpp.
UMBEL_API bool must_refine(const Group& group, const View& view);

// ---- cuts ---------------------------------------------------------------------------------

using umbel::Plane;

/// What need not be drawn. Nothing here changes which level of detail is right where.
struct Culling {
  /// Clusters wholly outside one of them are left out. Normals of unit length, to within 1e-5.
  std::span<const Plane> planes;
  /// One a cluster, or none: clusters that face away from View::eye as a whole are left out. Only
  /// for cameras, and for surfaces that are seen from the front only.
  std::span<const ClusterBounds> normal_cones;
};

/// The clusters of the cut, ascending, by testing every cluster. Throws kInvalidArgument for a view
/// or planes out of range, for `normal_cones` of another length than the clusters, and for
/// `normal_cones` where the view is no camera.
UMBEL_API std::vector<uint32_t> select(const Tables& tables, const View& view);
UMBEL_API std::vector<uint32_t> select(const Tables& tables, const View& view,
                                       const Culling& culling);
/// The same cut through the hierarchy, visiting only nodes that must be refined.
UMBEL_API std::vector<uint32_t> select_hierarchy(const Tables& tables, const View& view);
UMBEL_API std::vector<uint32_t> select_hierarchy(const Tables& tables, const View& view,
                                                 const Culling& culling);
UMBEL_API std::vector<uint32_t> select_breadth_first(const Tables& tables, const View& view,
                                                     const Culling& culling = {});

/// The largest error of the groups that a cut stands for (0 for level 0 alone).
UMBEL_API float cut_error(const Tables& tables, std::span<const uint32_t> cut);

/// The planes of a camera's frustum: left, right, bottom, top, near, and far unless that is
/// infinite. `aspect` is width / height; planes are at distances 0 <= near_plane < far_plane.
/// Throws kInvalidArgument for values out of range, and for an `up` along the line of sight.
UMBEL_API std::vector<Plane> frustum_planes(
    const Camera& camera, float aspect = 1.0f, float near_plane = 0,
    float far_plane = std::numeric_limits<float>::infinity());

/// Cones and spheres for Culling::normal_cones, from a DAG's or an asset's geometry.
UMBEL_API std::vector<ClusterBounds> normal_cone_bounds(const Tables& tables,
                                                        const GeometryReader& geometry,
                                                        const BuildOptions& options = {});

// ---- instances ----------------------------------------------------------------------------

/// The view of the scene in an instance's own space. If the transform scales directions
/// differently, the result asks for enough detail in all of them. Throws kInvalidArgument where the
/// transform is not finite or, for a camera, not invertible.
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

/// The smallest error whose cut has at most so many triangles (the coarsest cut's error where none
/// has so few).
UMBEL_API float error_for_triangles(const Tables& tables, uint64_t max_triangles);

/// What each cluster costs: its triangles. (For a budget of clusters or groups each costs 1.)
UMBEL_API std::vector<uint32_t> triangle_costs(const Tables& tables);
/// Its bytes: `vertex_bytes` a vertex and `triangle_bytes` a triangle.
UMBEL_API std::vector<uint32_t> byte_costs(const Tables& tables, uint32_t vertex_bytes,
                                           uint32_t triangle_bytes = 3);

/// What a budget counts. Clusters that are left out cost nothing.
struct Costs {
  std::span<const uint32_t> clusters;  ///< one a cluster, or empty: they cost nothing
  /// One a group, for drawing any of its clusters; or empty.
  std::span<const uint32_t> groups = {};
  Costs() = default;
  // What clusters cost may be given alone.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Costs(std::span<const uint32_t> of_clusters, std::span<const uint32_t> of_groups = {})
      : clusters(of_clusters), groups(of_groups) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  Costs(const std::vector<uint32_t>& of_clusters) : clusters(of_clusters) {}
};

/// The finest view, by error or by camera, that is not finer than `view` and whose cut costs no
/// more than `budget`: it has the smallest error or threshold of all that fit, exactly, so the cut
/// has the smallest possible largest error, as seen from there. Where no cut is so cheap, the view
/// of the coarsest one. With instances it is the view of the scene, and the budget is for all of
/// them together.
UMBEL_API View view_for_budget(const Tables& tables, const View& view, const Costs& costs,
                               uint64_t budget, const Culling& culling = {},
                               std::span<const Transform> instances = {});

struct BudgetCuts {
  InstanceCuts cuts;  ///< one an instance; of the mesh alone without any
  View view;          ///< of view_for_budget, or an infinite error where that costs too much
  uint64_t cost = 0;  ///< over the budget only where no cut is within it
};

/// The cut of view_for_budget, and then, as that leaves unused what the next group would take too
/// much of, the groups that still fit are refined one by one, always the one that `view` finds the
/// farthest from good enough. Cuts as this gives them are surfaces without holes like all others,
/// but no view selects them. Deterministic.
UMBEL_API BudgetCuts select_for_budget(const Tables& tables, const View& view, const Costs& costs,
                                       uint64_t budget, const Culling& culling = {},
                                       std::span<const Transform> instances = {});

// ---- units --------------------------------------------------------------------------------

/// The angle in radians under which an error is seen from a distance at which it could be turned
/// towards the eye: asin(error / distance), and pi / 2 from where the distance is not larger.
UMBEL_API double angular_error(double error, double distance);
/// The same in pixels of a picture `height` pixels high with the vertical field of view `fov_y`, at
/// its centre: error / distance * height / (2 tan(fov_y / 2)).
UMBEL_API double pixel_error(double error, double distance, double fov_y, uint32_t height);

}  // namespace umbel::lod
