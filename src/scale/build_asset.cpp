#include "scale/build_asset.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>

#include "base/hash.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "scale/vertex_rows.hpp"

namespace umbel::scale {
namespace {

// Of the process that drives the build while units are built, and of each worker without a unit.
constexpr uint64_t kDriverBytes = 160 << 20;
constexpr uint64_t kWorkerBytes = 60 << 20;
// Of a unit, a triangle, of a surface that has a vertex for two triangles. Leaves of two triangles
// have four vertices; triangles with three vertices of their own are joined first.
constexpr uint64_t kTriangleBytes = 95;
constexpr double kClosedShare = 0.55;
constexpr double kVertexBytes = 300;  // a vertex more
constexpr double kGivenBytes = 32;    // a vertex that is given and joined
constexpr double kAttributeBytes = 20, kGivenAttributeBytes = 4;  // for each float besides
// The passes over the input, and writing.
constexpr uint64_t kPassBytes = 300 << 20;

std::string gigabytes(uint64_t bytes) {
  std::array<char, 32> text;
  // Up, so that what is said suffices.
  std::snprintf(text.data(), text.size(), "%.2f GB", static_cast<double>(bytes) / 1e9 + 0.005);
  return text.data();
}

uint64_t hash_of(const io::TriangleBlock& block, size_t v) {
  const Vec3d& p = block.positions[v];
  uint64_t hash = mix64(std::bit_cast<uint64_t>(p.x));
  hash = mix64(hash ^ std::bit_cast<uint64_t>(p.y));
  hash = mix64(hash ^ std::bit_cast<uint64_t>(p.z));
  const auto add = [&](const auto& stream) {
    if (stream.empty()) return;
    for (uint32_t bits : std::bit_cast<std::array<uint32_t, sizeof(stream[0]) / 4>>(stream[v]))
      hash = mix64(hash ^ bits);
  };
  add(block.normals), add(block.tangents), add(block.uvs), add(block.colors);
  return hash;
}

uint64_t bytes_of_triangle(const io::SourceStreams& streams, const VertexShare& share) {
  const auto floats = static_cast<double>(VertexRows::floats(streams) - 3);
  const double more = std::max(0.0, share.distinct - kClosedShare);
  const double joined = std::max(0.0, share.given - share.distinct);
  const double bytes = kVertexBytes * more +
                       (kGivenBytes + kGivenAttributeBytes * floats) * joined +
                       kAttributeBytes * floats * std::max(0.5, share.distinct);
  return kTriangleBytes + static_cast<uint64_t>(bytes);
}

}  // namespace

VertexShare vertex_share(const io::TriangleSource& source, uint64_t vertices) {
  constexpr uint64_t kSamples = 4, kSample = uint64_t{1} << 16;
  const uint64_t triangles = source.triangles();
  if (triangles == 0) return {};
  double given = 0, distinct = 0, read = 0;
  for (uint64_t k = 0; k < kSamples; ++k) {
    const uint64_t begin = triangles / kSamples * k;
    const io::TriangleBlock block = source.read(begin, std::min(begin + kSample, triangles));
    std::vector<uint64_t> hashes(block.positions.size());
    for (size_t v = 0; v < hashes.size(); ++v) hashes[v] = hash_of(block, v);
    std::sort(hashes.begin(), hashes.end());
    given += static_cast<double>(hashes.size());
    distinct += static_cast<double>(std::unique(hashes.begin(), hashes.end()) - hashes.begin());
    read += static_cast<double>(block.triangles.size());
  }
  VertexShare share{given / read, distinct / read};
  // Triangles that jump about among their vertices have few in common in a block.
  if (vertices > 0)
    share.distinct =
        std::min(share.distinct, static_cast<double>(vertices) / static_cast<double>(triangles));
  return share;
}

MemoryPlan plan_memory(uint64_t memory, uint32_t cores, uint64_t triangles,
                       const io::SourceStreams& streams, const ScaleConfig& scale,
                       const VertexShare& share) {
  MemoryPlan plan;
  // Units of later tiers may be larger once, where little could be simplified.
  const uint64_t in_unit = std::min(triangles, scale.capacity);
  plan.unit_bytes = kWorkerBytes + in_unit * bytes_of_triangle(streams, share);
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
    tiers.force = build.force;
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
    finished.collapsed_triangles = built.collapsed_triangles;
  });
  return finished;
}

}  // namespace umbel::scale
