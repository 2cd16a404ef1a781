// Simplifies a unit for some rounds: clusters become groups, groups are simplified, and their
// clusters are what the next round begins with. Groups of a round are independent and run in
// parallel; results are joined in the order of the groups.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/progress.hpp"
#include "lod/build/group.hpp"
#include "lod/build/group_sink.hpp"
#include "lod/build/measure.hpp"
#include "lod/build/simplify_level.hpp"
#include "lod/build/unit.hpp"
#include "lod/dag/topology.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

class UnitBuilder {
 public:
  /// `unit` is changed by every step, and is what is left after it. All that is passed must outlive
  /// the builder.
  UnitBuilder(Unit& unit, const Config& config, const Decimator& decimate, GroupSink& sink,
              Report& report, Progress& progress);

  /// Makes the clusters of level 0 of the source's triangles. `undecided`: see settle_source.
  void make_finest_level(std::vector<PositionPair>* undecided = nullptr);

  static constexpr uint32_t kAllRounds = std::numeric_limits<uint32_t>::max();
  /// Simplifies until nothing more can be done or asked for, at most so many times.
  void run(uint32_t rounds = kAllRounds);

  /// What is left becomes one root group, or several where simplification could go no further and
  /// one group would be too large.
  void write_roots();

  /// Of measured errors, over all groups that have one.
  double mean_log2_overestimate() const;

 private:
  // What goes on to the next level, in the order of the groups.
  struct Next {
    std::vector<ClusterRef> clusters;
    std::vector<Sphere> spheres;
    std::vector<std::vector<Vec3>> samples;
  };

  void grow();
  void grow_groups();
  bool is_coarsest() const;
  bool is_deep_enough() const;
  size_t simplify_level(bool last_resort);
  bool may_divide_step() const;
  void divide_step(GroupResult& result, GroupResult& between);
  void lock_frozen();
  void measure(const Clusters& groups, const std::vector<GroupResult>& results,
               std::vector<Measured>& measured) const;
  float error_of(std::span<const uint32_t> members, const Simplified& simplified,
                 const Measured& measured) const;
  void compare(std::span<const uint32_t> members, const Simplified& simplified,
               const Measured& measured);
  Sphere sphere_of(std::span<const uint32_t> members, std::span<const Vec3> new_positions) const;
  void wait(std::span<const uint32_t> members, LimitingFactor limit, Next& next);
  void join(const Clusters& groups, std::vector<GroupResult>& results,
            std::vector<Measured>& measured);

  Unit& unit_;
  const Config& config_;
  Config grouping_;  // the same, with larger groups once nothing else helps
  GroupSink& sink_;
  Report& report_;
  Progress& progress_;
  Grouper grouper_;
  LevelSimplifier simplifier_;
  std::unique_ptr<SurfaceDistance> surface_distance_;  // with Config::measured_error
  std::vector<std::vector<Vec3>> samples_;             // of pending clusters, see measure.hpp
  // What the one group that is left becomes after a step, simplified from the same triangles.
  std::optional<GroupResult> after_step_;
  size_t left_by_step_ = 0;  // triangles; others mean that the step was not taken
  bool is_last_round_ = false;
  double sum_of_logs_ = 0;
  double done_ = 0.1;  // part of all work
};

}  // namespace umbel::lod
