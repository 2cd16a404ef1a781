#include "lod/build/unit_builder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/big_vector.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "lod/build/clusterise.hpp"
#include "lod/build/held_positions.hpp"
#include "lod/dag/bounds.hpp"

namespace umbel::lod {
namespace {

// A level that keeps more than this part of the triangles counts as idle.
constexpr double kLeastProgress = 0.98;
// Idle levels before the last resort is allowed, and after it before the build ends with what is
// left as its roots.
constexpr int kPatience = 2;

}  // namespace

UnitBuilder::UnitBuilder(Unit& unit, const Config& config, const Decimator& decimate,
                         GroupSink& sink, Report& report, Progress& progress)
    : unit_(unit),
      config_(config),
      grouping_(config),
      sink_(sink),
      report_(report),
      progress_(progress),
      grouper_(unit.source),
      simplifier_(unit, config_, decimate) {
  grow();
  grouper_.know_locked(unit.locked);
  if (unit.source.mesh.triangles.empty()) lock_frozen();
}

void UnitBuilder::make_finest_level(std::vector<PositionPair>* undecided) {
  progress_.report(0.0, "clusters");
  clusterise_source(unit_.source, config_, unit_.pending, unit_.spheres);
  {
    const BigVector<uint32_t> number = order_vertices(unit_.source, unit_.pending);
    for (uint32_t& p : unit_.frozen) p = number[p];
  }
  unit_.held =
      held_positions(unit_.source, unit_.pending, unit_.locked_positions, config_.lock_borders);
  lock_frozen();
  unit_.locked_edges.freeze(unit_.frozen);
  parallel_invoke(
      [&] {
        report_.degenerate_triangles =
            settle_source(unit_.source, unit_.pending, unit_.frozen, undecided);
      },
      [&] { grouper_.prepare(unit_.pending); });
  if (!config_.measured_error) return;
  surface_distance_ = std::make_unique<SurfaceDistance>(unit_.source, unit_.pending);
  samples_.resize(unit_.pending.size());
}

void UnitBuilder::run(uint32_t rounds) {
  const ClusterSet& pending = unit_.pending;
  int idle = 0;
  bool last_resort = false;
  for (uint32_t round = 0; round < rounds; ++round) {
    if (pending.size() == 0 || is_coarsest() || is_deep_enough()) break;
    is_last_round_ = round + 1 == rounds;
    const size_t before = pending.triangle_count();
    const double enough = before * kLeastProgress;
    // The last resort would damage the rest for the sake of what must stay.
    const size_t groups = simplify_level(last_resort && unit_.held.empty());
    // One group that is what it was would be so again.
    if (groups == 1 && pending.triangle_count() == before) idle = kPatience;
    if (pending.triangle_count() <= enough) {
      idle = 0;
    } else if (++idle >= kPatience) {
      // Small groups may be nothing but borders: at the very last, larger ones.
      if (last_resort && uint64_t{grouping_.max_group} >= pending.size()) break;
      if (last_resort) grow_groups();
      last_resort = true;
      idle = 0;
    }
  }
}

void UnitBuilder::grow_groups() {
  constexpr uint32_t kTimes = 4, kMost = 1u << 16;
  grouping_.min_group = std::min(grouping_.min_group * kTimes, kMost);
  grouping_.max_group = std::min(grouping_.max_group * kTimes, kMost);
}

// Whenever the source has got vertices.
void UnitBuilder::grow() {
  grouper_.grow();
  unit_.locked.resize(unit_.source.mesh.positions.size(), 0);
}

// Nothing is gained by levels above a single cluster's worth of triangles and vertices.
bool UnitBuilder::is_coarsest() const {
  if (unit_.pending.size() == 1) return true;
  if (unit_.pending.triangle_count() > config_.max_triangles) return false;
  std::vector<uint32_t> vertices = unit_.pending.vertices;
  std::sort(vertices.begin(), vertices.end());
  const auto end = std::unique(vertices.begin(), vertices.end());
  return end - vertices.begin() <= std::ptrdiff_t{config_.max_vertices};
}

// Whether the caller wants no more.
bool UnitBuilder::is_deep_enough() const {
  return unit_.pending.triangle_count() <= config_.stop_triangles ||
         (config_.max_levels > 0 && unit_.level + 1 >= config_.max_levels);
}

// One round over all pending clusters. Returns how many groups there were.
size_t UnitBuilder::simplify_level(bool last_resort) {
  const Clusters groups = grouper_.group(unit_.pending, unit_.locked, grouping_);
  if (groups.ranges.size() != 1 || unit_.pending.triangle_count() != left_by_step_)
    after_step_.reset();
  grouper_.lock_borders(groups, unit_.locked);
  lock_frozen();
  // Half of what is left to do is this level.
  const double share = (1.0 - done_) * 0.5;
  std::vector<GroupResult> results;
  if (after_step_) {
    results.push_back(*std::exchange(after_step_, std::nullopt));
  } else {
    GroupResult between;
    const bool divided = groups.ranges.size() == 1 && may_divide_step();
    results = simplifier_.simplify(
        groups, config_.ratio, last_resort,
        [&](double part) { progress_.report(done_ + share * part, "levels of detail"); },
        divided ? &between : nullptr);
    if (divided) divide_step(results[0], between);
  }
  done_ += share;
  grow();
  std::vector<Measured> measured(results.size());
  if (surface_distance_) measure(groups, results, measured);
  join(groups, results, measured);
  return results.size();
}

// A cut is of whole groups, so where one group is all that is left, few cuts are within a budget of
// triangles. There a step is added between what is left and what it is simplified to, which is the
// same as without it. So far up it costs little; with more of them, a stream that may keep very
// little keeps less of the finer groups.
bool UnitBuilder::may_divide_step() const {
  constexpr uint32_t kFirstLevel = 6;
  return unit_.level >= kFirstLevel && unit_.frozen.empty() && config_.max_levels == 0;
}

void UnitBuilder::divide_step(GroupResult& result, GroupResult& between) {
  constexpr double kLeastStep = 0.9;
  if (!result.simplified.done || !result.new_positions.empty() ||
      result.simplified.limiting_factor == LimitingFactor::kCaller)
    return;
  simplifier_.settle_between(between);
  const size_t count = between.clusters.triangle_count();
  const float error = between.simplified.error;
  if (!between.simplified.done || !between.new_positions.empty() ||
      count > kLeastStep * unit_.pending.triangle_count() ||
      result.clusters.triangle_count() > kLeastStep * count || error > result.simplified.error)
    return;
  result.simplified.error -= error;
  left_by_step_ = count;
  after_step_ = std::exchange(result, std::move(between));
}

// What other units may have, and what the caller holds.
void UnitBuilder::lock_frozen() {
  for (uint32_t p : unit_.frozen) unit_.locked[p] = 1;
  for (uint32_t p : unit_.held) unit_.locked[p] = kHeld;
}

void UnitBuilder::measure(const Clusters& groups, const std::vector<GroupResult>& results,
                          std::vector<Measured>& measured) const {
  parallel_for(results.size(), 1, [&](size_t g) {
    if (!results[g].simplified.done) return;
    std::vector<Vec3> samples;
    for (uint32_t c : members_of(groups, g))
      samples.insert(samples.end(), samples_[c].begin(), samples_[c].end());
    surface_distance_->add_vertices(unit_.pending, members_of(groups, g), samples);
    measured[g] = surface_distance_->measure(results[g].clusters, samples, unit_.level);
  });
}

// Of a group's simplified form. Deviations add up (triangle inequality), whatever the quadrics of
// one step say; if the distance to the source is known, it alone counts.
float UnitBuilder::error_of(std::span<const uint32_t> members, const Simplified& simplified,
                            const Measured& measured) const {
  // What attributes lose does not add up from level to level.
  const float lost = std::max(simplified.attribute_error, simplified.removed_radius);
  float least = 0, sum = std::max(simplified.error, lost) + unit_.moved;
  for (uint32_t c : members) {
    const uint32_t generator = unit_.pending.generating_group[c];
    if (generator == kNone) continue;
    const double below = unit_.generators[generator].error * (1.0 + kErrorMargin);
    least = std::max(least, static_cast<float>(below));
    sum = std::max(sum, static_cast<float>(below + simplified.error));
  }
  if (!measured.valid) return sum;
  return std::max(least, std::max(lost, measured.bound) + unit_.moved);
}

// Counts how the estimate compares with the measured distance.
void UnitBuilder::compare(std::span<const uint32_t> members, const Simplified& simplified,
                          const Measured& measured) {
  if (!measured.valid || !(measured.distance > 0)) return;
  const double estimate = double{error_of(members, simplified, Measured{})} - unit_.moved;
  const double ratio = estimate / measured.distance;
  ++report_.measured_groups;
  if (ratio < 1) ++report_.underestimated_groups;
  if (ratio > 0) sum_of_logs_ += std::log2(ratio);
}

double UnitBuilder::mean_log2_overestimate() const {
  return report_.measured_groups > 0 ? sum_of_logs_ / report_.measured_groups : 0;
}

// Around each cluster of level 0, each generating group, and what it has once simplified.
Sphere UnitBuilder::sphere_of(std::span<const uint32_t> members,
                              std::span<const Vec3> new_positions) const {
  std::vector<uint32_t> generators;
  std::vector<Sphere> inner;
  for (uint32_t c : members) {
    const uint32_t generator = unit_.pending.generating_group[c];
    if (generator != kNone) {
      if (std::find(generators.begin(), generators.end(), generator) != generators.end()) continue;
      generators.push_back(generator);
    }
    inner.push_back(unit_.spheres[c]);
  }
  for (const Vec3& p : new_positions) inner.push_back({p, 0.0f});
  return enclosing_sphere(inner);
}

// The group is not made: its clusters go on as they are.
void UnitBuilder::wait(std::span<const uint32_t> members, LimitingFactor limit, Next& next) {
  ++report_.waits_by_limiting_factor[static_cast<size_t>(limit)];
  for (uint32_t c : members) {
    next.clusters.push_back({&unit_.pending, c});
    next.spheres.push_back(unit_.spheres[c]);
    if (surface_distance_) next.samples.push_back(std::move(samples_[c]));
  }
}

void UnitBuilder::join(const Clusters& groups, std::vector<GroupResult>& results,
                       std::vector<Measured>& measured) {
  Next next;
  const size_t generators_before = unit_.generators.size();
  for (size_t g = 0; g < results.size(); ++g) {
    const Simplified& simplified = results[g].simplified;
    const auto members = members_of(groups, g);
    const float error = error_of(members, simplified, measured[g]);
    if (!simplified.done || error > config_.max_error) {
      wait(members, simplified.done ? LimitingFactor::kStopped : simplified.limiting_factor, next);
      continue;
    }
    if (surface_distance_) compare(members, simplified, measured[g]);
    const Sphere sphere = sphere_of(members, results[g].new_positions);
    sink_.add_group(
        {members, unit_.level, simplified.method, simplified.limiting_factor, error, sphere});
    ClusterSet& made = results[g].clusters;
    std::fill(made.generating_group.begin(), made.generating_group.end(),
              static_cast<uint32_t>(unit_.generators.size()));
    unit_.generators.push_back({sphere, error});
    for (uint32_t c = 0; c < made.size(); ++c) {
      next.clusters.push_back({&made, c});
      next.spheres.push_back(sphere);
      if (surface_distance_) next.samples.push_back(std::move(measured[g].samples[c]));
    }
  }
  ClusterSet pending;
  parallel_invoke([&] { sink_.finish_level(unit_.pending); },
                  [&] {
                    pending = gather_clusters(next.clusters);
                    if (!is_last_round_) grouper_.prepare(pending);
                  });
  if (unit_.generators.size() > generators_before) ++unit_.level;
  unit_.pending = std::move(pending);
  unit_.spheres = std::move(next.spheres);
  samples_ = std::move(next.samples);
}

void UnitBuilder::write_roots() {
  const ClusterSet& pending = unit_.pending;
  if (pending.size() == 0) return;
  const bool coarsest = is_coarsest();
  const bool wished = is_deep_enough() || config_.max_error < kInfinity;
  const LimitingFactor limit = coarsest ? LimitingFactor::kCoarsest
                               : wished ? LimitingFactor::kStopped
                                        : LimitingFactor::kStuck;
  Clusters roots;
  if (coarsest || pending.size() <= config_.max_group) {
    for (uint32_t c = 0; c < pending.size(); ++c) roots.items.push_back(c);
    roots.ranges = {{0, static_cast<uint32_t>(pending.size())}};
  } else {
    roots = grouper_.group(pending, unit_.locked, config_);
  }
  for (size_t g = 0; g < roots.ranges.size(); ++g) {
    const auto members = members_of(roots, g);
    sink_.add_group(
        {members, unit_.level, SimplifyMethod::kRoot, limit, kInfinity, sphere_of(members, {})});
  }
  sink_.finish_level(pending);
  ++unit_.level;
  report_.root_triangles = pending.triangle_count();
  report_.root_groups = static_cast<uint32_t>(roots.ranges.size());
  report_.stuck_groups = coarsest || wished ? 0 : report_.root_groups;
}

}  // namespace umbel::lod
