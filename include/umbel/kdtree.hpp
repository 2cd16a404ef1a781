// SAH kd-trees: space itself is cut in two, again and again, and each leaf lists the triangles
// that reach into it. `build` gives the bare tree; `KdTree` answers queries.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "umbel/bvh.hpp"
#include "umbel/mesh.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::kdtree {

/// 8 bytes. Nodes lie depth-first: the child below the plane follows its parent.
struct Node {
  union {
    float at;        ///< inner: where the plane cuts the axis
    uint32_t first;  ///< leaf: offset of its references
  };
  uint32_t link;  ///< lowest 2 bits: the axis, or 3 for a leaf; the others: the index of the child
                  ///< above the plane, or how many references the leaf has
  bool is_leaf() const { return (link & 3) == 3; }
  uint32_t axis() const { return link & 3; }
  uint32_t above() const { return link >> 2; }
  uint32_t count() const { return link >> 2; }
  Range list() const { return {first, count()}; }  ///< of a leaf, its references

  static Node inner(uint32_t axis, float at, uint32_t above) {
    Node node;
    node.at = at;
    node.link = above << 2 | axis;
    return node;
  }
  static Node leaf(uint32_t first, uint32_t count) {
    Node node;
    node.first = first;
    node.link = count << 2 | 3;
    return node;
  }
};
static_assert(sizeof(Node) == 8);

/// nodes[0] is the root and its cell is `bounds`. No nodes for no triangles.
struct Tree {
  std::vector<Node> nodes;
  /// Triangle or box indices, ascending in each leaf. Leaves with the same ones share their list.
  std::vector<uint32_t> references;
  Aabb bounds;
};

enum class Builder : uint32_t {
  kExact,   ///< every plane that could be best is considered (Wald & Havran 2006)
  kBinned,  ///< planes between bins, until few triangles are left
};

/// "exact" and "binned".
UMBEL_API std::string_view name(Builder builder);
/// Throws kInvalidArgument, listing the names that there are.
UMBEL_API Builder builder_by_name(std::string_view name);

struct Config {
  Builder builder = Builder::kExact;
  bvh::CostModel cost;        ///< as of the BVHs
  float empty_bonus = 0.2f;   ///< 0..0.9: cutting off empty space is that much cheaper
  uint32_t max_depth = 0;     ///< 1..64; 0: 8 + 1.3 log2(triangles), at most 64
  uint32_t bad_refines = 3;   ///< 0..64: splits on one path that may cost more than a leaf, of 16
                              ///< triangles or more; splits that did not pay are undone
  float max_references = 16;  ///< 1..64: most references a triangle, which bounds memory
  uint32_t bins = 64;         ///< binned: bins an axis, 4..256
  /// 0..255: a cell of so few triangles becomes a leaf, whatever a split would save. 0: the cost
  /// alone decides.
  uint32_t target_leaf_size = 0;
  bvh::InvalidTriangles invalid = bvh::InvalidTriangles::kRefuse;
};

/// Triangles are clipped exactly to the cells of the tree ("perfect splits"). Degenerate and
/// duplicate triangles are legal; for invalid ones see Config::invalid; indices out of range are
/// always refused. The build needs at most 300 bytes times `max_references` a triangle, and about
/// 400 bytes a triangle on meshes of little overlap.
UMBEL_API Tree build(const MeshView& mesh, const Config& config = {},
                     const BuildOptions& options = {});

/// Over boxes, each around a primitive of the caller's own, for the traversals of
/// kdtree_traverse.hpp. Empty boxes, NaN and infinities are refused (kInvalidMesh, naming the
/// first). What the limits above say of triangles goes for boxes; config.invalid means nothing.
UMBEL_API Tree build(std::span<const Aabb> boxes, const Config& config = {},
                     const BuildOptions& options = {});

/// Which of the boxes that a tree was built over touch a box, sorted.
UMBEL_API std::vector<uint32_t> overlaps(const Tree& tree, std::span<const Aabb> boxes,
                                         const Aabb& box);

struct Statistics {
  uint32_t nodes;   ///< inner nodes and leaves
  uint32_t leaves;  ///< empty ones included
  uint32_t empty_leaves;
  uint32_t max_depth;   ///< of a leaf; the root is 0
  uint64_t references;  ///< of all leaves, also where they share a list
  double sah_cost;      ///< expected cost of a random line through the bounds
  double inner_visits;  ///< inner nodes that such a line visits
  double leaf_visits;   ///< leaves that such a line visits
  double tests;         ///< references in the leaves that such a line visits
  uint64_t bytes;
};
UMBEL_API Statistics statistics(const Tree& tree, const bvh::CostModel& cost = {});

/// How rays traverse the tree. All visit the same leaves in the same order and give the same hits.
enum class Traversal : uint32_t {
  kStack,  ///< the far child waits on a stack (Havran 2000, TA-B), whichever way planes are met
  kRopes,  ///< from leaf to neighbouring leaf (Havran et al. 1998), without a stack but where a
           ///< ray runs so close to an edge of cells that rounding decides its neighbour
  kShortStack,  ///< a stack of a few entries; what it has lost is found again from the root (Horn
                ///< et al. 2007), by a trail of bits (Laine 2010)
};

/// "stack", "ropes" and "short-stack".
UMBEL_API std::string_view name(Traversal traversal);
/// Throws kInvalidArgument, listing the names that there are.
UMBEL_API Traversal traversal_by_name(std::string_view name);

struct KdTreeConfig {
  Config tree;
  Traversal traversal = Traversal::kStack;
  bool compact = false;     ///< share vertices between triangles: less memory, slower rays
  Simd simd = Simd::kAuto;  ///< kUnsupported is thrown where the machine lacks what is asked for
};

/// A kd-tree that answers rays, distances and overlaps. It holds all that it needs: the mesh it was
/// built from need not be kept.
class UMBEL_API KdTree : public TriangleQueries {
 public:
  KdTree();  ///< no triangles; every query misses
  ~KdTree() override;
  KdTree(KdTree&&);  ///< may throw std::bad_alloc: what is moved from stays usable
  KdTree& operator=(KdTree&&) noexcept;

  /// `masks` is empty (all bits set) or one a triangle.
  static KdTree build(const MeshView& mesh, const KdTreeConfig& config = {},
                      std::span<const uint32_t> masks = {}, const BuildOptions& options = {});
  /// Of a tree over the triangles of `mesh`, which is checked.
  static KdTree of(const Tree& tree, const MeshView& mesh, const KdTreeConfig& config = {},
                   std::span<const uint32_t> masks = {}, const BuildOptions& options = {});

  /// Other ways to go through the same tree. Ropes are made when they are first asked for.
  void set_traversal(Traversal traversal);
  Traversal traversal() const;

  /// Writes beside `path`, then renames. Ropes are not kept. Format: docs/kdtree.md.
  void save(const std::string& path) const;
  /// Throws kIo, kCorrupt or kUnsupported; no query on what it returns can leave the file's arrays.
  static KdTree load(const std::string& path, Traversal traversal = Traversal::kStack,
                     Simd simd = Simd::kAuto);

  Statistics statistics() const;

 private:
  struct Data;
  Data& data();
  const Data& data() const;
};

/// Throws kCorrupt with the first fault of a tree from whatever source: links out of range, nodes
/// that are not reached once and depth-first, planes outside their cells, references to triangles
/// beyond `triangle_count`, leaves deeper than 64.
UMBEL_API void check(const Tree& tree, uint32_t triangle_count);

}  // namespace umbel::kdtree
