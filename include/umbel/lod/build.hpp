// Building the DAG of clusters of a mesh.
//
//   const lod::Dag dag = lod::build(mesh.view());
//   const std::vector<uint32_t> cut = lod::select(dag.tables, lod::view_error(0.01f));
//   const Mesh coarse = lod::mesh_of_cut(
//       dag.tables, [&](uint32_t cluster) { return dag.geometry(cluster); }, cut);
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "umbel/lod/types.hpp"
#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel::lod {

/// How firmly lines are held along which vertices at one position have different attributes.
enum class SeamRule : uint8_t {
  kProtect = 0,  ///< they shorten along themselves only, until nothing else is left to simplify
  kAllow = 1,    ///< what it costs the attributes to cross them counts as error
  kIgnore = 2,   ///< crossing costs nothing
};

struct Config {
  uint32_t max_triangles = 128;  ///< a cluster, 4..256; 0: no limit but 256
  uint32_t max_vertices = 128;   ///< a cluster, 6..256; 0: no limit but 256
  /// Least triangles of a cluster, where materials and the limit of vertices allow it, at most
  /// max_triangles; 0: a quarter of them.
  uint32_t min_triangles = 0;
  /// What clusters cost that have too few triangles or vertices, and splits whose sides overlap, in
  /// [0, 1]: those of ClusterConfig.
  float underfill_cost = 0.3f, vertex_underfill_cost = 0.5f, overlap_cost = 0;
  uint32_t min_group = 24, max_group = 32;  ///< clusters in a group, 2 <= min <= max
  /// The same of groups that have too few clusters, and of groups that overlap.
  float group_underfill_cost = 0.5f, group_overlap_cost = 0;
  float ratio = 0.5f;  ///< triangles kept a level, [0.1, 0.9]
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
  /// Open edges of the mesh (of one triangle, by position) stay as they are in every cut, so that
  /// parts of a larger mesh that are built apart, tiles of a terrain or modules of a building, join
  /// without a crack, whatever cut each shows. What is locked is never removed: coarse levels
  /// cannot have fewer triangles than it needs.
  bool lock_borders = false;
  /// Errors are distances to the source, sampled in both directions through hierarchies over both
  /// surfaces, with a margin (docs/lod.md), instead of sums of what each step moved. Slower, and
  /// closer, but no bound.
  bool measured_error = false;
};

/// Why a group was not simplified to 70 % by the first method alone, or is a root: what kept most
/// of its vertices from moving.
enum class LimitingFactor : uint32_t {
  kNone = 0,             ///< the first method was enough
  kCaller = 1,           ///< the caller's decimation did it
  kSmallComponents = 2,  ///< components smaller than the error were kept at the cost of larger ones
  kLocked = 3,           ///< other groups share them, or the caller has locked them
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

struct Report {
  uint64_t input_triangles = 0, input_vertices = 0;
  uint64_t degenerate_triangles = 0;           ///< kept in level 0, left out of all coarser levels
  uint32_t root_groups = 0, stuck_groups = 0;  ///< stuck: all roots, if more than one cluster's
                                               ///< worth of triangles or vertices is left
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
  Mesh vertices;  ///< welded input; `triangles` and `materials` are empty
  /// One a vertex of `vertices`: the vertex of the input that it is, so that a renderer can keep
  /// its own vertex buffer; where several were equal, the first that a triangle uses. kNone: it is
  /// new. With Config::position_step its position is rounded, with Config::refit_attributes false
  /// all but those of `sloppy` groups and the caller's own new vertices are the input's.
  std::vector<uint32_t> source_vertices;
  std::vector<uint32_t> vertex_offsets;    ///< clusters + 1, into cluster_vertices
  std::vector<uint32_t> triangle_offsets;  ///< clusters + 1, in triangles
  std::vector<uint32_t> cluster_vertices;  ///< index into `vertices`
  std::vector<uint8_t> cluster_triangles;  ///< 3 a triangle: index into the cluster's vertices
  uint64_t source_digest = 0;              ///< triangle_set_digest of the input
  Config config;
  Report report;

  UMBEL_API ClusterGeometry geometry(uint32_t cluster) const;
};

/// Why what a decimation gave could not take its group's place.
struct DecimationRefusal {
  enum class Reason : uint32_t {
    kNone = 0,            ///< it can take it
    kTooMany = 1,         ///< more than DecimationInput::most triangles
    kDegenerate = 2,      ///< a triangle has two corners at one position
    kMixedMaterials = 3,  ///< a triangle has corners of several materials
    kEdges = 4,           ///< edges of the group's border are missing, or edges are open, or have
                          ///< more than two triangles, or triangles that run the wrong way along
                          ///< them, that must not
    kTakenEdge = 5,       ///< another group has made the same new edge between two locked vertices:
                          ///< this group may make none at all
    kTurnedOver = 6,      ///< a connected component faces the other way
  } reason = Reason::kNone;
  uint32_t triangle = kNone;  ///< kDegenerate, kMixedMaterials, kTurnedOver: of the result
  /// kEdges: pairs of vertices, as the result numbers them. Of several vertices at a position it is
  /// the first.
  std::vector<std::array<uint32_t, 2>> edges;
};
/// One sentence.
UMBEL_API std::string to_string(const DecimationRefusal& refusal);

/// A group as a decimation of the caller's own gets it.
struct DecimationInput {
  /// The group's vertices, numbered from 0, and its triangles; `materials` is one a triangle or
  /// empty. Several vertices may be at one position, as along seams.
  MeshView mesh;
  /// One a vertex: 1 where another group has the vertex's position too, or the caller has locked
  /// it. Such positions must stay, and so must every edge between two of them that is the border of
  /// the group.
  std::span<const uint8_t> locked;
  size_t target;  ///< triangles that should be left
  size_t most;    ///< triangles that may be left at most: 85 % of the group's, or `ratio` if more
  /// Why the result of the last call for this group was refused; null in the first.
  const DecimationRefusal* refused = nullptr;
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

/// Simplifies one group. Returns false to leave it to the library. A result that cannot take the
/// group's place is refused, and the function called again with DecimationInput::refused, up to
/// four times in all: it may mend the result, or return false. Called by several threads at once
/// unless BuildOptions::threads is 1. The DAG is deterministic if this is. Throws what it likes: it
/// ends the build; Error with ErrorCode::kCancelled cancels it.
using Decimator = std::function<bool(const DecimationInput& input, DecimationResult& result)>;

/// Builds the DAG of a valid mesh, which is welded first. Deterministic. Throws kUnsupported for a
/// coordinate beyond 1e18, kInvalidArgument where `decimate` gives what no mesh can have.
///
/// `locked` is one a vertex, or empty. Where it is not 0, everything at the vertex's position stays
/// in every cut: the position, the vertices there and the open edges between two such positions.
/// See Config::lock_borders for all open edges.
UMBEL_API Dag build(const MeshView& mesh, const Config& config = {},
                    const BuildOptions& options = {}, const Decimator& decimate = {},
                    std::span<const uint8_t> locked = {});

}  // namespace umbel::lod
