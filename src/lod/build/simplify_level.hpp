// Simplifies all groups of a level in parallel, and joins what they decide together: which new
// edges between locked vertices are legal, and which numbers new vertices get.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "lod/build/clusterise.hpp"
#include "lod/build/new_positions.hpp"
#include "lod/build/unit.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/source.hpp"
#include "lod/simplify/simplify.hpp"
#include "umbel/cluster.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// What a group of clusters becomes.
struct GroupResult {
  Simplified simplified;            ///< without its mesh
  ClusterSet clusters;              ///< of that mesh; generating_group is not set yet
  std::vector<Vec3> new_positions;  ///< that the group did not have
};

inline std::span<const uint32_t> members_of(const Clusters& groups, size_t group) {
  const Range range = groups.ranges[group];
  return std::span(groups.items).subspan(range.offset, range.count);
}

class LevelSimplifier {
 public:
  LevelSimplifier(Unit& unit, const Config& config, const Decimator& decimate);

  /// One result a group of the unit's pending clusters. New vertices are appended to the source.
  /// `ratio` is what should be left; `progress` is called with the part that is done, now and then.
  /// `between` may be given where there is one group: it becomes that group after half the step,
  /// without the caller's decimation, and must be passed to settle_between() before it is used.
  std::vector<GroupResult> simplify(const Clusters& groups, float ratio, bool last_resort,
                                    const std::function<void(double)>& progress,
                                    GroupResult* between);
  /// Appends the new vertices of `between` to the source.
  void settle_between(GroupResult& between);

 private:
  struct Worker {
    GroupSimplifier simplifier;
    Clusteriser clusteriser;
    Worker(const Source& source, const Config& config, const Decimator& decimate)
        : simplifier(source, config, decimate), clusteriser(config) {}
  };

  GroupResult simplify_group(std::span<const uint32_t> members, Allowance allow);
  void insert_own_locked_edges();
  void settle_locked_edges(std::vector<GroupResult>& results, bool last_resort);
  void settle_added(std::span<GroupResult> results, bool last_resort);
  float set_apart(std::span<const uint32_t> members, bool last_resort, GroupResult& result);
  void fit_boxes(ClusterSet& clusters) const;
  void keep_one_triangle(std::vector<GroupResult>& results);
  bool is_degenerate(const Triangle& t) const;
  bool may_be_left(const Triangle& t) const;

  Unit& unit_;
  Source& source_;
  const Config& config_;
  NewPositions new_positions_;
  tbb::enumerable_thread_specific<std::unique_ptr<Worker>> workers_;
  const Clusters* groups_ = nullptr;  // of the level
  float ratio_ = 0;                   // of its triangles that should be left
  bool by_caller_ = true;             // may be asked
};

}  // namespace umbel::lod
