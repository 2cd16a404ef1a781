// Distances from many points to triangles that they are near to.
//
// Triangles in the order of their clusters, within a cluster along a space-filling curve (Morton
// 1966), stand in blocks of four; over the blocks is a tree of four children a node that needs no
// links, as node i has the children 4 i to 4 i + 3. It is built in a fraction of a hierarchy's
// time, and a search may end as soon as something is near enough.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/cluster_set.hpp"

namespace umbel::lod {

/// Reusable; const searches from any thread.
class TriangleDistanceTree {
 public:
  /// The triangles of the clusters, positions times `scale`.
  void build(const ClusterSet& set, std::span<const Vec3> positions, float scale,
             bool in_parallel = false);

  struct Nearest {
    float squared;   ///< distance; infinity where there is no triangle
    uint32_t block;  ///< where it was found
    uint32_t cluster;
  };
  /// The nearest triangle, or, if one is no farther than the root of `enough`, any such. `hint` is
  /// a block that may be near: that of the last point.
  Nearest nearest(const Vec3& point, float enough, uint32_t hint = 0) const;

 private:
  typedef float Lanes __attribute__((vector_size(16)));
  struct Block {  // of four triangles: first corner, and from there to the others
    Lanes a[3], ab[3], ac[3];
  };
  struct Node {  // four boxes
    Lanes low[3], high[3];
  };
  void fill_blocks(const ClusterSet& set, uint32_t cluster, std::span<const Vec3> positions,
                   float scale, uint32_t first);
  void build_tree();
  static Lanes squared_distances(const Block& block, const Vec3& point);
  static Lanes squared_distances(const Node& node, const Vec3& point);

  std::vector<Block> blocks_;
  std::vector<uint32_t> cluster_of_;       // of blocks
  std::vector<uint32_t> offsets_;          // clusters + 1, into blocks_
  std::vector<std::vector<Node>> levels_;  // over the blocks, and so on up to one node
};

}  // namespace umbel::lod
