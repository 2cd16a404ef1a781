// A BVH over triangles that answers rays, distances and overlaps. It copies all that it needs from
// the mesh.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "umbel/bvh.hpp"
#include "umbel/mesh.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel {

struct BvhConfig {
  bvh::Config tree = bvh::preset("quality");
  uint32_t width = 8;  ///< children a node: 2, 4 or 8
  /// Share vertices between triangles, and keep boxes in 16 bits a plane: half the memory, slower
  /// rays.
  bool compact = false;
  Simd simd = Simd::kAuto;  ///< kUnsupported is thrown where the machine lacks what is asked for
};

struct RefitReport {
  double sah_cost;        ///< now, estimated by that of the wide tree
  double built_sah_cost;  ///< when the tree was built
  /// True once sah_cost exceeds 1.5 x built_sah_cost (1.5: see docs/bvh.md).
  bool rebuild_advised;
};

struct BvhStatistics {
  uint32_t width;
  uint32_t nodes;  ///< of this width
  uint32_t leaves;
  uint32_t max_depth;
  uint32_t references;
  double sah_cost;  ///< of the tree that this was made from; after a refit as in RefitReport
  uint64_t bytes;   ///< nodes and triangles, everything that a query touches
};

class UMBEL_API Bvh : public TriangleQueries {
 public:
  Bvh();  ///< no triangles; every query misses
  ~Bvh() override;
  Bvh(Bvh&&);  ///< may throw std::bad_alloc: what is moved from stays usable
  Bvh& operator=(Bvh&&) noexcept;

  /// Builds the tree with config.tree and widens it. `masks` is empty (all bits set) or one a
  /// triangle. Throws as bvh::build does.
  static Bvh build(const MeshView& mesh, const BvhConfig& config = {},
                   std::span<const uint32_t> masks = {}, const BuildOptions& options = {});
  /// Widens a tree over the triangles of `mesh` from any builder; `tree` is checked.
  static Bvh widen(const bvh::Bvh2& tree, const MeshView& mesh, const BvhConfig& config = {},
                   std::span<const uint32_t> masks = {}, const BuildOptions& options = {});
  /// The same of a tree with up to 64 children a node. Nodes with no more children than `width`
  /// stay as they are.
  static Bvh widen(const bvh::KaryTree& tree, const MeshView& mesh, const BvhConfig& config = {},
                   std::span<const uint32_t> masks = {}, const BuildOptions& options = {});

  /// Follows moved vertices: the same triangles as at the build, new positions.
  RefitReport refit(const MeshView& mesh, const BuildOptions& options = {});

  /// Writes beside `path`, then renames. Format: docs/bvh.md.
  void save(const std::string& path) const;
  /// Throws kIo or kCorrupt; no query on what it returns can leave the file's arrays.
  static Bvh load(const std::string& path, Simd simd = Simd::kAuto);

  BvhStatistics statistics() const;

 private:
  friend struct BvhAccess;  // of collision.hpp
  struct Data;
  Data& data();
  const Data& data() const;
};

}  // namespace umbel
