// The distance between a simplified group and the source, sampled in both directions (as Metro
// does: Cignoni, Rocchini & Scopigno 1998).
//
// From the source to the group: the vertices that the group had, which are points of the source,
// and those that its clusters carry, which coarser levels have no more. They are looked up among
// the group's new triangles and go on with the new cluster that they are nearest to, the farthest
// ones first. So every vertex is looked up at the level that removes it, and what is worst stays
// known. Looking only within the group can make a distance too large, never too small. From the
// group to the source: a point of each triangle, on the whole source. Only the farthest counts, so
// a search ends with the first triangle that is no farther than what is known already (Taha &
// Hanbury 2015).
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <span>
#include <vector>

#include "base/math.hpp"
#include "lod/build/triangle_distance_tree.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/source.hpp"

namespace umbel::lod {

struct Measured {
  bool valid = false;                      ///< false: nothing is left to measure
  float distance = 0;                      ///< the largest of all samples
  float bound = 0;                         ///< the same with a margin for what lies between them
  std::vector<std::vector<Vec3>> samples;  ///< of each new cluster
};

class SurfaceDistance {
 public:
  /// `clusters` are those of level 0.
  SurfaceDistance(const Source& source, const ClusterSet& clusters);

  /// Appends the vertices of the clusters that are points of the source.
  void add_vertices(const ClusterSet& set, std::span<const uint32_t> clusters,
                    std::vector<Vec3>& samples) const;

  /// `made` are the clusters of a simplified group of this level, `samples` those of the clusters
  /// that it was.
  Measured measure(const ClusterSet& made, std::span<const Vec3> samples, uint32_t level) const;

 private:
  Vec3 position(uint32_t vertex) const { return source_.mesh.positions[vertex] * source_.scale; }

  const Source& source_;
  size_t first_new_;              // position that the source had not
  TriangleDistanceTree surface_;  // the source
  mutable tbb::enumerable_thread_specific<TriangleDistanceTree> made_;
};

}  // namespace umbel::lod
