#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "base/parallel.hpp"
#include "io/source/checked_source.hpp"
#include "io/source/plain_source.hpp"
#include "lod/build/check_config.hpp"
#include "mesh/streams.hpp"
#include "scale/build_asset.hpp"
#include "scale/run_task.hpp"
#include "scale/tiers.hpp"
#include "umbel/scale.hpp"
#include "umbel/version.hpp"

namespace umbel {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kLeastUnit = 1000;

void check(const UnitsConfig& config, const io::SourceStreams& streams) {
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorCode::kInvalidArgument, what);
  };
  if (config.unit_triangles < kLeastUnit)
    refuse("unit_triangles must be at least " + std::to_string(kLeastUnit) + ", not " +
           std::to_string(config.unit_triangles));
  if (config.work.empty()) refuse("a build in units needs a work folder");
  if (!config.contents.meshes.empty() || !config.contents.instances.empty())
    refuse("a build in units makes an asset of one mesh without instances");
  MeshView mesh;
  mesh.extras = streams.extras;
  check_streams(mesh);
  scale::check_config(lod::with_limits(config.lod), streams);
}

bool has_units(const fs::path& work) {
  std::error_code ignored;
  const fs::directory_iterator all(scale::tier_folder(work, 0) / "unit", ignored);
  return std::any_of(begin(all), end(all),
                     [](const auto& entry) { return entry.path().extension() == ".done"; });
}

int status_of(ErrorCode code) { return 10 + static_cast<int>(code); }

}  // namespace

UnitsReport build_in_units(const std::filesystem::path& path, const TriangleSource& given,
                           const UnitsConfig& config, const BuildOptions& options) {
  check(config, given.streams());
  const io::CheckedSource checked(given);
  const io::PlainSource plain(checked);
  const TriangleSource& source =
      config.lod.attributes ? static_cast<const TriangleSource&>(checked) : plain;
  scale::AssetBuild build;
  build.config = config.lod;
  build.scale.capacity = config.unit_triangles;
  build.force = config.force;
  build.finish.asset = config.asset;
  build.finish.contents = config.contents;
  build.finish.contents.first_materials = {0};

  const uint64_t memory =
      config.memory_bytes > 0 ? config.memory_bytes : std::numeric_limits<uint64_t>::max();
  const uint32_t cores = std::max(1u, std::thread::hardware_concurrency());
  const scale::MemoryPlan plan =
      scale::plan_memory(memory, cores, source.triangles(), source.streams(), build.scale,
                         scale::vertex_share(source, 0));
  const uint32_t workers =
      config.worker.empty()
          ? 1
          : std::min(plan.workers, config.workers > 0 ? config.workers : plan.workers);

  scale::Identity identity{{"format", "1"}, {"library", UMBEL_VERSION}, {"input", config.input}};
  for (auto& field : scale::identity_of(config.lod, build.scale)) identity.push_back(field);
  scale::WorkFolder folder(config.work, identity, config.resume);
  const auto executor = config.worker.empty()
                            ? scale::make_local_executor(folder.path())
                            : scale::make_process_executor(folder.path(), config.worker, workers);
  scale::Finished finished;
  try {
    finished = scale::build_asset(source, build, folder, *executor, path, options);
  } catch (const Error& error) {
    // Of an input or an argument at fault nothing is worth keeping: once that is mended, it could
    // not be resumed.
    const bool may_go_on = error.code() == ErrorCode::kIo || error.code() == ErrorCode::kCancelled;
    if (!may_go_on && !folder.is_resumed() && !has_units(folder.path())) folder.remove();
    throw;
  }
  folder.remove();
  UnitsReport report;
  report.lod = finished.report;
  report.collapsed_triangles = finished.collapsed_triangles;
  report.levels = finished.levels;
  report.groups = finished.groups;
  report.clusters = finished.clusters;
  report.triangles = finished.triangles;
  report.file_bytes = finished.bytes;
  report.workers = workers;
  return report;
}

int run_unit_worker(int argc, const char* const* argv, uint32_t threads) {
  if (argc < 4) {
    std::fputs("a work folder, a tier and a unit are needed\n", stderr);
    return status_of(ErrorCode::kInvalidArgument);
  }
  const auto number = [](const char* text) {
    return static_cast<uint32_t>(std::strtoul(text, nullptr, 10));
  };
  const scale::Task task{number(argv[argc - 2]), number(argv[argc - 1])};
  try {
    scale::begin_worker();
    with_threads(threads, [&] { scale::run_task(argv[argc - 3], task); });
    return 0;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return status_of(error.code());
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr,
                 "unit %u of tier %u needs more memory than there is: give more, and go on with "
                 "resume\n",
                 task.unit, task.tier);
    return status_of(ErrorCode::kIo);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return status_of(ErrorCode::kUnsupported);
  }
}

}  // namespace umbel
