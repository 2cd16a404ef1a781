#include "scale/tiers.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "scale/build_partition.hpp"
#include "scale/exits.hpp"
#include "scale/join_parts.hpp"
#include "scale/point_rule.hpp"
#include "scale/route.hpp"
#include "scale/route_exits.hpp"
#include "scale/summary.hpp"
#include "scale/unit_task.hpp"
#include "scale/work_file.hpp"

namespace umbel::scale {
namespace {

namespace fs = std::filesystem;

// A tier that keeps more than this part of the triangles is followed by one of larger units: what
// is left is mostly borders.
constexpr double kLeastProgress = 0.85;

// Of a tier, for its tasks: what is one value is an array of one.
struct TierPlan {
  std::vector<TierConfig> tier;
  std::vector<uint32_t> first_serial, shards;
  std::vector<std::byte> partition;
  std::vector<PositionEdge> non_manifold;
  std::vector<uint8_t> streams;  // normals, tangents, uvs, colours, materials
  std::vector<Extra> extras;
};

template <typename Visit>
void for_each_array(TierPlan& plan, Visit& visit) {
  visit(plan.tier), visit(plan.first_serial), visit(plan.shards), visit(plan.partition);
  visit(plan.non_manifold), visit(plan.streams), visit(plan.extras);
}

// Of a unit that is built, beside its parts and exits.
struct UnitSummary {
  std::vector<uint32_t> next_level;
  std::vector<uint64_t> triangles;  // of the exits
  std::vector<lod::Report> report;
};

template <typename Visit>
void for_each_array(UnitSummary& summary, Visit& visit) {
  visit(summary.next_level), visit(summary.triangles), visit(summary.report);
}

// Enough cells for planes between them to come near enough, and no more for a small mesh.
uint32_t resolution_of(uint64_t triangles) {
  uint32_t resolution = 32;
  while (resolution < 256 && uint64_t{resolution} * resolution * resolution < 64 * triangles)
    resolution *= 2;
  return resolution;
}

fs::path tier_folder(const fs::path& work, uint32_t tier) {
  return work / std::string("t").append(std::to_string(tier));
}

std::string number(uint32_t n) {
  std::string digits = std::to_string(n);
  return std::string(digits.size() < 6 ? 6 - digits.size() : 0, '0') + digits;
}

fs::path unit_file(const fs::path& work, const Task& task, const char* what) {
  return tier_folder(work, task.tier) / "unit" /
         (std::string("u").append(number(task.unit)) + what);
}

fs::path shard_file(const fs::path& work, uint32_t tier, uint32_t shard) {
  return tier_folder(work, tier) / "route" / (std::string("s").append(number(shard)) + ".route");
}

void make_folders(const fs::path& work, uint32_t tier) {
  fs::create_directories(tier_folder(work, tier) / "route");
  fs::create_directories(tier_folder(work, tier) / "unit");
}

io::SourceStreams streams_of(const TierPlan& plan) {
  const auto& s = plan.streams;
  return {s[0] != 0, s[1] != 0, s[2] != 0, s[3] != 0, s[4] != 0, plan.extras};
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
        const fs::path& work, const TaskRunner& run_tasks)
      : source_(source), scale_(scale), work_(work), run_tasks_(run_tasks) {
    dag_.config = config;
  }

  lod::Dag run() {
    begin();
    while (true) {
      run_tier();
      if (plan_.tier[0].is_last) break;
      next_tier();
    }
    join_parts(parts_, dag_);
    return std::move(dag_);
  }

 private:
  const lod::Config& config() const { return dag_.config; }

  // The passes over the input.
  void begin() {
    const SourceSummary summary = summarise(source_, 0, source_.triangles());
    const PointRule rule{choose_origin(summary), config().position_step};
    triangles_ = source_.triangles();
    dag_.report.input_triangles = triangles_;
    const Aabb box = box_of(summary, rule);
    partition_ = build_partition(
        source_, rule, box, {.capacity = scale_.capacity, .resolution = resolution_of(triangles_)},
        &dag_.source_digest);
    make_folders(work_, 0);
    const auto files =
        route(source_, partition_, {rule, scale_.capacity}, tier_folder(work_, 0) / "route");
    const io::SourceStreams streams = source_.streams();
    plan_.tier = {TierConfig{.config = config(), .box = box, .rounds = scale_.rounds}};
    plan_.shards = {static_cast<uint32_t>(files.size())};
    plan_.streams = {streams.normals, streams.tangents, streams.uvs, streams.colors,
                     streams.materials};
    plan_.extras = streams.extras;
    const bool is_one = partition_.units() == 1;
    set_last(is_one);
    plan_.tier[0].is_whole = is_one;
  }

  void set_last(bool is_last) {
    plan_.tier[0].is_last = is_last;
    // How many triangles there are in all, only the last unit knows.
    plan_.tier[0].config.stop_triangles = is_last ? config().stop_triangles : 0;
  }

  void run_tier() {
    plan_.first_serial = {serial_};
    plan_.partition = partition_.bytes();
    write_record(tier_folder(work_, tier_) / "plan", plan_);
    std::vector<Task> tasks;
    for (uint32_t u = 0; u < partition_.units(); ++u) tasks.push_back({tier_, u});
    run_tasks_(tasks);
    uint64_t left = 0;
    uint32_t next_level = plan_.tier[0].level;
    for (const Task& task : tasks) {
      const auto summary = read_record<UnitSummary>(unit_file(work_, task, ".done"));
      left += summary.triangles[0];
      next_level = std::max(next_level, summary.next_level[0]);
      add_to(dag_.report, summary.report[0]);
      parts_.push_back(unit_file(work_, task, ".parts"));
    }
    if (static_cast<double>(left) > kLeastProgress * static_cast<double>(triangles_))
      scale_.capacity *= 2;
    triangles_ = left;
    plan_.tier[0].level = next_level;
    serial_ += partition_.units();
  }

  Exits exits_of(uint32_t unit) const {
    return read_record<Exits>(unit_file(work_, {tier_, unit}, ".exits"));
  }

  void next_tier() {
    const uint32_t units = partition_.units();
    plan_.non_manifold = tier_ == 0 ? decide_edges(units) : std::vector<PositionEdge>{};
    set_last(triangles_ <= scale_.capacity);
    partition_ = plan_.tier[0].is_last ? Partition() : partition_of_exits(units);
    make_folders(work_, tier_ + 1);
    SharedLeafCounts shared;
    for (uint32_t u = 0; u < units; ++u)
      route_exits(exits_of(u), partition_, scale_.capacity, shared,
                  shard_file(work_, tier_ + 1, u));
    plan_.shards = {units};
    ++tier_;
  }

  std::vector<PositionEdge> decide_edges(uint32_t units) const {
    std::vector<PositionEdge> undecided;
    for (uint32_t u = 0; u < units; ++u) {
      const Exits exits = exits_of(u);
      undecided.insert(undecided.end(), exits.undecided.begin(), exits.undecided.end());
    }
    return non_manifold_edges(std::move(undecided));
  }

  // By their clusters' places.
  Partition partition_of_exits(uint32_t units) const {
    PartitionBuilder builder(
        plan_.tier[0].box,
        {.capacity = scale_.capacity, .tier = tier_ + 1, .resolution = resolution_of(triangles_)});
    while (!builder.is_done()) {
      CellCounts counts = builder.empty_counts();
      for (uint32_t u = 0; u < units; ++u) {
        const Exits exits = exits_of(u);
        for (size_t c = 0; c < exits.clusters.size(); ++c)
          builder.count(counts, middle(exits.clusters.boxes[c]),
                        static_cast<uint32_t>(exits.clusters.cluster_corners(c).size() / 3));
      }
      builder.advance(counts);
    }
    return builder.finished();
  }

  const io::TriangleSource& source_;
  ScaleConfig scale_;
  const fs::path& work_;
  const TaskRunner& run_tasks_;
  lod::Dag dag_;
  TierPlan plan_;
  Partition partition_;
  std::vector<fs::path> parts_;
  uint32_t tier_ = 0, serial_ = 0;
  uint64_t triangles_ = 0;
};

}  // namespace

void run_task(const std::filesystem::path& work, const Task& task) {
  const auto plan = read_record<TierPlan>(tier_folder(work, task.tier) / "plan");
  const Partition partition = Partition::from_bytes(plan.partition);
  const TierConfig& tier = plan.tier.at(0);
  const uint32_t serial = plan.first_serial.at(0) + task.unit;
  const fs::path parts = unit_file(work, task, ".parts");
  BuiltUnit built;
  if (task.tier == 0) {
    std::vector<fs::path> files;
    for (uint32_t s = 0; s < plan.shards.at(0); ++s) files.push_back(shard_file(work, 0, s));
    built = build_unit(read_unit(files, partition, streams_of(plan), tier.box, task.unit), tier,
                       serial, parts);
  } else {
    std::vector<Slice> slices;
    for (uint32_t s = 0; s < plan.shards.at(0); ++s) {
      const std::vector<std::byte> bytes =
          SliceReader(shard_file(work, task.tier, s)).read(task.unit);
      if (!bytes.empty()) slices.push_back(record_of<Slice>(bytes));
    }
    built =
        build_unit(std::move(slices), plan.non_manifold, partition, task.unit, tier, serial, parts);
  }
  write_record(unit_file(work, task, ".exits"), built.exits);
  UnitSummary summary{{built.next_level}, {built.exits.clusters.triangle_count()}, {built.report}};
  write_record(unit_file(work, task, ".done"), summary);
}

lod::Dag build_in_tiers(const io::TriangleSource& source, const lod::Config& config,
                        const ScaleConfig& scale, const std::filesystem::path& work,
                        const TaskRunner& run_tasks) {
  if (config.measured_error)
    throw Error(ErrorCode::kUnsupported,
                "measured_error needs the whole mesh in memory: leave it out, or build in memory");
  if (config.position_step != 0)
    throw Error(ErrorCode::kUnsupported, "position_step is not possible unit by unit yet");
  return Tiers(source, config, scale, work, run_tasks).run();
}

}  // namespace umbel::scale
