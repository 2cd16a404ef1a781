// Builds a mesh in units by processes of their own, and checks the result:
//
//   units_check MESH WORK CAPACITY WORKERS [reversed] [ROUNDS]
//
// builds with so many processes at a time, in the order of the units or the reverse, verifies, and
// prints one line: triangles, units of the first tier, tiers, the hash of the asset, and what
// verify says; it fails where the asset that is written from the parts has other bytes than that
// from memory. scripts/units_experiment.py runs it over a folder of meshes. MESH is PLY, OBJ, or
// the raw arrays that the script writes. Each process is this program again, as
//
//   units_check --task WORK TIER UNIT
//
// What is left in WORK can be written once more, for the memory that it takes:
//
//   units_check --finish WORK ASSET
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "base/hash.hpp"
#include "io/source/mesh_source.hpp"
#include "mesh_reader.hpp"
#include "scale/finish.hpp"
#include "scale/run_task.hpp"
#include "scale/tiers.hpp"
#include "umbel/asset.hpp"
#include "umbel/lod.hpp"

extern char** environ;  // NOLINT(readability-redundant-declaration)

namespace {

namespace fs = std::filesystem;
namespace lod = umbel::lod;

// Counts of every stream, then their values.
umbel::Mesh read_raw(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  umbel::Mesh mesh;
  const auto read = [&](auto& values) {
    uint64_t count = 0;
    file.read(reinterpret_cast<char*>(&count), sizeof count);
    values.resize(count);
    file.read(reinterpret_cast<char*>(values.data()),
              static_cast<std::streamsize>(count * sizeof values[0]));
  };
  read(mesh.positions), read(mesh.triangles), read(mesh.normals), read(mesh.tangents);
  read(mesh.uvs), read(mesh.colors), read(mesh.materials);
  if (!file) bench::fail(path, "is too short");
  return mesh;
}

pid_t start(const char* program, const fs::path& work, const umbel::scale::Task& task) {
  std::string words[] = {program, "--task", work.string(), std::to_string(task.tier),
                         std::to_string(task.unit)};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t child = 0;
  if (posix_spawn(&child, program, nullptr, nullptr, arguments.data(), environ) != 0)
    bench::fail(program, "cannot be started");
  return child;
}

// At most `workers` processes at a time.
void run_tasks(const char* program, const fs::path& work, size_t workers, bool reversed,
               std::span<const umbel::scale::Task> tasks) {
  size_t running = 0;
  const auto wait_for_one = [&] {
    int status = 0;
    wait(&status);
    --running;
    if (status != 0) bench::fail(work.string(), "a unit's process failed");
  };
  for (size_t i = 0; i < tasks.size(); ++i) {
    if (running == workers) wait_for_one();
    start(program, work, tasks[reversed ? tasks.size() - 1 - i : i]);
    ++running;
  }
  while (running > 0) wait_for_one();
}

uint64_t hash_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  return umbel::xxh64(bytes.data(), bytes.size());
}

umbel::scale::Finished finish(const fs::path& work, const fs::path& path, const lod::Dag& dag) {
  umbel::scale::FinishInput input;
  for (const auto& entry : fs::recursive_directory_iterator(work))
    if (entry.path().extension() == ".parts") input.parts.push_back(entry.path());
  std::ranges::sort(input.parts);  // tiers have one digit here
  input.config = dag.config;
  input.report = dag.report;
  input.source_digest = dag.source_digest;
  umbel::scale::FinishOptions options;
  options.work = work;
  return umbel::scale::finish(path, input, options);
}

int finish_again(const fs::path& work, const fs::path& path) {
  const auto begun = std::chrono::steady_clock::now();
  const auto finished = finish(work, path, {});
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("%" PRIu64 " triangles, %u groups, %" PRIu64
              " bytes in %.1f s, peak %.1f MB, %ld s of processor\n",
              finished.triangles, finished.groups, finished.bytes,
              std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count(),
              static_cast<double>(usage.ru_maxrss) / 1024,
              static_cast<long>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec));
  return 0;
}

int check(int argc, char** argv) {
  const std::string path = argv[1];
  const fs::path work = argv[2];
  const size_t workers = std::stoul(argv[4]);
  const bool reversed = argc > 5 && std::strcmp(argv[5], "reversed") == 0;
  const umbel::Mesh mesh =
      umbel::drop_invalid((path.ends_with(".raw") ? read_raw(path) : bench::read_mesh(path)).view())
          .mesh;
  umbel::scale::ScaleConfig scale;
  scale.capacity = std::stoull(argv[3]);
  if (argc > 6) scale.rounds = static_cast<uint32_t>(std::stoul(argv[6]));
  uint32_t tiers = 0;
  size_t first_units = 0;
  const umbel::io::MeshSource source(mesh.view(), {0, 0, 0}, path);
  const lod::Dag dag = umbel::scale::build_in_tiers(
      source, {}, scale, work, [&](std::span<const umbel::scale::Task> tasks) {
        if (tiers++ == 0) first_units = tasks.size();
        run_tasks(argv[0], work, workers, reversed, tasks);
      });
  lod::VerifyConfig config;
  config.source_triangles = mesh.triangles.size();
  config.source_digest = umbel::triangle_set_digest(mesh.view());
  const lod::VerifyReport report =
      lod::verify(dag.tables, [&](uint32_t c) { return dag.geometry(c); }, config);
  umbel::write_asset(work / "result.umbel", dag);
  finish(work, work / "parts.umbel", dag);
  const bool is_same = hash_of(work / "parts.umbel") == hash_of(work / "result.umbel");
  std::printf("%zu triangles, %zu units, %u tiers, %zu levels, %zu groups, %u roots of %" PRIu64
              " triangles, %016" PRIx64 ", verify %s: %" PRIu64 " cracks, %" PRIu64
              " overlaps, %" PRIu64 " limits, monotone %d\n",
              mesh.triangles.size(), first_units, tiers, dag.tables.levels.size(),
              dag.tables.groups.size(), dag.report.root_groups, dag.report.root_triangles,
              hash_of(work / "result.umbel"), report.ok ? "ok" : "FAILED", report.cracks,
              report.overlaps, report.limit_violations, report.monotone);
  for (const std::string& problem : report.problems) std::printf("  %s\n", problem.c_str());
  if (!is_same) std::printf("  the asset written from the parts is another\n");
  return report.ok && is_same ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc == 5 && std::strcmp(argv[1], "--task") == 0) {
      const auto number = [&](int i) { return static_cast<uint32_t>(std::stoul(argv[i])); };
      umbel::scale::run_task(argv[2], {number(3), number(4)});
      return 0;
    }
    if (argc == 4 && std::strcmp(argv[1], "--finish") == 0) return finish_again(argv[2], argv[3]);
    if (argc < 5) {
      std::fprintf(stderr, "units_check MESH WORK CAPACITY WORKERS [reversed] [ROUNDS]\n");
      return 2;
    }
    return check(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[1], error.what());
    return 2;
  }
}
