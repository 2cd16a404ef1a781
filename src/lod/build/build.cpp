// Builds the DAG of clusters of continuous level of detail (Karis, "Nanite: A Deep Dive",
// SIGGRAPH 2021): clusters, groups, simplification of each group with its border locked, clusters
// again, until one group is left. Groups of a level are independent and run in parallel; results
// are joined in the order of the groups.
#include "umbel/lod/build.hpp"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>

#include "base/big_vector.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "lod/build/clusterise.hpp"
#include "lod/build/group.hpp"
#include "lod/build/hierarchy.hpp"
#include "lod/build/measure.hpp"
#include "lod/build/new_positions.hpp"
#include "lod/dag/bounds.hpp"
#include "lod/dag/locked_edges.hpp"
#include "lod/dag/source.hpp"
#include "lod/simplify/simplify.hpp"

namespace umbel::lod {
namespace {

// A level that keeps more than this part of the triangles counts as idle.
constexpr double kLeastProgress = 0.98;
// Idle levels before the last resort is allowed, and after it before the build ends with what is
// left as its roots.
constexpr int kPatience = 2;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

void check(const Config& config) {
  const auto require = [](bool holds, const std::string& sentence) {
    if (!holds) throw Error(ErrorCode::kInvalidArgument, sentence);
  };
  require(config.max_triangles >= 4 && config.max_triangles <= 256,
          "max_triangles is " + std::to_string(config.max_triangles) + ", must be in [4, 256]");
  require(config.max_vertices >= 6 && config.max_vertices <= 256,
          "max_vertices is " + std::to_string(config.max_vertices) + ", must be in [6, 256]");
  require(config.min_group >= 2 && config.min_group <= config.max_group && config.max_group <= 1024,
          "group size is " + std::to_string(config.min_group) + ":" +
              std::to_string(config.max_group) + ", must be 2 <= min <= max <= 1024");
  require(config.ratio >= 0.1f && config.ratio <= 0.9f,
          "ratio is " + std::to_string(config.ratio) + ", must be in [0.1, 0.9]");
  for (float weight : {config.normal_weight, config.uv_weight, config.color_weight,
                       config.tangent_weight, config.skin_weight})
    require(weight >= 0.0f && weight <= 1e3f,
            "an attribute weight is " + std::to_string(weight) + ", must be in [0, 1000]");
  require(config.max_error >= 0.0f,
          "max_error is " + std::to_string(config.max_error) + ", must be at least 0");
}

class Builder {
 public:
  Builder(const MeshView& mesh, const Config& config, const BuildOptions& options,
          const Decimator& decimate)
      : config_(config),
        groups_of_(config),
        progress_(options),
        grouper_(source_),
        workers_(
            [this, &decimate] { return std::make_unique<Worker>(source_, config_, decimate); }) {
    dag_.config = config;
    tbb::parallel_invoke([&] { source_ = make_source(mesh, BuildOptions{}); },
                         [&] { dag_.source_digest = triangle_set_digest(mesh); });
    grow();
    dag_.vertex_offsets = dag_.triangle_offsets = {0};
    report().input_triangles = mesh.triangles.size();
    report().input_vertices = mesh.positions.size();
  }

  Dag run() {
    progress_.report(0.0, "clusters");
    clusterise_source(source_, config_, pending_, own_spheres_);
    order_vertices(source_, pending_);
    tbb::parallel_invoke([&] { report().degenerate_triangles = settle_source(source_, pending_); },
                         [&] { grouper_.prepare(pending_); });
    if (config_.measured_error) {
      surface_distance_ = std::make_unique<SurfaceDistance>(source_, pending_);
      samples_ = surface_distance_->first_samples(pending_);
    }
    reserve_output();
    int idle = 0;
    bool last_resort = false;
    while (pending_.size() > 0 && !is_coarsest() && !is_deep_enough()) {
      const size_t before = pending_.triangle_count();
      const double enough = before * kLeastProgress;
      simplify_level(last_resort);
      // One group that is what it was would be so again.
      if (groups_in_round_ == 1 && pending_.triangle_count() == before) idle = kPatience;
      if (pending_.triangle_count() <= enough) {
        idle = 0;
      } else if (++idle >= kPatience) {
        // Small groups may be nothing but borders: at the very last, larger ones.
        if (last_resort && uint64_t{groups_of_.max_group} >= pending_.size()) break;
        if (last_resort) grow_groups();
        last_resort = true;
        idle = 0;
      }
    }
    if (pending_.size() > 0) emit_roots();
    finish();
    return std::move(dag_);
  }

 private:
  struct Worker {
    GroupSimplifier simplifier;
    Clusteriser clusteriser;
    Worker(const Source& source, const Config& config, const Decimator& decimate)
        : simplifier(source, config, decimate), clusteriser(config) {}
  };
  struct GroupResult {
    Simplified simplified;
    ClusterSet clusters;  // of the simplified triangles; generating_group is set when joined
    Measured measured;    // with Config::measured_error
    std::vector<Vec3> new_positions;  // that the group did not have
  };

  Report& report() { return dag_.report; }
  Tables& tables() { return dag_.tables; }

  void grow_groups() {
    constexpr uint32_t kTimes = 4, kMost = 1u << 16;
    groups_of_.min_group = std::min(groups_of_.min_group * kTimes, kMost);
    groups_of_.max_group = std::min(groups_of_.max_group * kTimes, kMost);
  }

  // Whenever the source has got vertices.
  void grow() {
    grouper_.grow();
    locked_.resize(source_.mesh.positions.size(), 0);
  }

  // For levels that shrink as they are asked to.
  void reserve_output() {
    const double levels = 1.05 / (1.0 - double{config_.ratio});
    const auto with_levels = [&](size_t count) { return static_cast<size_t>(levels * count); };
    reserve_big(dag_.cluster_vertices, with_levels(pending_.vertices.size()));
    reserve_big(dag_.cluster_triangles, with_levels(pending_.corners.size()));
    reserve_big(dag_.vertex_offsets, with_levels(pending_.size()));
    reserve_big(dag_.triangle_offsets, with_levels(pending_.size()));
    reserve_big(tables().clusters, with_levels(pending_.size()));
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

  // One round over all pending clusters.
  void simplify_level(bool last_resort) {
    const Clusters groups = grouper_.group(pending_, locked_, groups_of_);
    groups_in_round_ = groups.ranges.size();
    grouper_.lock_borders(groups, locked_);
    insert_own_locked_edges(groups);
    std::vector<GroupResult> results(groups.ranges.size());
    constexpr size_t kBatch = 256;  // groups between two calls of the progress callback
    for (size_t begin = 0; begin < results.size(); begin += kBatch) {
      const size_t count = std::min(kBatch, results.size() - begin);
      parallel_for(count, 1, [&](size_t i) {
        const Range range = groups.ranges[begin + i];
        results[begin + i] = simplify_group(
            std::span(groups.items).subspan(range.offset, range.count),
            {.locked_edges = true, .last_resort = last_resort, .taken = &locked_edges_});
      });
      // Half of what is left to do is this level.
      const double level_part = static_cast<double>(begin + count) / results.size();
      progress_.report(done_ + (1.0 - done_) * 0.5 * level_part, "levels of detail");
    }
    done_ += (1.0 - done_) * 0.5;
    settle_locked_edges(groups, results, last_resort);
    settle_added(results);
    keep_one_triangle(groups, results);
    if (surface_distance_) measure(groups, results);
    join(groups, results);
  }

  void insert_own_locked_edges(const Clusters& groups) {
    std::vector<std::vector<PositionPair>> edges(groups.ranges.size());
    parallel_for(edges.size(), 4, [&](size_t g) {
      const Range range = groups.ranges[g];
      edges[g] =
          own_locked_edges(pending_, std::span(groups.items).subspan(range.offset, range.count),
                           source_.position_ids, locked_);
    });
    for (const std::vector<PositionPair>& of_group : edges) locked_edges_.insert(of_group);
  }

  // Groups with a chord that another group has laid as well are simplified again without any.
  void settle_locked_edges(const Clusters& groups, std::vector<GroupResult>& results,
                           bool last_resort) {
    std::vector<size_t> refused;
    for (size_t g = 0; g < results.size(); ++g) {
      if (locked_edges_.contains_any(results[g].simplified.locked_edges))
        refused.push_back(g);
      else
        locked_edges_.insert(results[g].simplified.locked_edges);
    }
    parallel_for(refused.size(), 1, [&](size_t i) {
      const Range range = groups.ranges[refused[i]];
      results[refused[i]] =
          simplify_group(std::span(groups.items).subspan(range.offset, range.count),
                         {.locked_edges = false, .last_resort = last_resort, .taken = nullptr});
    });
  }

  // Vertices that groups have made get their numbers.
  void settle_added(std::vector<GroupResult>& results) {
    bool any = false;
    for (size_t g = 0; g < results.size(); ++g) {
      Simplified& simplified = results[g].simplified;
      if (simplified.added.position_ids.empty()) continue;
      any = true;
      float moved = 0;
      if (!simplified.added.components.empty() || !new_positions_.is_empty())
        moved = new_positions_.set_apart(source_, config_.position_step, simplified.added);
      simplified.error += moved;
      const uint32_t first = append_vertices(source_, simplified.added);
      for (size_t v = 0; v < simplified.added.position_ids.size(); ++v)
        if (simplified.added.position_ids[v] == kNone)
          results[g].new_positions.push_back(simplified.added.mesh.positions[v]);
      for (uint32_t& v : results[g].clusters.vertices)
        if (v >= kAddedVertex) v = first + (v - kAddedVertex);
      if (moved > 0) fit_boxes(results[g].clusters);
      simplified.added = {};
    }
    if (any) grow();
  }

  void fit_boxes(ClusterSet& clusters) const {
    for (size_t c = 0; c < clusters.size(); ++c) {
      clusters.boxes[c] = {};
      for (uint32_t v : clusters.cluster_vertices(c))
        extend(clusters.boxes[c], source_.mesh.positions[v]);
    }
  }

  // Groups may leave nothing behind, where every triangle is degenerate, or where one group is all
  // that is left. A DAG still ends in a root: the first triangle stays, or where it has two sides
  // both, so that a closed surface stays closed.
  void keep_one_triangle(const Clusters& groups, std::vector<GroupResult>& results) {
    if (std::any_of(results.begin(), results.end(), [](const GroupResult& r) {
          return !r.simplified.done || r.clusters.size() > 0;
        }))
      return;
    std::vector<Triangle> kept;
    const Range first = groups.ranges[0];
    for (uint32_t c : std::span(groups.items).subspan(first.offset, first.count)) {
      const auto vertices = pending_.cluster_vertices(c);
      const auto corners = pending_.cluster_corners(c);
      for (size_t i = 0; i < corners.size(); i += 3) {
        const Triangle t{vertices[corners[i]], vertices[corners[i + 1]], vertices[corners[i + 2]]};
        if (kept.empty()) kept = {t};
        if (kept.size() == 1 && !is_degenerate(t)) kept = {t, {t[0], t[2], t[1]}};
      }
    }
    SubMesh sub_mesh;
    const auto number = [&](uint32_t v) {
      const auto at = std::find(sub_mesh.vertices.begin(), sub_mesh.vertices.end(), v);
      const size_t found = at - sub_mesh.vertices.begin();
      if (at == sub_mesh.vertices.end()) {
        sub_mesh.vertices.push_back(v);
        sub_mesh.positions.push_back(source_.mesh.positions[v]);
        if (!source_.vertex_materials.empty()) sub_mesh.materials.push_back(source_.material(v));
      }
      return static_cast<uint32_t>(found);
    };
    for (const Triangle& t : kept)
      sub_mesh.triangles.push_back({number(t[0]), number(t[1]), number(t[2])});
    workers_.local()->clusteriser.append(sub_mesh, kNone, results[0].clusters);
  }

  bool is_degenerate(const Triangle& t) const {
    const auto& ids = source_.position_ids;
    return ids[t[0]] == ids[t[1]] || ids[t[1]] == ids[t[2]] || ids[t[2]] == ids[t[0]];
  }

  GroupResult simplify_group(std::span<const uint32_t> clusters, Allowance allow) {
    Worker& worker = *workers_.local();
    GroupResult result;
    result.simplified = worker.simplifier.simplify(pending_, clusters, locked_, allow);
    if (result.simplified.done)
      worker.clusteriser.append(worker.simplifier.left(), kNone, result.clusters);
    return result;
  }

  void measure(const Clusters& groups, std::vector<GroupResult>& results) {
    parallel_for(results.size(), 1, [&](size_t g) {
      if (!results[g].simplified.done) return;
      const Range range = groups.ranges[g];
      std::vector<Vec3> samples;
      for (uint32_t c : std::span(groups.items).subspan(range.offset, range.count))
        samples.insert(samples.end(), samples_[c].begin(), samples_[c].end());
      results[g].measured = surface_distance_->measure(
          results[g].clusters, samples, static_cast<uint32_t>(tables().levels.size()));
    });
  }

  // Of a group's simplified form. Deviations add up (triangle inequality), whatever the quadrics of
  // one step say; if the distance to the source is known, it alone counts.
  float error_of(std::span<const uint32_t> members, const GroupResult& result) const {
    const Simplified& simplified = result.simplified;
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
    if (!result.measured.valid) return sum;
    return std::max({least, lost, result.measured.bound});
  }

  void compare(const GroupResult& result, std::span<const uint32_t> members) {
    if (!result.measured.valid || !(result.measured.distance > 0)) return;
    GroupResult unmeasured;
    unmeasured.simplified.error = result.simplified.error;
    unmeasured.simplified.attribute_error = result.simplified.attribute_error;
    unmeasured.simplified.removed_radius = result.simplified.removed_radius;
    const double ratio = error_of(members, unmeasured) / double{result.measured.distance};
    ++report().measured_groups;
    if (ratio < 1) ++report().underestimated_groups;
    if (ratio > 0) sum_of_logs_ += std::log2(ratio);
  }

  void join(const Clusters& groups, std::vector<GroupResult>& results) {
    std::vector<ClusterRef> next;
    std::vector<std::vector<Vec3>> next_samples;
    std::vector<Sphere> next_spheres;
    const uint32_t first_group = static_cast<uint32_t>(tables().groups.size());
    for (size_t g = 0; g < results.size(); ++g) {
      const Range range = groups.ranges[g];
      const auto members = std::span(groups.items).subspan(range.offset, range.count);
      const float error = error_of(members, results[g]);
      const LimitingFactor limiting_factor = results[g].simplified.limiting_factor;
      if (!results[g].simplified.done || error > config_.max_error) {
        ++report().waits_by_limiting_factor[static_cast<size_t>(
            results[g].simplified.done ? LimitingFactor::kStopped : limiting_factor)];
        for (uint32_t c : members) {
          next.push_back({&pending_, c});
          next_spheres.push_back(own_spheres_[c]);
          if (surface_distance_) next_samples.push_back(std::move(samples_[c]));
        }
        continue;
      }
      if (surface_distance_) compare(results[g], members);
      const uint32_t id = emit_group(members, results[g].simplified.method, limiting_factor, error,
                                     results[g].new_positions);
      ClusterSet& made = results[g].clusters;
      std::fill(made.generating_group.begin(), made.generating_group.end(), id);
      for (uint32_t c = 0; c < made.size(); ++c) {
        next.push_back({&made, c});
        next_spheres.push_back(tables().groups[id].sphere);
        if (surface_distance_) next_samples.push_back(std::move(results[g].measured.samples[c]));
      }
    }
    samples_ = std::move(next_samples);
    const uint32_t end = static_cast<uint32_t>(tables().groups.size());
    if (end == first_group) {
      pending_ = gather_clusters(next);
      own_spheres_ = std::move(next_spheres);
      return;
    }
    tables().levels.push_back({first_group, end - first_group});
    emit_clusters(first_group);
    pending_ = gather_clusters(next);
    own_spheres_ = std::move(next_spheres);
  }

  // A new group of pending clusters, which `emit_clusters` then moves into the DAG.
  uint32_t emit_group(std::span<const uint32_t> members, SimplifyMethod method,
                      LimitingFactor limiting_factor, float error,
                      std::span<const Vec3> new_positions = {}) {
    const uint32_t id = static_cast<uint32_t>(tables().groups.size());
    std::vector<uint32_t> generators;
    std::vector<Sphere> spheres;
    Group group;
    group.clusters = {static_cast<uint32_t>(tables().clusters.size() + emitted_.size()),
                      static_cast<uint32_t>(members.size())};
    group.level = static_cast<uint32_t>(tables().levels.size());
    group.method = method;
    group.error = error;
    for (uint32_t c : members) {
      const uint32_t generator = pending_.generating_group[c];
      if (generator == kNone) {
        spheres.push_back(own_spheres_[c]);
      } else if (std::find(generators.begin(), generators.end(), generator) == generators.end()) {
        generators.push_back(generator);
        spheres.push_back(own_spheres_[c]);
      }
      emitted_.push_back(c);
    }
    for (const Vec3& p : new_positions) spheres.push_back({p, 0.0f});
    group.sphere = enclosing_sphere(spheres);
    tables().groups.push_back(group);
    dag_.limiting_factors.push_back(limiting_factor);
    ++report().groups_by_method[static_cast<size_t>(method)];
    ++report().groups_by_limiting_factor[static_cast<size_t>(method)]
                                        [static_cast<size_t>(limiting_factor)];
    return id;
  }

  // Those of the groups from `first_group` on.
  void emit_clusters(uint32_t first_group) {
    const size_t first = tables().clusters.size();
    tables().clusters.resize(first + emitted_.size());
    for (size_t i = 0; i < emitted_.size(); ++i) {
      const uint32_t c = emitted_[i];
      dag_.vertex_offsets.push_back(dag_.vertex_offsets.back() +
                                    static_cast<uint32_t>(pending_.cluster_vertices(c).size()));
      dag_.triangle_offsets.push_back(dag_.triangle_offsets.back() +
                                      pending_.triangle_offsets[c + 1] -
                                      pending_.triangle_offsets[c]);
    }
    dag_.cluster_vertices.resize(dag_.vertex_offsets.back());
    dag_.cluster_triangles.resize(3 * size_t{dag_.triangle_offsets.back()});
    parallel_for(emitted_.size(), 128, [&](size_t i) {
      const uint32_t c = emitted_[i];
      const auto vertices = pending_.cluster_vertices(c);
      const auto corners = pending_.cluster_corners(c);
      tables().clusters[first + i] = {kNone,
                                      pending_.generating_group[c],
                                      pending_.material[c],
                                      static_cast<uint32_t>(vertices.size()),
                                      static_cast<uint32_t>(corners.size() / 3),
                                      pending_.boxes[c]};
      std::ranges::copy(vertices, dag_.cluster_vertices.begin() + dag_.vertex_offsets[first + i]);
      std::ranges::copy(
          corners, dag_.cluster_triangles.begin() + 3 * size_t{dag_.triangle_offsets[first + i]});
    });
    emitted_.clear();
    for (uint32_t g = first_group; g < tables().groups.size(); ++g) {
      const Range range = tables().groups[g].clusters;
      for (uint32_t c = range.offset; c < range.offset + range.count; ++c)
        tables().clusters[c].group = g;
    }
  }

  // What is left becomes one root group, or several where simplification could go no further and
  // one group would be too large.
  void emit_roots() {
    const bool coarsest = is_coarsest();
    const bool wished = is_deep_enough() || config_.max_error < kInfinity;
    const LimitingFactor limiting_factor = coarsest ? LimitingFactor::kCoarsest
                                           : wished ? LimitingFactor::kStopped
                                                    : LimitingFactor::kStuck;
    report().root_triangles = pending_.triangle_count();
    const uint32_t first_group = static_cast<uint32_t>(tables().groups.size());
    Clusters roots;
    if (coarsest || pending_.size() <= config_.max_group) {
      for (uint32_t c = 0; c < pending_.size(); ++c) roots.items.push_back(c);
      roots.ranges = {{0, static_cast<uint32_t>(pending_.size())}};
    } else {
      roots = grouper_.group(pending_, locked_, config_);
    }
    for (const Range& range : roots.ranges)
      emit_group(std::span(roots.items).subspan(range.offset, range.count), SimplifyMethod::kRoot,
                 limiting_factor, kInfinity);
    emit_clusters(first_group);
    report().root_groups = static_cast<uint32_t>(roots.ranges.size());
    report().stuck_groups = coarsest || wished ? 0 : report().root_groups;
    tables().levels.push_back({first_group, report().root_groups});
  }

  void finish() {
    if (report().measured_groups > 0)
      report().mean_log2_overestimate = sum_of_logs_ / report().measured_groups;
    tables().nodes = build_hierarchy(tables());
    dag_.vertices = std::move(source_.mesh);
    dag_.vertices.triangles = {};
    dag_.vertices.materials = {};
    if (config_.mix_materials && !source_.vertex_materials.empty()) keep_vertex_materials();
    progress_.report(1.0, "done");
  }

  // As one more attribute.
  void keep_vertex_materials() {
    Mesh& mesh = dag_.vertices;
    const size_t width = extra_width(mesh.extras), count = mesh.positions.size();
    std::vector<float> values((width + 1) * count);
    for (size_t v = 0; v < count; ++v) {
      std::copy_n(mesh.extra_values.begin() + width * v, width, values.begin() + (width + 1) * v);
      values[(width + 1) * v + width] = static_cast<float>(source_.vertex_materials[v]);
    }
    mesh.extra_values = std::move(values);
    mesh.extras.push_back({ExtraKind::kMaterial, 0});
  }

  Config config_;
  Config groups_of_;  // the same, but for the sizes of groups once nothing else helps
  Progress progress_;
  Source source_;
  Grouper grouper_;
  std::vector<uint8_t> locked_;  // by position id
  LockedEdgeSet locked_edges_;
  NewPositions new_positions_;
  tbb::enumerable_thread_specific<std::unique_ptr<Worker>> workers_;
  ClusterSet pending_;
  std::vector<uint32_t> emitted_;    // pending clusters of new groups, group by group
  std::vector<Sphere> own_spheres_;  // of each pending cluster: its generating group's, or its own
  std::unique_ptr<SurfaceDistance> surface_distance_;  // with Config::measured_error
  std::vector<std::vector<Vec3>> samples_;             // of each pending cluster, see measure.hpp
  double sum_of_logs_ = 0;
  size_t groups_in_round_ = 0;
  double done_ = 0.1;  // part of all work
  Dag dag_;
};

}  // namespace

namespace {

// Materials of triangles are kept as floats where clusters mix them.
void check_materials(const MeshView& mesh, const Config& config) {
  if (!mesh.extras.empty() && mesh.extras.back().kind == ExtraKind::kMaterial)
    throw Error(ErrorCode::kInvalidArgument,
                "the extras have a material, which only levels of detail have: give `materials`");
  if (!config.mix_materials || mesh.materials.empty()) return;
  if (extra_width(mesh.extras) >= kMostExtraValues)
    throw Error(ErrorCode::kInvalidArgument,
                "the extras have " + std::to_string(extra_width(mesh.extras)) +
                    " values a vertex, but with mix_materials at most " +
                    std::to_string(kMostExtraValues - 1) + " are possible");
  for (size_t t = 0; t < mesh.materials.size(); ++t)
    if (mesh.materials[t] > 1u << 24)
      throw Error(ErrorCode::kInvalidArgument,
                  "triangle " + std::to_string(t) + " has the material " +
                      std::to_string(mesh.materials[t]) +
                      ", at most 16777216 is possible with mix_materials");
}

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
  check(config);
  check_materials(mesh, config);
  validate(mesh, options.threads == 0 ? BuildOptions{} : BuildOptions{{}, options.threads});
  const auto start = std::chrono::steady_clock::now();
  Dag dag;
  with_threads(options.threads, [&] { dag = build_valid(mesh, config, options, decimate); });
  dag.report.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return dag;
}

}  // namespace umbel::lod
