// The tables of a DAG of clusters, from which any cut is one surface, and the geometry of its
// clusters.
//
// Level 0 is the mesh itself, partitioned into clusters. Groups of 24 to 32 neighbouring clusters
// are simplified to half, with what they share with other groups locked, and the result is
// partitioned into the clusters of the next level, until one group is left (Karis, "Nanite: A Deep
// Dive", 2021). A cluster belongs to one group, `group`, and was made by simplifying another,
// `generating_group` (none at level 0).
//
// Whether a group must be refined is a test of that group alone: is its error, that of its
// *simplified* form, too large in this view? A cluster is in the cut if its group must be refined
// and its generating group need not be. Errors and spheres never shrink from a generating group to
// the groups of what it generated, so the tests agree with each other and the cut has no hole and
// no overlap.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
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

/// The hierarchy of a DAG of any origin: one tree over per-level trees over the groups of
/// `tables.levels`. nodes[0] is the root, the children of a node are consecutive, and every group
/// is one leaf with its own sphere and error. Empty without groups. Uses levels and groups alone.
/// Throws kCorrupt for a level of groups that are not there, and for a group whose sphere or error
/// is NaN or negative, or whose centre is not finite.
UMBEL_API std::vector<Node> build_hierarchy(const Tables& tables);

/// Gives tables of any origin what they lack: levels, where there are none, from the groups' own,
/// which must not fall from one group to the next; and nodes, where there are none. Throws as
/// build_hierarchy does; call validate (lod/verify.hpp) for the rest.
UMBEL_API void complete(Tables& tables);

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

/// Reads one cluster's geometry: Dag::geometry, Asset::geometry, or the caller's own.
using GeometryReader = std::function<ClusterGeometry(uint32_t cluster)>;

/// A cut as an ordinary mesh: equal vertices of different clusters become one. Throws
/// kInvalidArgument for a cluster out of range.
UMBEL_API Mesh mesh_of_cut(const Tables& tables, const GeometryReader& geometry,
                           std::span<const uint32_t> cut);

}  // namespace umbel::lod
