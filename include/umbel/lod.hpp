// Continuous level of detail: a mesh as a DAG of clusters from which any cut is one surface.
//
// Level 0 is the mesh itself, cut into clusters. Groups of 24 to 32 neighbouring clusters are
// simplified to half, with what they share with other groups held fixed, and the result is cut
// into the clusters of the next level, until one group is left (Karis, "Nanite: A Deep Dive",
// 2021). A cluster belongs to one group, `group`, and was made by simplifying another,
// `generating_group` (none at level 0).
//
// Whether a group must be refined is a test of that group alone: is its error, that of its
// *simplified* form, too large as seen from here? A cluster is in the cut if its group must be
// refined and its generating group need not be. Errors and spheres never shrink from a
// generating group to the groups of what it generated, so the tests agree with each other and
// the cut has no hole and no overlap.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel::lod {

struct Cluster {
  uint32_t group;             ///< the group it belongs to
  uint32_t generating_group;  ///< the group whose simplification made it; kNone at level 0
  uint32_t material;          ///< of all its triangles; of most, where clusters mix materials
  uint32_t vertex_count;      ///< <= 256, unique vertices
  uint32_t triangle_count;    ///< >= 1
  Aabb box;                   ///< of its triangles
  bool operator==(const Cluster&) const = default;
};

/// How a group was simplified, in the order of the fallback chain.
enum class SimplifyMethod : uint32_t {
  kRegular = 0,     ///< edge collapse that keeps the topology, and seams by their rules
  kPermissive = 1,  ///< edge collapse across any seam, repaired where it left non-manifold edges
  kPrune = 2,       ///< small connected components removed as well
  kSloppy = 3,      ///< vertices merged by grid cell, manifold patches removed or capped, or
                    ///< many small components enlarged to keep their area; error amplified
  kRoot = 4,        ///< not simplified: nothing coarser exists
};

/// Why a group was not simplified to 70 % by the first method alone, or is a root: what kept most
/// of its vertices from moving.
enum class LimitingFactor : uint32_t {
  kNone = 0,             ///< the first method was enough
  kCaller = 1,           ///< the caller's decimation did it
  kSmallComponents = 2,  ///< components smaller than the error were kept at the cost of larger ones
  kLocked = 3,           ///< other groups share them
  kNonManifold = 4,      ///< non-manifold vertices: three triangles at an edge, fans that touch
  kSeams = 5,            ///< rules of seams and creases, borders between materials
  kTopology = 6,         ///< any move would make the surface non-manifold, or close a hole
  kFlip = 7,             ///< any move would flip a triangle
  kCost = 8,             ///< any move costs several times as much as those before
  kCoarsest = 9,         ///< a root: no more than one cluster's worth of triangles was left
  kStopped = 10,         ///< a root: the configuration said where to stop
  kStuck = 11,           ///< a root: nothing could be simplified any more
  kAreaLost = 12,  ///< many small components lost over a tenth of their area: they were enlarged
};
inline constexpr size_t kLimitingFactors = 13;

struct Group {
  Range clusters;  ///< of Tables::clusters; a group's clusters are consecutive
  uint32_t level;  ///< 0 is the finest
  SimplifyMethod method;
  Sphere sphere;  ///< contains its triangles and the spheres of its generating groups
  float error;    ///< object-space error once simplified, >= its generating groups'; infinite
                  ///< exactly for root groups
  bool operator==(const Group&) const = default;
};

/// A node of the selection hierarchy: its sphere contains and its error bounds everything below.
struct Node {
  Sphere sphere;
  float error;
  uint32_t group;  ///< a leaf's group; kNone for an inner node
  Range children;  ///< of Tables::nodes; empty for a leaf
  bool operator==(const Node&) const = default;
};

/// All that selection needs, without any geometry.
struct Tables {
  std::vector<Range> levels;  ///< of `groups`, finest first
  std::vector<Group> groups;
  std::vector<Cluster> clusters;
  std::vector<Node> nodes;  ///< nodes[0] is the root; one tree over the levels' trees
};

/// Triangles and vertices of one cluster, wherever they are stored. Triangles are triples of
/// indices into the cluster's own vertices.
struct ClusterGeometry {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;  ///< this and the following: empty where the mesh has none
  std::vector<Vec4> tangents;
  std::vector<Vec2> uvs;
  std::vector<Vec4> colors;
  std::vector<uint8_t> triangles;  ///< 3 a triangle
  /// As a mesh has them. Where clusters mix materials, a triangle's is its first vertex's
  /// ExtraKind::kMaterial (all of its vertices have the same), and mesh_of_cut gives it to it.
  std::vector<Extra> extras;
  std::vector<float> extra_values;
};

/// How firmly lines are held along which vertices at one position have different attributes.
enum class SeamRule : uint8_t {
  kProtect = 0,  ///< they shorten along themselves only, until nothing else is left to simplify
  kAllow = 1,    ///< what it costs the attributes to cross them counts as error
  kIgnore = 2,   ///< crossing costs nothing
};

struct Config {
  uint32_t max_triangles = 128;             ///< a cluster, 4..256
  uint32_t max_vertices = 128;              ///< a cluster, 6..256
  uint32_t min_group = 24, max_group = 32;  ///< clusters in a group, 2 <= min <= max
  float ratio = 0.5f;                       ///< triangles kept a level, [0.1, 0.9]
  /// Positions are first moved to multiples of this power of two, and what they move by is added
  /// to every group's error; 0: they stay as they are.
  float position_step = 0;
  bool attributes = true;  ///< weigh attributes in the error, keep seams
  /// A difference of 1 counts as a surface that is off by this part of the root of the area that
  /// has it.
  float normal_weight = 0.5f, uv_weight = 0.5f, color_weight = 0.5f;
  float tangent_weight = 0.25f;  ///< the tangent's direction
  float skin_weight = 0.5f;      ///< how much a joint moves a vertex, each joint for itself
  /// Where many small connected components (leaves, rubble) shrink or are removed, those that are
  /// left are enlarged until they cover as much area as before.
  bool keep_area = true;
  /// Clusters may mix materials, kept triangle by triangle; borders between materials are held all
  /// the same. Where a mesh has many small components of different materials, clusters are fuller.
  bool mix_materials = false;
  /// Seams are where texture coordinates, colours, weights of joints or the handedness of tangents
  /// (mirrored texture coordinates) differ, creases where only normals or tangents do. Where
  /// both do, the firmer rule holds. Borders between materials are always kept.
  SeamRule seams = SeamRule::kAllow, creases = SeamRule::kAllow;
  /// Vertices that stay take the attributes that fit best to all that they stand for, instead of
  /// their own, where they are alone at their position.
  bool refit_attributes = true;
  /// When to stop before one cluster's worth of triangles is left; what is left then are the roots.
  uint32_t max_levels = 0;      ///< most levels, 0: no limit
  uint64_t stop_triangles = 0;  ///< stop as soon as no more than these are left
  float max_error = std::numeric_limits<float>::infinity();  ///< no group gets a larger error
  /// Errors are distances to the source, sampled in both directions through hierarchies over both
  /// surfaces (docs/lod.md), instead of sums of what each step moved. Slower, and closer.
  bool measured_error = false;
};

struct Report {
  uint64_t input_triangles = 0, input_vertices = 0;
  uint64_t degenerate_triangles = 0;           ///< kept in level 0, left out of all coarser levels
  uint32_t root_groups = 0, stuck_groups = 0;  ///< stuck: all roots, if more than one cluster's
                                               ///< worth of triangles is left in them
  uint64_t root_triangles = 0;
  std::array<uint64_t, 5> groups_by_method{};
  /// The same, [method][limiting_factor]; and how often groups waited for the next round, by
  /// limiting factor.
  std::array<std::array<uint64_t, kLimitingFactors>, 5> groups_by_limiting_factor{};
  std::array<uint64_t, kLimitingFactors> waits_by_limiting_factor{};
  /// With Config::measured_error, over all groups that have a distance to the source: the mean of
  /// log2(estimate / measured distance), and how many were underestimated.
  double mean_log2_overestimate = 0;
  uint64_t measured_groups = 0, underestimated_groups = 0;
  float largest_move = 0;  ///< the farthest that Config::position_step moved a vertex
  double seconds = 0;
};

struct Dag {
  Tables tables;
  std::vector<LimitingFactor> limiting_factors;  ///< one a group
  Mesh vertices;                           ///< welded input; `triangles` and `materials` are empty
  std::vector<uint32_t> vertex_offsets;    ///< clusters + 1, into cluster_vertices
  std::vector<uint32_t> triangle_offsets;  ///< clusters + 1, in triangles
  std::vector<uint32_t> cluster_vertices;  ///< index into `vertices`
  std::vector<uint8_t> cluster_triangles;  ///< 3 a triangle: index into the cluster's vertices
  uint64_t source_digest = 0;              ///< triangle_set_digest of the input
  Config config;
  Report report;

  UMBEL_API ClusterGeometry geometry(uint32_t cluster) const;
};

/// A group as a decimation of the caller's own gets it.
struct DecimationInput {
  /// The group's vertices, numbered from 0, and its triangles; `materials` is one a triangle or
  /// empty. Several vertices may be at one position, as along seams.
  MeshView mesh;
  /// One a vertex: 1 where another group has the vertex's position too. Such positions must stay,
  /// and so must every edge between two of them that is the border of the group.
  std::span<const uint8_t> locked;
  size_t target;  ///< triangles that should be left
};

struct DecimationResult {
  /// Of the input's vertices and, from their number on, of `added`.
  std::vector<Triangle> triangles;
  /// New vertices: positions, and every other stream that the input has. No triangles.
  Mesh added;
  /// One an added vertex; empty where all of the group is of one material.
  std::vector<uint32_t> added_materials;
  float error = 0;  ///< how far the surface moved at most, in the mesh's unit
};

/// Simplifies one group. Returns false to leave it to the library, which also takes over where the
/// result has more than 85 % of the triangles, mixes materials in a triangle, or does not have the
/// group's border. Called by several threads at once unless BuildOptions::threads is 1. The DAG is
/// deterministic if this is. Throws what it likes: it ends the build.
using Decimator = std::function<bool(const DecimationInput& input, DecimationResult& result)>;

/// Builds the DAG of a valid mesh, which is welded first. Deterministic. Throws kInvalidMesh for a
/// coordinate beyond 1e18, kInvalidArgument where `decimate` gives what no mesh can have.
UMBEL_API Dag build(const MeshView& mesh, const Config& config = {},
                    const BuildOptions& options = {}, const Decimator& decimate = {});

// ---- selection ----------------------------------------------------------------------------

/// What decides whether a group must be refined. Use one of the makers below.
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

/// The test of one group. All arithmetic is in 32-bit floats in the order written in select.cpp.
UMBEL_API bool must_refine(const Group& group, const View& view);

/// The clusters of the cut, ascending, by testing every cluster.
UMBEL_API std::vector<uint32_t> select(const Tables& tables, const View& view);
/// The same cut through the hierarchy, without visiting what is fine or coarse enough.
UMBEL_API std::vector<uint32_t> select_hierarchy(const Tables& tables, const View& view);
/// The smallest error whose cut has at most this many triangles (the coarsest cut's error where
/// none has so few).
UMBEL_API float error_for_triangles(const Tables& tables, uint64_t max_triangles);
/// The largest error of the groups that a cut stands for (0 for level 0 alone).
UMBEL_API float cut_error(const Tables& tables, std::span<const uint32_t> cut);

/// One cut as an ordinary mesh: vertices of different clusters that are equal become one.
using GeometryReader = std::function<ClusterGeometry(uint32_t cluster)>;
UMBEL_API Mesh mesh_of_cut(const Tables& tables, const GeometryReader& geometry,
                           std::span<const uint32_t> cut);

// ---- proof --------------------------------------------------------------------------------

struct VerifyConfig {
  uint32_t cuts = 64;  ///< random cuts: half by error, half by camera from inside and outside
  uint32_t seed = 1;
  uint32_t max_triangles = 256, max_vertices = 256;  ///< limits that the asset claims
  uint64_t source_triangles = 0, source_digest = 0;  ///< of the mesh that it was built from
};

struct VerifyReport {
  bool ok = true;
  uint32_t cuts = 0;
  uint64_t cracks = 0;    ///< edges of a cut, or of a group's border, that are open and not allowed
  uint64_t overlaps = 0;  ///< edges of a cut with more triangles than the input allows
  uint64_t limit_violations = 0;      ///< clusters over a limit, indices out of range, bad links
  bool monotone = true;               ///< errors and spheres never shrink towards the root
  uint64_t checksum_errors = 0;       ///< filled in by asset::verify
  std::vector<std::string> problems;  ///< a sentence each, the first 32
};

/// Checks the tables, the size limits, that errors and spheres are monotone, that level 0 is the
/// source, that simplification kept every group's border, and random cuts. An edge (a pair of
/// positions) of a cut is good if two triangles share it; any other is allowed if its ends are
/// joined by non-manifold edges of the source: those that not exactly two triangles share, or that
/// two share running in the same direction (duplicates, surfaces without orientation); or by such
/// edges between new positions of what a group of SimplifyMethod::kSloppy was simplified to
/// (enlarged components). Borders of groups are compared side by side where the source has no
/// non-manifold edge, else modulo 2.
UMBEL_API VerifyReport verify(const Tables& tables, const GeometryReader& geometry,
                              const VerifyConfig& config, const BuildOptions& options = {});

}  // namespace umbel::lod
