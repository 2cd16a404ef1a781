#include "scale/run_task.hpp"

#include <algorithm>
#include <utility>

#include "io/source/plain_source.hpp"
#include "scale/encode.hpp"
#include "scale/exits.hpp"
#include "scale/route.hpp"
#include "scale/route_exits.hpp"
#include "scale/route_file.hpp"
#include "scale/taken_positions.hpp"
#include "scale/tier_plan.hpp"
#include "scale/unit_task.hpp"
#include "scale/work_file.hpp"
#include "scale/work_folder.hpp"

namespace umbel::scale {
namespace {

namespace fs = std::filesystem;

// Takes the edges and the new positions: only the next tier's plan needs them.
ExitSummary take_summary(Exits& exits) {
  ExitSummary summary;
  const lod::ClusterSet& clusters = exits.clusters;
  for (size_t c = 0; c < clusters.size(); ++c) {
    summary.middles.push_back(middle(clusters.boxes[c]));
    summary.triangles.push_back(static_cast<uint32_t>(clusters.cluster_corners(c).size() / 3));
  }
  summary.undecided = std::exchange(exits.undecided, {});
  summary.new_positions = std::exchange(exits.new_positions, {});
  return summary;
}

void build(const fs::path& work, const Task& task, const TaskInput& input) {
  const auto plan = read_record<TierPlan>(plan_file(work, task.tier));
  const Partition partition = Partition::from_bytes(plan.partition);
  const TierConfig& tier = plan.tier.at(0);
  const uint32_t serial = plan.first_serial.at(0) + task.unit;
  std::vector<fs::path> files;
  if (input.shards)
    for (const uint32_t s : *input.shards) files.push_back(shard_file(work, task.tier, s));
  else
    for (uint32_t s = 0; s < plan.shards.at(0); ++s)
      files.push_back(shard_file(work, task.tier, s));
  const UnitPositions unused(partition, task.unit, taken_file(work, task.tier), input.fetch_taken);
  const bool may_enlarge = tier.config.keep_area && !tier.is_whole;
  const UnitOutput output{serial, unit_file(work, task, ".parts"), may_enlarge ? &unused : nullptr};
  BuiltUnit built;
  if (task.tier == 0) {
    built = build_unit(read_unit(files, partition, streams_of(plan), tier.box, task.unit), tier,
                       output);
  } else {
    std::vector<Slice> slices;
    for (const fs::path& file : files) {
      const std::vector<std::byte> bytes = SliceReader(file).read(task.unit);
      if (!bytes.empty()) slices.push_back(record_of<Slice>(bytes));
    }
    built = build_unit(std::move(slices), plan.non_manifold, partition, task.unit, tier, output);
  }
  UnitSummary summary{{built.next_level},
                      {built.exits.clusters.triangle_count()},
                      {built.exits.undecided.size()},
                      {built.report}};
  ExitSummary left = take_summary(built.exits);
  write_record(unit_file(work, task, ".exits"), built.exits);
  write_record(unit_file(work, task, ".left"), left);
  write_record(unit_file(work, task, ".done"), summary);
}

void sort(const fs::path& work, const Task& task, const TaskInput& input) {
  const auto plan = read_record<TierPlan>(plan_file(work, task.tier));
  const Partition partition = Partition::from_bytes(plan.partition);
  SharedLeafCounts before;
  for (const SharedBefore& shared : plan.shared)
    if (shared.shard == task.unit) before[shared.leaf] = shared.triangles;
  const fs::path path = shard_file(work, task.tier, task.unit);
  SlicePlaces places;
  if (task.tier == 0) {
    if (input.source == nullptr)
      throw Error(ErrorCode::kInvalidArgument, "there is no source to sort");
    const uint64_t begin = std::min(task.unit * kShardTriangles, input.source->triangles());
    const uint64_t end = std::min(begin + kShardTriangles, input.source->triangles());
    // Attributes may not be wanted.
    const io::SourceStreams s = streams_of(plan);
    const bool is_plain = !s.normals && !s.tangents && !s.uvs && !s.colors && s.extras.empty();
    const io::PlainSource plain(*input.source);
    const io::TriangleSource& source = is_plain ? plain : *input.source;
    route_shard(source, partition, {plan.rule.at(0), plan.capacity.at(0)}, before, begin, end,
                path);
    places = RouteFile(path).places();
  } else {
    const auto exits = read_record<Exits>(unit_file(work, {task.tier - 1, task.unit}, ".exits"));
    route_exits(exits, partition, plan.capacity.at(0), before, path);
    places = SliceReader(path).places();
  }
  write_places(places_file(work, task.tier, task.unit), places);
}

}  // namespace

void run_task(const std::filesystem::path& work, const Task& task, const TaskInput& input) {
  switch (task.kind) {
    case TaskKind::kBuild:
      return build(work, task, input);
    case TaskKind::kSort:
      return sort(work, task, input);
    case TaskKind::kEncode:
      return encode_unit(work, task);
  }
}

}  // namespace umbel::scale
