// Builds the DAG of clusters of continuous level of detail (Karis, "Nanite: A Deep Dive",
// SIGGRAPH 2021): clusters, groups, simplification of each group with its border locked, clusters
// again, until one group is left. Groups of a level are independent and run in parallel; results
// are joined in the order of the groups.
#include "umbel/lod/build.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "lod/build/check_config.hpp"
#include "lod/build/clusterise.hpp"
#include "lod/build/dag_writer.hpp"
#include "lod/build/group.hpp"
#include "lod/build/hierarchy.hpp"
#include "lod/build/measure.hpp"
#include "lod/build/simplify_level.hpp"
#include "lod/dag/bounds.hpp"
#include "lod/dag/source.hpp"

namespace umbel::lod {
namespace {

// A level that keeps more than this part of the triangles counts as idle.
constexpr double kLeastProgress = 0.98;
// Idle levels before the last resort is allowed, and after it before the build ends with what is
// left as its roots.
constexpr int kPatience = 2;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

class Builder {
 public:
  Builder(const MeshView& mesh, const Config& config, const BuildOptions& options,
          const Decimator& decimate)
      : config_(config),
        grouping_(config),
        progress_(options),
        grouper_(source_),
        simplifier_(source_, config_, decimate),
        writer_(dag_) {
    dag_.config = config;
    tbb::parallel_invoke([&] { source_ = make_source(mesh, BuildOptions{}); },
                         [&] { dag_.source_digest = triangle_set_digest(mesh); });
    grow();
    report().input_triangles = mesh.triangles.size();
    report().input_vertices = mesh.positions.size();
  }

  Dag run() {
    make_finest_level();
    int idle = 0;
    bool last_resort = false;
    while (pending_.size() > 0 && !is_coarsest() && !is_deep_enough()) {
      const size_t before = pending_.triangle_count();
      const double enough = before * kLeastProgress;
      const size_t groups = simplify_level(last_resort);
      // One group that is what it was would be so again.
      if (groups == 1 && pending_.triangle_count() == before) idle = kPatience;
      if (pending_.triangle_count() <= enough) {
        idle = 0;
      } else if (++idle >= kPatience) {
        // Small groups may be nothing but borders: at the very last, larger ones.
        if (last_resort && uint64_t{grouping_.max_group} >= pending_.size()) break;
        if (last_resort) grow_groups();
        last_resort = true;
        idle = 0;
      }
    }
    if (pending_.size() > 0) write_roots();
    finish();
    return std::move(dag_);
  }

 private:
  // What goes on to the next level, in the order of the groups.
  struct Next {
    std::vector<ClusterRef> clusters;
    std::vector<Sphere> spheres;
    std::vector<std::vector<Vec3>> samples;
  };

  Report& report() { return dag_.report; }

  void make_finest_level() {
    progress_.report(0.0, "clusters");
    clusterise_source(source_, config_, pending_, spheres_);
    order_vertices(source_, pending_);
    tbb::parallel_invoke([&] { report().degenerate_triangles = settle_source(source_, pending_); },
                         [&] { grouper_.prepare(pending_); });
    if (config_.measured_error) {
      surface_distance_ = std::make_unique<SurfaceDistance>(source_, pending_);
      samples_ = surface_distance_->first_samples(pending_);
    }
    writer_.reserve(pending_);
  }

  void grow_groups() {
    constexpr uint32_t kTimes = 4, kMost = 1u << 16;
    grouping_.min_group = std::min(grouping_.min_group * kTimes, kMost);
    grouping_.max_group = std::min(grouping_.max_group * kTimes, kMost);
  }

  // Whenever the source has got vertices.
  void grow() {
    grouper_.grow();
    locked_.resize(source_.mesh.positions.size(), 0);
  }

  // Nothing is gained by levels above a single cluster's worth of triangles.
  bool is_coarsest() const {
    return pending_.size() == 1 || pending_.triangle_count() <= config_.max_triangles;
  }

  // Whether the caller wants no more.
  bool is_deep_enough() const {
    return pending_.triangle_count() <= config_.stop_triangles ||
           (config_.max_levels > 0 && dag_.tables.levels.size() + 1 >= config_.max_levels);
  }

  // One round over all pending clusters. Returns how many groups there were.
  size_t simplify_level(bool last_resort) {
    const Clusters groups = grouper_.group(pending_, locked_, grouping_);
    grouper_.lock_borders(groups, locked_);
    // Half of what is left to do is this level.
    const double share = (1.0 - done_) * 0.5;
    std::vector<GroupResult> results = simplifier_.simplify(
        pending_, groups, locked_, last_resort,
        [&](double part) { progress_.report(done_ + share * part, "levels of detail"); });
    done_ += share;
    grow();
    std::vector<Measured> measured(results.size());
    if (surface_distance_) measure(groups, results, measured);
    join(groups, results, measured);
    return results.size();
  }

  void measure(const Clusters& groups, const std::vector<GroupResult>& results,
               std::vector<Measured>& measured) const {
    const uint32_t level = static_cast<uint32_t>(dag_.tables.levels.size());
    parallel_for(results.size(), 1, [&](size_t g) {
      if (!results[g].simplified.done) return;
      std::vector<Vec3> samples;
      for (uint32_t c : members_of(groups, g))
        samples.insert(samples.end(), samples_[c].begin(), samples_[c].end());
      measured[g] = surface_distance_->measure(results[g].clusters, samples, level);
    });
  }

  // Of a group's simplified form. Deviations add up (triangle inequality), whatever the quadrics of
  // one step say; if the distance to the source is known, it alone counts.
  float error_of(std::span<const uint32_t> members, const Simplified& simplified,
                 const Measured& measured) const {
    // What attributes lose does not add up from level to level.
    const float lost = std::max(simplified.attribute_error, simplified.removed_radius);
    float least = 0, sum = std::max(simplified.error, lost);
    for (uint32_t c : members) {
      const uint32_t generator = pending_.generating_group[c];
      if (generator == kNone) continue;
      const double below = dag_.tables.groups[generator].error * (1.0 + kErrorMargin);
      least = std::max(least, static_cast<float>(below));
      sum = std::max(sum, static_cast<float>(below + simplified.error));
    }
    if (!measured.valid) return sum;
    return std::max({least, lost, measured.bound});
  }

  // Counts how the estimate compares with the measured distance.
  void compare(std::span<const uint32_t> members, const Simplified& simplified,
               const Measured& measured) {
    if (!measured.valid || !(measured.distance > 0)) return;
    const double ratio = error_of(members, simplified, Measured{}) / double{measured.distance};
    ++report().measured_groups;
    if (ratio < 1) ++report().underestimated_groups;
    if (ratio > 0) sum_of_logs_ += std::log2(ratio);
  }

  void join(const Clusters& groups, std::vector<GroupResult>& results,
            std::vector<Measured>& measured) {
    Next next;
    for (size_t g = 0; g < results.size(); ++g) {
      const Simplified& simplified = results[g].simplified;
      const auto members = members_of(groups, g);
      const float error = error_of(members, simplified, measured[g]);
      if (!simplified.done || error > config_.max_error) {
        const LimitingFactor limit =
            simplified.done ? LimitingFactor::kStopped : simplified.limiting_factor;
        ++report().waits_by_limiting_factor[static_cast<size_t>(limit)];
        for (uint32_t c : members) {
          next.clusters.push_back({&pending_, c});
          next.spheres.push_back(spheres_[c]);
          if (surface_distance_) next.samples.push_back(std::move(samples_[c]));
        }
        continue;
      }
      if (surface_distance_) compare(members, simplified, measured[g]);
      const uint32_t id = writer_.add_group(pending_, spheres_,
                                            {members, simplified.method, simplified.limiting_factor,
                                             error, results[g].new_positions});
      ClusterSet& made = results[g].clusters;
      std::fill(made.generating_group.begin(), made.generating_group.end(), id);
      for (uint32_t c = 0; c < made.size(); ++c) {
        next.clusters.push_back({&made, c});
        next.spheres.push_back(dag_.tables.groups[id].sphere);
        if (surface_distance_) next.samples.push_back(std::move(measured[g].samples[c]));
      }
    }
    writer_.finish_level(pending_);
    pending_ = gather_clusters(next.clusters);
    spheres_ = std::move(next.spheres);
    samples_ = std::move(next.samples);
  }

  // What is left becomes one root group, or several where simplification could go no further and
  // one group would be too large.
  void write_roots() {
    const bool coarsest = is_coarsest();
    const bool wished = is_deep_enough() || config_.max_error < kInfinity;
    const LimitingFactor limit = coarsest ? LimitingFactor::kCoarsest
                                 : wished ? LimitingFactor::kStopped
                                          : LimitingFactor::kStuck;
    Clusters roots;
    if (coarsest || pending_.size() <= config_.max_group) {
      for (uint32_t c = 0; c < pending_.size(); ++c) roots.items.push_back(c);
      roots.ranges = {{0, static_cast<uint32_t>(pending_.size())}};
    } else {
      roots = grouper_.group(pending_, locked_, config_);
    }
    for (size_t g = 0; g < roots.ranges.size(); ++g)
      writer_.add_group(pending_, spheres_,
                        {members_of(roots, g), SimplifyMethod::kRoot, limit, kInfinity});
    writer_.finish_level(pending_);
    report().root_triangles = pending_.triangle_count();
    report().root_groups = static_cast<uint32_t>(roots.ranges.size());
    report().stuck_groups = coarsest || wished ? 0 : report().root_groups;
  }

  void finish() {
    if (report().measured_groups > 0)
      report().mean_log2_overestimate = sum_of_logs_ / report().measured_groups;
    dag_.tables.nodes = build_hierarchy(dag_.tables);
    dag_.vertices = std::move(source_.mesh);
    dag_.vertices.triangles = {};
    dag_.vertices.materials = {};
    if (config_.mix_materials && !source_.vertex_materials.empty())
      keep_vertex_materials(source_.vertex_materials, dag_.vertices);
    progress_.report(1.0, "done");
  }

  Config config_;
  Config grouping_;  // the same, with larger groups once nothing else helps
  Progress progress_;
  Source source_;
  Grouper grouper_;
  LevelSimplifier simplifier_;
  Dag dag_;
  DagWriter writer_;
  std::vector<uint8_t> locked_;                        // by position id
  ClusterSet pending_;                                 // clusters that wait for a group
  std::vector<Sphere> spheres_;                        // of them: generating groups', or their own
  std::unique_ptr<SurfaceDistance> surface_distance_;  // with Config::measured_error
  std::vector<std::vector<Vec3>> samples_;             // of pending_, see measure.hpp
  double sum_of_logs_ = 0;
  double done_ = 0.1;  // part of all work
};

Dag build_valid(const MeshView& mesh, const Config& config, const BuildOptions& options,
                const Decimator& decimate) {
  if (config.position_step == 0) return Builder(mesh, config, options, decimate).run();
  std::vector<Vec3> positions(mesh.positions.begin(), mesh.positions.end());
  const float moved = snap_to_grid(positions, config.position_step);
  MeshView snapped = mesh;
  snapped.positions = positions;
  Dag dag = Builder(snapped, config, options, decimate).run();
  // Adding the same to all keeps them monotone.
  for (Group& group : dag.tables.groups) group.error += moved;
  for (Node& node : dag.tables.nodes) node.error += moved;
  dag.config.position_step = config.position_step;
  dag.report.largest_move = moved;
  return dag;
}

}  // namespace

Dag build(const MeshView& mesh, const Config& config, const BuildOptions& options,
          const Decimator& decimate) {
  check_config(mesh, config);
  validate(mesh, options.threads == 0 ? BuildOptions{} : BuildOptions{{}, options.threads});
  const auto start = std::chrono::steady_clock::now();
  Dag dag;
  with_threads(options.threads, [&] { dag = build_valid(mesh, config, options, decimate); });
  dag.report.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return dag;
}

}  // namespace umbel::lod
