#include "scale/build_asset.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <iterator>
#include <limits>

#include "base/hash.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "lod/build/check_config.hpp"
#include "scale/taken_positions.hpp"
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

std::string gigabytes(double bytes) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.2f GB", bytes / 1e9);
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
  const size_t width = block.extra_values.size() / block.positions.size();
  for (size_t k = v * width; k < (v + 1) * width; ++k)
    hash = mix64(hash ^ std::bit_cast<uint32_t>(block.extra_values[k]));
  return hash;
}

// Those of sorted values that there are once.
std::vector<uint64_t> single_values(std::span<const uint64_t> values) {
  std::vector<uint64_t> single;
  for (size_t i = 0; i < values.size(); ++i)
    if ((i == 0 || values[i - 1] != values[i]) &&
        (i + 1 == values.size() || values[i + 1] != values[i]))
      single.push_back(values[i]);
  return single;
}

// How many vertices are at one place, of so many in all, where triangles are in random order: by
// what samples have in common. Two of these suffice to show that the order is not random; then it
// is 1. Meshes that are closed in part only are why it says less than it finds.
double vertices_at_a_place(std::span<const std::vector<uint64_t>> samples, double all) {
  constexpr double kCaution = 1.5;
  double least = std::numeric_limits<double>::infinity();
  for (size_t a = 0; a < samples.size(); ++a)
    for (size_t b = a + 1; b < samples.size(); ++b) {
      std::vector<uint64_t> common;
      std::ranges::set_intersection(samples[a], samples[b], std::back_inserter(common));
      const double pairs =
          static_cast<double>(samples[a].size()) * static_cast<double>(samples[b].size());
      least = std::min(least, static_cast<double>(common.size()) * all / std::max(1.0, pairs));
    }
  return std::max(1.0, (1 + least) / kCaution);
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
  std::vector<std::vector<uint64_t>> once;
  for (uint64_t k = 0; k < kSamples; ++k) {
    const uint64_t begin = triangles / kSamples * k;
    const io::TriangleBlock block = source.read(begin, std::min(begin + kSample, triangles));
    std::vector<uint64_t> hashes(block.positions.size());
    for (size_t v = 0; v < hashes.size(); ++v) hashes[v] = hash_of(block, v);
    std::sort(hashes.begin(), hashes.end());
    once.push_back(single_values(hashes));
    given += static_cast<double>(hashes.size());
    distinct += static_cast<double>(std::unique(hashes.begin(), hashes.end()) - hashes.begin());
    read += static_cast<double>(block.triangles.size());
  }
  VertexShare share{given / read, distinct / read};
  if (triangles > kSamples * kSample) {
    const double all = share.given * static_cast<double>(triangles);
    share.distinct = std::min(share.distinct, share.given / vertices_at_a_place(once, all));
  }
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
  const uint64_t taken = triangles > scale.capacity ? TakenPositions::bytes(triangles) : 0;
  plan.unit_bytes = kWorkerBytes + taken + in_unit * bytes_of_triangle(streams, share);
  plan.least = std::max(kDriverBytes + plan.unit_bytes, kPassBytes) + taken;
  const double enough = static_cast<double>(plan.least) + 5e6;  // to the next hundredth
  if (memory < plan.least)
    throw Error(ErrorCode::kInvalidArgument,
                "memory of " + gigabytes(static_cast<double>(memory)) +
                    " is too little: units of " + std::to_string(in_unit) + " triangles need " +
                    gigabytes(enough) + "; give that, or make units smaller with unit_triangles");
  const uint64_t fitting = (memory - kDriverBytes - taken) / plan.unit_bytes;
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
    tiers.delegation = build.delegation;
    tiers.progress = [&](double fraction, std::string_view stage) {
      progress.report(fraction, stage);
    };
    tiers.run = [&](std::span<const Task> tasks, const std::function<void(size_t)>& poll) {
      run_all(executor, tasks, poll);
    };
    const BuiltTiers built = build_tiers(source, build.config, build.scale, folder.path(), tiers);
    FinishInput input{built.parts, built.units, lod::with_limits(build.config), built.report,
                      built.source_digest};
    input.report.input_vertices = build.input_vertices;
    FinishOptions finish_options = build.finish;
    finish_options.contents.origin = built.origin;
    finish_options.work = folder.path();
    if (build.delegation.encoding) finish_options.run = tiers.run;
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
