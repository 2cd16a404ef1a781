#include "scale/build_asset.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "scale/vertex_rows.hpp"

namespace umbel::scale {
namespace {

// Of the process that drives the build while units are built, and of each worker without a unit.
constexpr uint64_t kDriverBytes = 160 << 20;
constexpr uint64_t kWorkerBytes = 60 << 20;
// Of a unit, a triangle: what is measured is 82 with positions alone.
constexpr uint64_t kTriangleBytes = 95;
constexpr uint64_t kAttributeBytes = 10;  // and for each float of a vertex besides
// The passes over the input, and writing.
constexpr uint64_t kPassBytes = 300 << 20;

std::string gigabytes(uint64_t bytes) {
  std::array<char, 32> text;
  // Up, so that what is said suffices.
  std::snprintf(text.data(), text.size(), "%.2f GB", static_cast<double>(bytes) / 1e9 + 0.005);
  return text.data();
}

}  // namespace

MemoryPlan plan_memory(uint64_t memory, uint32_t cores, uint64_t triangles,
                       const io::SourceStreams& streams, const ScaleConfig& scale) {
  MemoryPlan plan;
  const uint64_t attributes = VertexRows::floats(streams) - 3;
  // Units of later tiers may be larger once, where little could be simplified.
  const uint64_t in_unit = std::min(triangles, scale.capacity);
  plan.unit_bytes = kWorkerBytes + in_unit * (kTriangleBytes + kAttributeBytes * attributes);
  plan.least = std::max(kDriverBytes + plan.unit_bytes, kPassBytes);
  if (memory < plan.least)
    throw Error(ErrorCode::kInvalidArgument,
                "memory of " + gigabytes(memory) + " is too little: units of " +
                    std::to_string(in_unit) + " triangles need " + gigabytes(plan.least) +
                    "; give that, or make units smaller with unit_triangles");
  const uint64_t fitting = (memory - kDriverBytes) / plan.unit_bytes;
  plan.workers = static_cast<uint32_t>(std::clamp<uint64_t>(fitting, 1, std::max(1u, cores)));
  return plan;
}

Finished build_asset(const io::TriangleSource& source, const AssetBuild& build,
                     const WorkFolder& folder, Executor& executor,
                     const std::filesystem::path& path, const BuildOptions& options) {
  Progress progress(options);
  Finished finished;
  with_threads(options.threads, [&] {
    TierOptions tiers;
    tiers.input_is_same = build.input_is_same;
    tiers.progress = [&](double fraction, std::string_view stage) {
      progress.report(fraction, stage);
    };
    tiers.run = [&](std::span<const Task> tasks, const std::function<void(size_t)>& poll) {
      run_all(executor, tasks, poll);
    };
    const BuiltTiers built = build_tiers(source, build.config, build.scale, folder.path(), tiers);
    FinishInput input{built.parts, build.config, built.report, built.source_digest};
    input.report.input_vertices = build.input_vertices;
    FinishOptions finish_options = build.finish;
    finish_options.contents.origin = built.origin;
    finish_options.work = folder.path();
    constexpr float kBefore = 0.9f;
    BuildOptions rest;
    rest.threads = options.threads;
    rest.progress = [&](float fraction, std::string_view stage) {
      progress.report(kBefore + (1 - kBefore) * fraction, stage);
      return true;
    };
    finished = finish(path, input, finish_options, rest);
  });
  return finished;
}

}  // namespace umbel::scale
