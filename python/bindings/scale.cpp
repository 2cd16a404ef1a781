// Builds in units, through a work folder.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <tuple>

#include "base/parallel.hpp"
#include "bind.hpp"
#include "io/source/plain_source.hpp"
#include "lod.hpp"
#include "lod/build/check_config.hpp"
#include "scale/build_asset.hpp"
#include "scale/route_file.hpp"
#include "scale/run_task.hpp"
#include "scale/work_file.hpp"

namespace umbel::python {
namespace {

using scale::WorkFolder;

/// A folder that can be given back before the object goes.
struct HeldFolder {
  std::unique_ptr<WorkFolder> folder;
};

scale::ScaleConfig scale_of(uint64_t unit_triangles) {
  scale::ScaleConfig config;
  if (unit_triangles > 0) config.capacity = unit_triangles;
  return config;
}

Dict finished_dict(const scale::Finished& finished) {
  Dict result;
  PUT_FIELDS(result, finished, levels, groups, clusters, triangles, bytes, collapsed_triangles);
  result["report"] = build_report(finished.report);
  return result;
}

/// Tasks go to an object of Python: umbel.scale.executor has what it must do.
class PythonExecutor final : public scale::Executor {
 public:
  explicit PythonExecutor(nb::object object) : object_(std::move(object)) {}
  PythonExecutor(const PythonExecutor&) = delete;
  ~PythonExecutor() override {
    const nb::gil_scoped_acquire held;
    object_.reset();
  }

  size_t slots() const override {
    const nb::gil_scoped_acquire held;
    return nb::cast<size_t>(object_.attr("slots")());
  }
  void submit(const scale::Task& task) override {
    const nb::gil_scoped_acquire held;
    object_.attr("submit")(static_cast<int>(task.kind), task.tier, task.unit, task.plan);
  }
  std::optional<scale::TaskResult> wait(std::chrono::milliseconds most) override {
    using Ended = std::tuple<uint32_t, uint32_t, int, std::string>;  // ..., error's kind, error
    const nb::gil_scoped_acquire held;
    const nb::object ended = object_.attr("wait")(static_cast<double>(most.count()) / 1e3);
    if (ended.is_none()) return std::nullopt;
    const auto [tier, unit, code, error] = nb::cast<Ended>(ended);
    return scale::TaskResult{{tier, unit}, error, static_cast<ErrorCode>(code)};
  }

 private:
  nb::object object_;
};

std::unique_ptr<scale::Executor> make_executor(const std::filesystem::path& work,
                                               const std::vector<std::string>& command,
                                               uint32_t workers, const nb::object& executor) {
  if (!executor.is_none()) return std::make_unique<PythonExecutor>(executor);
  if (command.empty()) return scale::make_local_executor(work);
  return scale::make_process_executor(work, command, workers);
}

Dict build(const HeldFolder& held, const io::TriangleSource& source, const lod::Config& config,
           uint64_t unit_triangles, const std::filesystem::path& path, const nb::object& metadata,
           const std::string& materials, const std::vector<std::filesystem::path>& files,
           const std::tuple<uint32_t, uint32_t, uint32_t, float>& precision, uint32_t page_bytes,
           const std::vector<std::string>& command, uint32_t workers, uint64_t input_vertices,
           bool input_is_same, const nb::object& progress, uint32_t threads,
           const nb::object& executor_object, bool force, const std::string& scene) {
  if (!held.folder) throw Error(ErrorCode::kInvalidArgument, "the work folder was closed");
  scale::AssetBuild build;
  build.config = config;
  build.scale = scale_of(unit_triangles);
  build.input_vertices = input_vertices;
  build.input_is_same = input_is_same;
  build.force = force;
  AssetConfig& asset = build.finish.asset;
  std::tie(asset.normal_bits, asset.tangent_bits, asset.color_bits, asset.uv_step) = precision;
  asset.page_bytes = page_bytes;
  build.finish.contents.materials = materials;
  build.finish.contents.scene = scene;
  build.finish.contents.first_materials = {0};
  build.finish.files = files;
  build.finish.metadata = [&](const scale::Finished& finished) {
    const nb::gil_scoped_acquire held_lock;
    return nb::cast<std::string>(metadata(finished_dict(finished)));
  };
  const io::PlainSource plain(source);
  if (!executor_object.is_none()) {
    scale::Delegation& delegation = build.delegation;
    delegation.sorting = delegation.encoding = true;
    delegation.source = nb::cast<bool>(executor_object.attr("sorts_source"));
    delegation.is_stand_in = nb::cast<bool>(executor_object.attr("is_stand_in"));
  }
  const auto executor = make_executor(held.folder->path(), command, workers, executor_object);
  return finished_dict(run(progress, threads, [&](const BuildOptions& options) {
    return scale::build_asset(config.attributes ? source : plain, build, *held.folder, *executor,
                              path, options);
  }));
}

}  // namespace

void bind_scale(nb::module_& module) {
  nb::class_<HeldFolder>(module, "WorkFolder", "The folder of a build that can be resumed.")
      .def(
          "__init__",
          [](HeldFolder* self, const std::filesystem::path& path, const lod::Config& config,
             uint64_t unit_triangles, const scale::Identity& identity, bool resume) {
            lod::check_config(lod::with_limits(config));
            scale::Identity all = identity;
            for (auto& field : scale::identity_of(config, scale_of(unit_triangles)))
              all.push_back(std::move(field));
            new (self) HeldFolder{std::make_unique<WorkFolder>(path, all, resume)};
          },
          "path"_a, "config"_a, "unit_triangles"_a, "identity"_a, "resume"_a,
          nb::sig("def __init__(self, path: str | os.PathLike[str], config: LodConfig, "
                  "unit_triangles: int, identity: collections.abc.Sequence[tuple[str, str]], "
                  "resume: bool) -> None"))
      .def_prop_ro("is_resumed",
                   [](const HeldFolder& self) { return self.folder && self.folder->is_resumed(); })
      .def("close", [](HeldFolder& self) { self.folder.reset(); })
      .def("remove", [](HeldFolder& self) {
        if (self.folder) self.folder->remove();
        self.folder.reset();
      });
  module.def(
      "plan_units",
      [](const io::TriangleSource& source, const lod::Config& config, uint64_t unit_triangles,
         uint64_t memory, uint32_t cores, uint64_t vertices) {
        const nb::gil_scoped_release release;
        const io::PlainSource plain(source);
        const io::TriangleSource& read = config.attributes ? source : plain;
        const scale::MemoryPlan plan =
            scale::plan_memory(memory, cores, read.triangles(), read.streams(),
                               scale_of(unit_triangles), scale::vertex_share(read, vertices));
        const nb::gil_scoped_acquire held;
        Dict result;
        PUT_FIELDS(result, plan, unit_bytes, least, workers);
        return result;
      },
      "source"_a, "config"_a, "unit_triangles"_a, "memory"_a, "cores"_a, "vertices"_a = 0,
      "How many units fit into so many bytes side by side, and what one takes.");
  module.def("build_units", &build, "folder"_a, "source"_a, "config"_a, "unit_triangles"_a,
             "path"_a, "metadata"_a, "materials"_a, "files"_a, "precision"_a, "page_bytes"_a,
             "command"_a, "workers"_a, "input_vertices"_a, "input_is_same"_a,
             "progress"_a = nb::none(), "threads"_a = 0, "executor"_a = nb::none(),
             "force"_a = false, "scene"_a = "",
             nb::sig("def build_units(folder: WorkFolder, source: TriangleSource, config: "
                     "LodConfig, unit_triangles: int, path: str | os.PathLike[str], metadata: "
                     "collections.abc.Callable[[dict[str, typing.Any]], str], materials: str, "
                     "files: collections.abc.Sequence[str | os.PathLike[str]], precision: "
                     "tuple[int, int, int, float], page_bytes: int, command: "
                     "collections.abc.Sequence[str], workers: int, input_vertices: int, "
                     "input_is_same: bool, progress: object | None = None, threads: int = 0, "
                     "executor: object | None = None, force: bool = False, scene: str = '') -> "
                     "dict[str, typing.Any]"));
  module.def(
      "run_task",
      [](const std::filesystem::path& work, int kind, uint32_t tier, uint32_t unit, uint64_t plan,
         uint32_t threads, const std::optional<std::vector<uint32_t>>& shards,
         const io::TriangleSource* source, const nb::object& fetch_taken) {
        scale::TaskInput input{shards, {}, source};
        if (!fetch_taken.is_none())
          input.fetch_taken = [&] {
            const nb::gil_scoped_acquire held;
            fetch_taken();
          };
        const nb::gil_scoped_release release;
        const scale::Task task{tier, unit, static_cast<scale::TaskKind>(kind), plan};
        with_threads(threads, [&] { scale::run_task(work, task, input); });
      },
      "work"_a, "kind"_a, "tier"_a, "unit"_a, "plan"_a, "threads"_a, "shards"_a = nb::none(),
      "source"_a = nb::none(), "fetch_taken"_a = nb::none(),
      nb::sig("def run_task(work: str | os.PathLike[str], kind: int, tier: int, unit: int, "
              "plan: int, threads: int, shards: list[int] | None = None, "
              "source: TriangleSource | None = None, "
              "fetch_taken: collections.abc.Callable[[], None] | None = None) -> None"),
      "Does one task; a unit's of all sorted files or of those with these numbers.");
  module.def("begin_worker", &scale::begin_worker,
             "This process ends when the one that started it does, and leaves Ctrl-C to that.");
  module.def(
      "read_places",
      [](const std::filesystem::path& path) {
        const nb::gil_scoped_release release;
        const scale::SlicePlaces places = scale::read_places(path);
        return std::tuple(places.bytes, places.common, places.slices);
      },
      "path"_a,
      nb::sig("def read_places(path: str | os.PathLike[str]) -> tuple[int, "
              "list[tuple[int, int]], list[tuple[int, int, int]]]"),
      "What slice_places gives, of the file that says it.");
  module.def(
      "slice_places",
      [](const std::filesystem::path& path, uint32_t tier) {
        const nb::gil_scoped_release release;
        const scale::SlicePlaces places =
            tier == 0 ? scale::RouteFile(path).places() : scale::SliceReader(path).places();
        return std::tuple(places.bytes, places.common, places.slices);
      },
      "path"_a, "tier"_a,
      nb::sig("def slice_places(path: str | os.PathLike[str], tier: int) -> tuple[int, "
              "list[tuple[int, int]], list[tuple[int, int, int]]]"),
      "Of a sorted file: its bytes, stretches that every unit needs, and each unit's own.");
}

}  // namespace umbel::python
