// Structures that divide triangles uniformly, without weighing costs: a two-level grid, an octree
// and the bounding interval hierarchy. They are built in little more time than a sort takes: for
// comparing structures, and for meshes that few rays are traced through. Queries and their results
// are those of every structure.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "umbel/kdtree.hpp"
#include "umbel/mesh.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::uniform {

/// Nodes are inner nodes and leaves; of a grid, the cells of both levels. `sah_cost` is comparable
/// with that of other structures; a step of a grid counts as a visit of an inner node.
using kdtree::Statistics;

/// The base of the structures. Each has a build(mesh, config, masks, options), where `masks` is
/// empty (all bits set) or one a triangle, which throws as kdtree::build does.
class UMBEL_API UniformStructure : public TriangleQueries {
 public:
  ~UniformStructure() override;
  UniformStructure(UniformStructure&& other);  ///< may throw std::bad_alloc
  UniformStructure& operator=(UniformStructure&& other) noexcept;

  Statistics statistics() const;

 protected:
  explicit UniformStructure(std::unique_ptr<LeafStore> store);
};

struct GridConfig {
  float density = 0.12f;      ///< cells a triangle of the top level, 0.001..16
  float leaf_density = 2.4f;  ///< cells of a top cell's own grid for each triangle there, 0.001..16
  float max_references = 16;  ///< 1..64: most references a triangle. Grids are made coarser until
                              ///< they keep to it, which bounds memory and time
  bool compact = false;       ///< share vertices between triangles: less memory, slower rays
  Simd simd = Simd::kAuto;    ///< kUnsupported is thrown where the machine lacks what is asked for
  bvh::CostModel cost{};      ///< of statistics
  bvh::InvalidTriangles invalid = bvh::InvalidTriangles::kRefuse;
};

/// A grid whose cells hold grids (Kalojanov, Billeter & Slusallek, "Two-Level Grids for Ray Tracing
/// on GPUs", 2011). Rays step from cell to cell (Amanatides & Woo 1987). At most 255 cells an axis
/// and level. The build needs at most 100 bytes times `max_references` a triangle.
class UMBEL_API TwoLevelGrid : public UniformStructure {
 public:
  TwoLevelGrid();  ///< no triangles; every query misses
  static TwoLevelGrid build(const MeshView& mesh, const GridConfig& config = {},
                            std::span<const uint32_t> masks = {}, const BuildOptions& options = {});
};

struct OctreeConfig {
  uint32_t max_leaf_size = 8;  ///< 1..64: cells of so few triangles are not cut any more
  uint32_t max_depth = 0;      ///< 1..20; 0: 6 + log4(triangles)
  float max_references = 16;   ///< 1..64: most references a triangle, which bounds memory
  bool compact = false;        ///< as above
  Simd simd = Simd::kAuto;
  bvh::CostModel cost{};  ///< of statistics; the planes across the three axes count as three visits
  bvh::InvalidTriangles invalid = bvh::InvalidTriangles::kRefuse;
};

/// An octree (Glassner, "Space Subdivision for Fast Ray Tracing", 1984): a cube around the mesh is
/// cut into eight at its middle, again and again, where more than `max_leaf_size` triangles are;
/// each leaf lists the triangles that touch its cell. A node has 16 bytes. Cells stay whole where
/// cutting them tells no triangles apart.
class UMBEL_API Octree : public UniformStructure {
 public:
  Octree();  ///< no triangles; every query misses
  static Octree build(const MeshView& mesh, const OctreeConfig& config = {},
                      std::span<const uint32_t> masks = {}, const BuildOptions& options = {});
};

struct IntervalConfig {
  uint32_t max_leaf_size = 4;  ///< 1..64
  bool compact = false;        ///< as above
  Simd simd = Simd::kAuto;
  bvh::CostModel cost{};
  bvh::InvalidTriangles invalid = bvh::InvalidTriangles::kRefuse;
};

/// The bounding interval hierarchy (Waechter & Keller, "Instant Ray Tracing: The Bounding Interval
/// Hierarchy", 2006): each node cuts its triangles at the middle of the longest axis and keeps one
/// plane for each child, beyond which that child does not reach. Each triangle is in one leaf, so
/// memory is known before: a node of 12 bytes for at most each triangle but one, and as many
/// leaves.
class UMBEL_API IntervalHierarchy : public UniformStructure {
 public:
  IntervalHierarchy();  ///< no triangles; every query misses
  static IntervalHierarchy build(const MeshView& mesh, const IntervalConfig& config = {},
                                 std::span<const uint32_t> masks = {},
                                 const BuildOptions& options = {});
};

}  // namespace umbel::uniform
