// Bounding volume hierarchies: the binary tree that every builder gives, the builders, the
// passes that improve any tree, and what a tree costs. For tracing rays see triangle_bvh.hpp.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel::bvh {

/// What one visit of an inner node and one test of a primitive cost, in any unit. The defaults
/// are those of Meister & Bittner 2016.
struct CostModel {
  float traversal = 3.0f;     ///< k_T > 0
  float intersection = 2.0f;  ///< k_I > 0
  bool operator==(const CostModel&) const = default;
};

/// A box with two children, or a leaf with `count` primitives.
struct Node {
  Vec3 min;
  uint32_t first;  ///< inner: index of the left child (the right one follows it);
                   ///< leaf: offset of its primitives
  Vec3 max;
  uint32_t count;  ///< 0 for an inner node
  bool is_leaf() const { return count != 0; }
  Aabb box() const { return {min, max}; }
  bool operator==(const Node&) const = default;
};
static_assert(sizeof(Node) == 32);

/// A binary tree: nodes[0] is the root, and children come after their parent, so a loop from the
/// back visits them bottom-up. No nodes for no primitives. A node's box is exactly the union of
/// what lies below it (with spatial splits: of the parts that lie below it).
struct Bvh2 {
  std::vector<Node> nodes;
  /// Primitive indices in the order of the leaves: each once; with spatial splits at least once.
  std::vector<uint32_t> primitives;
};

enum class Builder : uint32_t {
  kSweep,          ///< full-sweep SAH: the reference
  kBinned,         ///< binned SAH (Wald 2007)
  kSpatial,        ///< SAH with spatial splits (Stich et al. 2009); needs triangles
  kLbvh,           ///< linear BVH (Karras 2012)
  kHlbvh,          ///< hierarchical LBVH (Garanzha et al. 2011)
  kKmeans,         ///< k-means (Meister & Bittner 2016)
  kAgglomerative,  ///< locally-ordered agglomeration with a heap (Walter et al. 2008)
  kAac,            ///< approximate agglomerative clustering (Gu et al. 2013)
  kPloc,           ///< parallel locally-ordered clustering (Meister & Bittner 2018)
  kAtrbvh,         ///< treelets restructured agglomeratively (Domingues & Pedrini 2015)
  kInsertion,      ///< incremental insertion (Goldsmith & Salmon 1987, Bittner et al. 2015)
};

/// The command line's and Python's name: "sweep", "binned", "sbvh", "lbvh", "hlbvh", "kmeans",
/// "agglomerative", "aac", "ploc", "atrbvh", "insertion".
UMBEL_API std::string_view name(Builder builder);
/// Throws kInvalidArgument, listing the names that there are.
UMBEL_API Builder builder_by_name(std::string_view name);
/// Every builder that this library was built with.
UMBEL_API std::span<const Builder> builders();

/// What to do with a triangle that has a NaN or infinite vertex.
enum class InvalidTriangles : uint32_t { kRefuse, kDrop };

enum class KmeansDistance : uint32_t {
  kEuclidean,  ///< squared distance of the boxes' corners, means
  kManhattan,  ///< 1-norm of the boxes' corners, component-wise medians
};

struct KmeansConfig {
  uint32_t clusters = 8;    ///< k, 2..1024; 64 in k-ary trees
  uint32_t candidates = 5;  ///< p, 1..64: the best of p becomes the next representative
  uint32_t iterations = 2;  ///< i, 0..100 Lloyd iterations
  KmeansDistance distance = KmeansDistance::kEuclidean;
  /// Subtrees that the treelet of a node forwards to the one above it, 0..64; 0, and numbers that
  /// are too large, mean as many as make treelets of 128. With 1, as published, treelets are joined
  /// by agglomeration; with others also by a full sweep, and the cheaper tree is kept.
  uint32_t forwarded_clusters = 0;
};

/// The slides' settings "q1" to "q5", from k 8, p 5, i 0 to k 64, p 30, i 15. Throws
/// kInvalidArgument for other names.
UMBEL_API KmeansConfig kmeans_preset(std::string_view name);

struct AacConfig {
  uint32_t leaf_size = 4;  ///< delta, 2..128: fewer primitives are not halved any more
  float epsilon = 0.2f;    ///< 0..0.5: x primitives forward clusters in proportion to
                           ///< x^(0.5 - epsilon)
};

/// "fast" (the default) and "hq", the paper's two settings. Throws kInvalidArgument for others.
UMBEL_API AacConfig aac_preset(std::string_view name);

/// What each builder takes beside cost, max_leaf_size and max_depth:
///
// clang-format off
/// | builder       | field                 | range           | default | source                      |
/// |---------------|-----------------------|-----------------|---------|-----------------------------|
/// | sweep         | none                  |                 |         | MacDonald & Booth 1990      |
/// | binned        | bins                  | 4..256          | 32      | Wald 2007                   |
/// | sbvh          | spatial_budget        | 0..4            | 0.3     | Stich et al. 2009           |
/// | sbvh          | spatial_overlap       | 0..1            | 1e-5    | their alpha                 |
/// | lbvh          | morton_bits           | 30, 60, 63      | 63      | Karras 2012                 |
/// | hlbvh         | hlbvh_bits            | 3..30           | 15      | Garanzha et al. 2011        |
/// | kmeans        | kmeans.clusters       | 2..1024         | 8       | Meister & Bittner 2016: k   |
/// | kmeans        | kmeans.candidates     | 1..64           | 5       | their p                     |
/// | kmeans        | kmeans.iterations     | 0..100          | 2       | their i                     |
/// | kmeans        | kmeans.distance       | both            | squared | their slides                |
/// | kmeans        | kmeans.forwarded_     | 0..64           | 0       | 1 is theirs                 |
/// |               |   clusters            |                 |         |                             |
/// | agglomerative | none                  |                 |         | Walter et al. 2008          |
/// | aac           | aac.leaf_size         | 2..128          | 4       | Gu et al. 2013: delta       |
/// | aac           | aac.epsilon           | 0..0.5          | 0.2     | their epsilon               |
/// | ploc          | ploc_radius           | 1..128          | 16      | Meister & Bittner 2018      |
/// | ploc          | ploc_sweep            | 0..255          | 8       | 0 is theirs                 |
/// | atrbvh        | atrbvh_bits           | 0, 3..30        | 15      | 0 is Domingues & Pedrini's  |
/// | atrbvh        | treelet_size          | 3..15           | 9       | Domingues & Pedrini 2015    |
/// | atrbvh        | treelet_rounds        | 1..16           | 2       | theirs                      |
/// | insertion     | none                  |                 |         | Bittner et al. 2015         |
/// | any           | reinsertion_rounds    | 0..64           | 0       | Meister & Bittner 2018      |
// clang-format on
struct Config {
  Builder builder = Builder::kBinned;
  CostModel cost;
  uint32_t max_leaf_size = 8;  ///< most primitives a leaf, 1..255
  uint32_t max_depth = 96;     ///< deepest level of a leaf (the root is 0), 8..255; see docs
  InvalidTriangles invalid = InvalidTriangles::kRefuse;

  uint32_t bins = 32;             ///< binned: bins an axis, 4..256
  float spatial_budget = 0.3f;    ///< spatial: references beyond the input's, as a fraction, 0..4
  float spatial_overlap = 1e-5f;  ///< spatial: Stich's alpha, 0..1
  uint32_t morton_bits = 63;      ///< lbvh: 30, 60 (as most papers) or 63
  uint32_t hlbvh_bits = 15;       ///< hlbvh: leading code bits built by SAH, 3..30
  uint32_t ploc_radius = 16;      ///< ploc: neighbours searched each way, 1..128
  /// ploc: the tree above the largest subtrees of at most so many primitives is also built by the
  /// full sweep, and the cheaper one is kept, 0..255; 0: never, as published.
  uint32_t ploc_sweep = 8;
  /// atrbvh: leading code bits of the linear tree to begin with that are built by SAH, as with
  /// hlbvh_bits, 3..30; 0: none, as published.
  uint32_t atrbvh_bits = 15;
  uint32_t treelet_size = 9;        ///< atrbvh: leaves of a treelet, 3..15
  uint32_t treelet_rounds = 2;      ///< atrbvh: 1..16
  uint32_t reinsertion_rounds = 0;  ///< passes of parallel reinsertion after any builder, 0..64
  KmeansConfig kmeans;
  AacConfig aac;
};

/// "fast", "quality" (the default) and "best". Throws kInvalidArgument for other names.
UMBEL_API Config preset(std::string_view name);

/// Told at the end of a build how long each of its stages took: its name, and seconds by the wall
/// clock. Builds by k-means have the stages of Meister & Bittner's charts: "boxes" (the scene's,
/// and those of the primitives in the builder's own arrays), "seeding", "iterations", "sizes" (of
/// clusters, and where each goes), "reordering" and "agglomeration". Others have none.
using StageObserver = std::function<void(std::string_view stage, double seconds)>;

/// Builds over boxes. Empty boxes, NaN and infinities are refused (kInvalidMesh, naming the
/// first); kSpatial is (kInvalidArgument), because it needs triangles to split.
UMBEL_API Bvh2 build(std::span<const Aabb> boxes, const Config& config = {},
                     const BuildOptions& options = {}, const StageObserver& observer = {});

/// Builds over triangles: primitives are triangle indices. Degenerate and duplicate triangles
/// are legal; for invalid ones see Config::invalid; indices out of range are always refused.
UMBEL_API Bvh2 build(const MeshView& mesh, const Config& config = {},
                     const BuildOptions& options = {}, const StageObserver& observer = {});

/// A box with up to 64 children, or a leaf.
struct KaryNode {
  Vec3 min;
  uint32_t first;  ///< inner: index of the first child (the others follow it);
                   ///< leaf: offset of its primitives
  Vec3 max;
  uint16_t children;  ///< 0 for a leaf
  uint16_t count;     ///< primitives of a leaf; 0 for an inner node
  bool is_leaf() const { return children == 0; }
  Aabb box() const { return {min, max}; }
  bool operator==(const KaryNode&) const = default;
};
static_assert(sizeof(KaryNode) == 32);

/// nodes[0] is the root, and children come after their parent. No nodes for no primitives.
struct KaryTree {
  std::vector<KaryNode> nodes;
  std::vector<uint32_t> primitives;  ///< in the order of the leaves, each once
};

/// The clusters of k-means as they are, before they become a binary tree: a node has two to
/// `config.kmeans.clusters` children (64 at most), a leaf up to `config.max_leaf_size` primitives.
/// No level is deeper than 80. Refuses what `build` refuses of boxes.
UMBEL_API KaryTree build_kmeans_kary(std::span<const Aabb> boxes, const Config& config = {},
                                     const BuildOptions& options = {});
/// Over triangles, as `build` takes them.
UMBEL_API KaryTree build_kmeans_kary(const MeshView& mesh, const Config& config = {},
                                     const BuildOptions& options = {});

// Passes. Each keeps the primitives below the root and never raises the SAH cost. Costs that are
// not positive and finite are refused (kInvalidArgument).

/// Makes a leaf of every subtree with at most `max_leaf_size` primitives that costs less as one.
UMBEL_API void collapse_leaves(Bvh2& tree, const CostModel& cost, uint32_t max_leaf_size,
                               const BuildOptions& options = {});

/// Moves subtrees to where they enlarge the tree least (Meister & Bittner 2018), in at most
/// `rounds` rounds. The first tries only the largest nodes, and the one after a round that gains
/// little twice as many; a round with all of them that gains nothing is the last.
UMBEL_API void reinsert(Bvh2& tree, uint32_t rounds, const BuildOptions& options = {});

/// Agglomerates the largest `treelet_size` (3..15) subtrees below each node, always the two with
/// the smallest common box, where that is cheaper (Domingues & Pedrini 2015), in rounds (0..16).
/// Leaves stay as they are.
UMBEL_API void restructure_treelets(Bvh2& tree, uint32_t treelet_size = 9, uint32_t rounds = 2,
                                    const CostModel& cost = {}, const BuildOptions& options = {});

/// Lays nodes out depth-first, the larger child first, and primitives in the order of the leaves.
UMBEL_API void reorder(Bvh2& tree, const BuildOptions& options = {});

/// Expected cost of a random line: sum over nodes of area / root area times k_T (inner nodes) or
/// k_I times primitives (leaves) (Goldsmith & Salmon 1987). 0 for an empty tree; where the root has
/// no area, the cost of visiting every node. Here and in what else measures a tree a cost may be 0,
/// but not negative, infinite or NaN (kInvalidArgument).
UMBEL_API double sah_cost(const Bvh2& tree, const CostModel& cost = {});
UMBEL_API double sah_cost(const KaryTree& tree, const CostModel& cost = {});

/// End-point overlap (Aila, Karras & Laine 2013): the cost of the surface inside boxes of subtrees
/// that it does not belong to, over the total surface.
UMBEL_API double end_point_overlap(const Bvh2& tree, const MeshView& mesh,
                                   const CostModel& cost = {}, const BuildOptions& options = {});

struct Statistics {
  uint32_t nodes;  ///< inner nodes and leaves
  uint32_t leaves;
  uint32_t max_depth;   ///< of a leaf; the root is 0
  uint32_t references;  ///< primitives in leaves, repeats counted
  double sah_cost;
  uint64_t bytes;
};
UMBEL_API Statistics statistics(const Bvh2& tree, const CostModel& cost = {});
UMBEL_API Statistics statistics(const KaryTree& tree, const CostModel& cost = {});

/// Checks a tree from whatever source: links in range and each node reached once, children after
/// parents, boxes enclosing their children, every primitive below `primitive_count` and present
/// (exactly once unless `repeats`). Throws kCorrupt with the first fault.
UMBEL_API void check(const Bvh2& tree, uint32_t primitive_count, bool repeats = false);
/// The same, of nodes with two to 64 children; primitives below `primitive_count` may be missing,
/// as where triangles were dropped.
UMBEL_API void check(const KaryTree& tree, uint32_t primitive_count);

}  // namespace umbel::bvh
