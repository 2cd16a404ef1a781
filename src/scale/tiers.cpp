#include "scale/tiers.hpp"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/printed.hpp"
#include "base/refuse.hpp"
#include "lod/build/check_config.hpp"
#include "scale/build_partition.hpp"
#include "scale/join_parts.hpp"
#include "scale/point_rule.hpp"
#include "scale/route.hpp"
#include "scale/route_file.hpp"
#include "scale/run_task.hpp"
#include "scale/summary.hpp"
#include "scale/taken_positions.hpp"
#include "scale/tier_plan.hpp"
#include "scale/undecided_edges.hpp"
#include "scale/work_file.hpp"
#include "scale/work_folder.hpp"

namespace umbel::scale {
namespace {

namespace fs = std::filesystem;

// A tier that keeps more than this part of the triangles, by the rounds that it has, is followed by
// one of larger units: what is left is mostly borders.
double least_progress(uint32_t rounds) { return rounds > 1 ? 0.85 : 0.92; }

// What the passes over the input have found.
struct Passes {
  std::vector<SourceSummary> summary;
  std::vector<SourceMeasure> measure;
  std::vector<std::byte> partition;
};

template <typename Visit>
void for_each_array(Passes& passes, Visit& visit) {
  visit(passes.summary), visit(passes.measure), visit(passes.partition);
}

// Triangles that a pass reads between two reports.
constexpr uint64_t kStep = uint64_t{64} << 20;

// Enough cells for planes between them to come near enough, and no more for a small mesh.
uint32_t resolution_of(uint64_t triangles) {
  uint32_t resolution = 32;
  while (resolution < 256 && uint64_t{resolution} * resolution * resolution < 64 * triangles)
    resolution *= 2;
  return resolution;
}

void add_to(lod::Report& sum, const lod::Report& report) {
  sum.degenerate_triangles += report.degenerate_triangles;
  for (size_t i = 0; i < sum.waits_by_limiting_factor.size(); ++i)
    sum.waits_by_limiting_factor[i] += report.waits_by_limiting_factor[i];
  if (report.root_groups == 0) return;
  sum.root_groups = report.root_groups;
  sum.stuck_groups = report.stuck_groups;
  sum.root_triangles = report.root_triangles;
}

class Tiers {
 public:
  Tiers(const io::TriangleSource& source, const lod::Config& config, const ScaleConfig& scale,
        const fs::path& work, const TierOptions& options)
      : source_(source),
        config_(config),
        scale_(scale),
        capacity_of_units_(scale.capacity),
        rounds_(scale.rounds_of_tier()),
        work_(work),
        options_(options) {}

  BuiltTiers run() {
    begin();
    while (true) {
      run_tier();
      if (plan_.tier[0].is_last) break;
      next_tier();
    }
    return std::move(built_);
  }

 private:
  void report(double fraction, std::string_view stage) const {
    if (options_.progress) options_.progress(fraction, stage);
  }

  // The passes over the input but the last. What they found before is taken from the folder.
  void begin() {
    triangles_ = built_.report.input_triangles = source_.triangles();
    make_tier_folders(work_, 0);
    const Passes passes = find_passes();
    const SourceSummary& summary = passes.summary[0];
    rule_ = {choose_origin(summary), config_.position_step};
    built_.origin = rule_.origin;
    const SourceMeasure& measure = passes.measure[0];
    built_.source_digest = measure.digest;
    built_.report.largest_move = static_cast<float>(measure.largest_move);
    built_.collapsed_triangles = measure.degenerate;
    refuse_collapse(measure);
    refuse_materials(summary.largest_material);
    partition_ = Partition::from_bytes(passes.partition);
    shards_ = static_cast<uint32_t>((triangles_ + kShardTriangles - 1) / kShardTriangles);
    const io::SourceStreams streams = source_.streams();
    plan_.tier = {TierConfig{.config = config_, .box = box_of(summary, rule_), .rounds = rounds_}};
    plan_.shards = {shards_};
    plan_.streams = {streams.normals, streams.tangents, streams.uvs, streams.colors,
                     streams.materials};
    plan_.extras = streams.extras;
    const bool is_one = partition_.units() == 1;
    set_last(is_one);
    plan_.tier[0].is_whole = is_one;
    write_plan();
  }

  Passes find_passes() {
    const fs::path path = tier_folder(work_, 0) / "passes";
    const bool is_there = is_whole(path);
    Passes passes;
    if (is_there) {
      passes = read_record<Passes>(path);
      if (options_.input_is_same) return passes;
    }
    SourceSummary summary;
    for (uint64_t at = 0; at < triangles_; at += kStep) {
      report(0.02 * part(at), "reading");
      summary.merge(summarise(source_, at, std::min(at + kStep, triangles_)));
    }
    if (is_there) {
      if (summary.fingerprint != passes.summary[0].fingerprint ||
          summary.triangles != passes.summary[0].triangles)
        throw Error(ErrorCode::kInvalidArgument,
                    "the build in " + work_.string() +
                        " cannot be resumed: the input has changed since; remove the folder to "
                        "begin again");
      return passes;
    }
    passes.summary = {summary};
    passes.measure = {SourceMeasure{}};
    const PointRule rule{choose_origin(summary), config_.position_step};
    passes.measure[0].is_exact = summary.exact && rule.origin == Vec3d{0, 0, 0} ? 1 : 0;
    TakenPositions taken;
    CellPass pass{&passes.measure[0]};
    if (may_have_new_positions()) pass.taken = &(taken = TakenPositions(triangles_));
    passes.partition = partition_of_source(box_of(summary, rule), rule, pass).bytes();
    if (pass.taken) taken.write(taken_file(work_, 0));
    write_record(path, passes);
    return passes;
  }

  // As a build in memory does, before anything is built.
  void refuse_collapse(const SourceMeasure& measure) const {
    constexpr double kMost = 0.01;
    const auto collapsed = static_cast<double>(measure.degenerate);
    if (options_.force || collapsed <= kMost * static_cast<double>(triangles_)) return;
    throw Error(ErrorCode::kInvalidMesh,
                std::to_string(measure.degenerate) + " of " + std::to_string(triangles_) +
                    " triangles lost their area when positions were rounded to 32-bit floats, "
                    "which moved vertices by up to " +
                    printed(measure.largest_move) +
                    ": the mesh is too large for its finest details; build parts of it that lie "
                    "closer together, or build it as it is with force");
  }

  void refuse_materials(uint32_t largest) const {
    if (config_.mix_materials && largest > lod::kMostMixedMaterial)
      refuse("a triangle has the material " + std::to_string(largest) + ", at most " +
             std::to_string(lod::kMostMixedMaterial) + " is possible with mix_materials");
  }

  double part(uint64_t triangle) const {
    return triangles_ == 0 ? 1 : static_cast<double>(triangle) / static_cast<double>(triangles_);
  }

  // Where there are several units, those must be told what others have.
  bool may_have_new_positions() const {
    return config_.keep_area && source_.triangles() > capacity_of_units_;
  }

  // Of the source, and of all units of the tiers before.
  void write_taken(uint32_t tier) const {
    if (is_whole(taken_file(work_, tier))) return;
    TakenPositions taken;
    if (tier == 0) {
      taken = TakenPositions(source_.triangles());
      io::for_each_block(
          source_, 0, source_.triangles(), io::kBlockTriangles,
          [&](const io::TriangleBlock& block) { taken.add(points_of(block, rule_)); });
    } else {
      write_taken(tier - 1);
      taken = TakenPositions::read(taken_file(work_, tier - 1));
      const auto units = read_record<TierPlan>(plan_file(work_, tier)).shards.at(0);
      for (uint32_t u = 0; u < units; ++u) taken.add(left_of(tier - 1, u).new_positions);
    }
    taken.write(taken_file(work_, tier));
  }

  Partition partition_of_source(const Aabb& box, const PointRule& rule, CellPass pass) const {
    PartitionBuilder builder(
        box, {.capacity = scale_.capacity, .resolution = resolution_of(triangles_)});
    for (; !builder.is_done(); pass = {}) {  // once is enough
      CellCounts counts;
      for (uint64_t at = 0; at == 0 || at < triangles_; at += kStep) {
        report(0.02 + 0.03 * part(at), "dividing");
        CellCounts some =
            count_cells(source_, rule, builder, at, std::min(at + kStep, triangles_), pass);
        if (at == 0)
          counts = std::move(some);
        else
          counts.merge(some);
      }
      builder.advance(counts);
    }
    return builder.finished();
  }

  // Runs tasks that need no report of their own, but for those that are done.
  void sort_elsewhere(uint32_t files) const {
    std::vector<Task> missing;
    for (uint32_t s = 0; s < files; ++s)
      if (!is_sorted(s)) missing.push_back({tier_, s, TaskKind::kSort});
    if (missing.empty()) return;
    options_.run(missing, [&](size_t /*done*/) { report(fraction_, "sorting"); });
  }

  bool is_sorted(uint32_t file) const {
    // Whether the file itself is whole, whoever needs it will see.
    if (options_.delegation.is_stand_in) return is_whole(places_file(work_, tier_, file));
    const fs::path path = shard_file(work_, tier_, file);
    return tier_ == 0 ? is_whole_route(path) : is_whole(path);
  }

  // The last pass over the input, but for the files that are there and whole.
  void route_source() const {
    // Who shares a leaf depends on all triangles before.
    if (options_.delegation.source && partition_.shared_leaves() == 0) {
      try {
        return sort_elsewhere(shards_);
      } catch (const Error& error) {
        // Where others cannot read the source, this process does it.
        if (error.code() != ErrorCode::kIo) throw;
      }
    }
    SharedLeafCounts before;
    for (uint32_t s = 0; s < shards_; ++s) {
      const uint64_t begin = s * kShardTriangles;
      const uint64_t end = std::min(begin + kShardTriangles, triangles_);
      report(0.05 + 0.05 * part(begin), "sorting");
      const fs::path path = shard_file(work_, 0, s);
      if (!is_whole_route(path) && !(options_.delegation.is_stand_in && is_sorted(s)))
        route_shard(source_, partition_, {rule_, scale_.capacity}, before, begin, end, path);
      for (const auto& [leaf, count] : count_shared_leaves(source_, rule_, partition_, begin, end))
        before[leaf] += count;
    }
  }

  void set_last(bool is_last) {
    plan_.tier[0].is_last = is_last;
    // How many triangles there are in all, only the last unit knows.
    plan_.tier[0].config.stop_triangles = is_last ? config_.stop_triangles : 0;
  }

  void write_plan() {
    plan_.first_serial = {serial_};
    plan_.capacity = {scale_.capacity};
    plan_.rule = {rule_};
    plan_.partition = partition_.bytes();
    write_record(plan_file(work_, tier_), plan_);
  }

  // Whether a unit was built before, and nothing of it has been damaged since.
  bool is_done(const Task& task) const {
    const fs::path done = unit_file(work_, task, ".done");
    if (!fs::exists(done)) return false;
    const auto has = [&](const char* what) { return is_whole(unit_file(work_, task, what)); };
    const bool has_data = options_.delegation.is_stand_in || (has(".parts") && has(".exits"));
    if (has_data && is_whole(done) && has(".groups") && has(".left")) return true;
    fs::remove(done);
    return false;
  }

  void run_tier() {
    std::vector<Task> tasks, missing;
    for (uint32_t u = 0; u < partition_.units(); ++u) {
      tasks.push_back({tier_, u});
      if (!is_done(tasks.back())) missing.push_back(tasks.back());
    }
    const double share = plan_.tier[0].is_last ? 0.9 - fraction_ : 0.75 * (0.9 - fraction_);
    if (!missing.empty()) {
      if (tier_ == 0)
        route_source();
      else
        route_tier();
      if (may_have_new_positions()) write_taken(tier_);
      const std::string stage = "tier " + std::to_string(tier_ + 1) + ", " +
                                std::to_string(tasks.size()) +
                                (tasks.size() == 1 ? " unit" : " units");
      options_.run(missing, [&](size_t done) {
        const double all = static_cast<double>(tasks.size());
        const double so_far = static_cast<double>(tasks.size() - missing.size() + done) / all;
        report(fraction_ + share * so_far, stage);
      });
    }
    fraction_ += share;
    uint64_t left = 0;
    undecided_ = 0;
    uint32_t next_level = plan_.tier[0].level;
    for (const Task& task : tasks) {
      const auto summary = read_record<UnitSummary>(unit_file(work_, task, ".done"));
      left += summary.triangles[0];
      undecided_ += summary.undecided[0];
      next_level = std::max(next_level, summary.next_level[0]);
      add_to(built_.report, summary.report[0]);
      built_.parts.push_back(unit_file(work_, task, ".parts"));
      built_.units.push_back(task);
    }
    if (static_cast<double>(left) > least_progress(rounds_) * static_cast<double>(triangles_))
      scale_.capacity *= 2;
    triangles_ = left;
    plan_.tier[0].level = next_level;
    serial_ += partition_.units();
    remove_routes();
  }

  // The largest files, and no unit needs them any more. Should one have to be built again, they are
  // made again.
  void remove_routes() const {
    for (uint32_t s = 0; s < plan_.shards[0]; ++s) {
      fs::remove(shard_file(work_, tier_, s));
      // What others sorted is where they are.
      if (!options_.delegation.is_stand_in) fs::remove(places_file(work_, tier_, s));
    }
  }

  ExitSummary left_of(uint32_t tier, uint32_t unit) const {
    return read_record<ExitSummary>(unit_file(work_, {tier, unit}, ".left"));
  }

  // Its plan; the way there is only taken once a unit of it must be built.
  void next_tier() {
    const uint32_t units = partition_.units();
    make_tier_folders(work_, tier_ + 1);
    const fs::path path = plan_file(work_, tier_ + 1);
    set_last(triangles_ <= scale_.capacity);
    if (is_whole(path)) {
      plan_ = read_record<TierPlan>(path);
      partition_ = Partition::from_bytes(plan_.partition);
      ++tier_;
      return;
    }
    report(fraction_, "planning");
    plan_.non_manifold = tier_ == 0 ? decide_edges(units) : std::vector<PositionEdge>{};
    partition_ = plan_.tier[0].is_last ? Partition() : partition_of_exits(units);
    plan_.shards = {units};
    plan_.shared = shared_before(units);
    ++tier_;
    write_plan();
  }

  // Which of the units that share a leaf gets a cluster depends on all that were left before.
  std::vector<SharedBefore> shared_before(uint32_t units) const {
    std::vector<SharedBefore> all;
    if (partition_.shared_leaves() == 0) return all;
    SharedLeafCounts counts;
    for (uint32_t u = 0; u < units; ++u) {
      for (const auto& [leaf, triangles] : counts) all.push_back({u, leaf, triangles});
      const ExitSummary left = left_of(tier_, u);
      for (size_t c = 0; c < left.middles.size(); ++c)
        if (const uint32_t leaf = partition_.leaf(left.middles[c]); partition_.unit_count(leaf) > 1)
          counts[leaf] += left.triangles[c];
    }
    return all;
  }

  void route_tier() const {
    if (options_.delegation.sorting) return sort_elsewhere(plan_.shards[0]);
    for (uint32_t u = 0; u < plan_.shards[0]; ++u) {
      report(fraction_, "sorting");
      if (!is_sorted(u)) run_task(work_, {tier_, u, TaskKind::kSort});
    }
  }

  std::vector<PositionEdge> decide_edges(uint32_t units) const {
    UndecidedEdges edges(tier_folder(work_, 0) / "edges", undecided_);
    for (uint32_t u = 0; u < units; ++u) edges.add(left_of(0, u).undecided);
    return edges.non_manifold();
  }

  // By their clusters' places.
  Partition partition_of_exits(uint32_t units) const {
    PartitionBuilder builder(
        plan_.tier[0].box,
        {.capacity = scale_.capacity, .tier = tier_ + 1, .resolution = resolution_of(triangles_)});
    while (!builder.is_done()) {
      CellCounts counts = builder.empty_counts();
      for (uint32_t u = 0; u < units; ++u) {
        const ExitSummary left = left_of(tier_, u);
        for (size_t c = 0; c < left.middles.size(); ++c)
          builder.count(counts, left.middles[c], left.triangles[c]);
      }
      builder.advance(counts);
    }
    return builder.finished();
  }

  const io::TriangleSource& source_;
  const lod::Config& config_;
  ScaleConfig scale_;
  const uint64_t capacity_of_units_;  // of the first tier
  const uint32_t rounds_;
  const fs::path& work_;
  const TierOptions& options_;
  BuiltTiers built_;
  TierPlan plan_;
  PointRule rule_;
  Partition partition_;
  uint32_t tier_ = 0, serial_ = 0, shards_ = 0;
  uint64_t triangles_ = 0, undecided_ = 0;
  double fraction_ = 0.1;
};

}  // namespace

void check_config(const lod::Config& config, const io::SourceStreams& streams) {
  static constexpr uint32_t kAny = 0;
  MeshView mesh;
  mesh.extras = streams.extras;
  if (streams.materials) mesh.materials = {&kAny, 1};
  lod::check_config(mesh, config);
}

BuiltTiers build_tiers(const io::TriangleSource& source, const lod::Config& given,
                       const ScaleConfig& scale, const std::filesystem::path& work,
                       const TierOptions& options) {
  const lod::Config config = lod::with_limits(given);
  check_config(config, source.streams());
  if (config.measured_error)
    throw Error(ErrorCode::kUnsupported,
                "measured_error needs the whole mesh in memory: leave it out, or build in memory");
  if (config.position_step != 0)
    throw Error(ErrorCode::kUnsupported, "position_step is not possible unit by unit yet");
  if (config.lock_borders)
    throw Error(ErrorCode::kUnsupported, "lock_borders is not possible unit by unit yet");
  return Tiers(source, config, scale, work, options).run();
}

lod::Dag build_in_tiers(const io::TriangleSource& source, const lod::Config& config,
                        const ScaleConfig& scale, const std::filesystem::path& work,
                        const TaskRunner& run_tasks) {
  TierOptions options;
  options.run = [&](std::span<const Task> tasks, const auto&) { run_tasks(tasks); };
  const BuiltTiers built = build_tiers(source, config, scale, work, options);
  lod::Dag dag;
  dag.config = config;
  dag.report = built.report;
  dag.source_digest = built.source_digest;
  join_parts(built.parts, dag);
  return dag;
}

}  // namespace umbel::scale
