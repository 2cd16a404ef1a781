// Continuous level of detail: building, selecting, taking cuts out as meshes, checking.
#include "umbel/lod.hpp"

#include <nanobind/stl/vector.h>

#include <cmath>
#include <cstring>
#include <mutex>
#include <type_traits>

#include "lod.hpp"

namespace umbel::python {

void check_cut(const lod::Tables& tables, std::span<const uint32_t> cut) {
  for (size_t i = 0; i < cut.size(); ++i) {
    if (cut[i] >= tables.clusters.size()) {
      throw Error(ErrorCode::kInvalidArgument,
                  "cut[" + std::to_string(i) + "] is " + std::to_string(cut[i]) +
                      ", but there are only " + std::to_string(tables.clusters.size()) +
                      " clusters");
    }
  }
}

Dict report_dict(const lod::VerifyReport& report) {
  Dict result;
  PUT_FIELDS(result, report, ok, cuts, cracks, overlaps, limit_violations, monotone,
             checksum_errors);
  nb::list problems;
  for (const std::string& problem : report.problems) problems.append(problem);
  result["problems"] = problems;
  return result;
}

Dict geometry_dict(lod::ClusterGeometry&& geometry) {
  Mesh mesh;
  mesh.positions = std::move(geometry.positions);
  mesh.normals = std::move(geometry.normals);
  mesh.tangents = std::move(geometry.tangents);
  mesh.uvs = std::move(geometry.uvs);
  mesh.colors = std::move(geometry.colors);
  mesh.extras = std::move(geometry.extras);
  mesh.extra_values = std::move(geometry.extra_values);
  mesh.triangles.reserve(geometry.triangles.size() / 3);
  for (size_t i = 0; i + 2 < geometry.triangles.size(); i += 3) {
    mesh.triangles.push_back(
        {geometry.triangles[i], geometry.triangles[i + 1], geometry.triangles[i + 2]});
  }
  return dict_of(std::move(mesh));
}

Array<float> normal_cone_array(const lod::Tables& tables, const lod::GeometryReader& geometry,
                               const nb::object& progress, uint32_t threads) {
  return take<float>(run(progress, threads, [&](const BuildOptions& options) {
    return lod::normal_cone_bounds(tables, geometry, options);
  }));
}

Dict cut_dict(const lod::Tables& tables, const lod::GeometryReader& geometry,
              const Flat<uint32_t>& cut) {
  const auto clusters = rows_of<uint32_t>(cut);
  check_cut(tables, clusters);
  return dict_of(interruptible([&] { return lod::mesh_of_cut(tables, geometry, clusters); }));
}

namespace {

/// A table as (rows, words) of 32-bit words, without a copy; umbel.lod gives the words names.
template <typename T>
Array<const uint32_t> words_of(const std::vector<T>& table, nb::handle owner) {
  static_assert(sizeof(T) % 4 == 0);
  return array_over<const uint32_t>(std::span<const T>(table), owner);
}

template <typename T>
std::vector<T> table_of(
    const nb::ndarray<const uint32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>& words,
    const char* name) {
  if (words.shape(1) != sizeof(T) / 4)
    throw Error(ErrorCode::kInvalidArgument,
                std::string(name) + " must have " + std::to_string(sizeof(T) / 4) +
                    " words a row, not " + std::to_string(words.shape(1)));
  std::vector<T> table(words.shape(0));
  if (!table.empty())
    std::memcpy(static_cast<void*>(table.data()), words.data(), table.size() * sizeof(T));
  return table;
}

/// The getter of one of the tables.
template <auto kTable>
Array<const uint32_t> words_in(nb::handle_t<lod::Tables> self) {
  return words_of(nb::cast<const lod::Tables&>(self).*kTable, self);
}

void bind_tables(nb::module_& module) {
  using lod::Tables;
  using Words = nb::ndarray<const uint32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
  nb::class_<Tables>(module, "Tables", "All that selection needs, without geometry.",
                     nb::dynamic_attr())
      .def(
          "__init__",
          [](Tables* self, const Words& levels, const Words& groups, const Words& clusters,
             const Words& nodes) {
            Tables tables{table_of<Range>(levels, "levels"), table_of<lod::Group>(groups, "groups"),
                          table_of<lod::Cluster>(clusters, "clusters"),
                          table_of<lod::Node>(nodes, "nodes")};
            lod::complete(tables);
            lod::validate(tables);
            new (self) Tables(std::move(tables));
          },
          "levels"_a, "groups"_a, "clusters"_a, "nodes"_a)
      .def_prop_ro("levels", words_in<&Tables::levels>)
      .def_prop_ro("groups", words_in<&Tables::groups>)
      .def_prop_ro("clusters", words_in<&Tables::clusters>)
      .def_prop_ro("nodes", words_in<&Tables::nodes>)
      .def(
          "cut_error",
          [](const Tables& tables, const Flat<uint32_t>& cut) {
            check_cut(tables, rows_of<uint32_t>(cut));
            return lod::cut_error(tables, rows_of<uint32_t>(cut));
          },
          "cut"_a);
}

void bind_config(nb::module_& module) {
  nb::class_<lod::Config>(module, "LodConfig", "Limits and weights of a LOD build.")
      .def(nb::init<>())
      .def_rw("max_triangles", &lod::Config::max_triangles)
      .def_rw("max_vertices", &lod::Config::max_vertices)
      .def_rw("min_triangles", &lod::Config::min_triangles)
      .def_rw("underfill_cost", &lod::Config::underfill_cost)
      .def_rw("vertex_underfill_cost", &lod::Config::vertex_underfill_cost)
      .def_rw("overlap_cost", &lod::Config::overlap_cost)
      .def_rw("group_underfill_cost", &lod::Config::group_underfill_cost)
      .def_rw("group_overlap_cost", &lod::Config::group_overlap_cost)
      .def_rw("lock_borders", &lod::Config::lock_borders)
      .def_rw("min_group", &lod::Config::min_group)
      .def_rw("max_group", &lod::Config::max_group)
      .def_rw("ratio", &lod::Config::ratio)
      .def_rw("position_step", &lod::Config::position_step)
      .def_rw("attributes", &lod::Config::attributes)
      .def_rw("normal_weight", &lod::Config::normal_weight)
      .def_rw("uv_weight", &lod::Config::uv_weight)
      .def_rw("color_weight", &lod::Config::color_weight)
      .def_rw("tangent_weight", &lod::Config::tangent_weight)
      .def_rw("skin_weight", &lod::Config::skin_weight)
      .def_rw("mix_materials", &lod::Config::mix_materials)
      .def_rw("keep_area", &lod::Config::keep_area)
      .def_prop_rw(
          "seams", [](const lod::Config& c) { return static_cast<uint32_t>(c.seams); },
          [](lod::Config& c, uint32_t rule) { c.seams = static_cast<lod::SeamRule>(rule); })
      .def_prop_rw(
          "creases", [](const lod::Config& c) { return static_cast<uint32_t>(c.creases); },
          [](lod::Config& c, uint32_t rule) { c.creases = static_cast<lod::SeamRule>(rule); })
      .def_rw("refit_attributes", &lod::Config::refit_attributes)
      .def_rw("max_levels", &lod::Config::max_levels)
      .def_rw("stop_triangles", &lod::Config::stop_triangles)
      .def_rw("max_error", &lod::Config::max_error)
      .def_rw("measured_error", &lod::Config::measured_error);
}

constexpr std::array<const char*, lod::kLimitingFactors> kLimitingFactorNames = {
    "none",    "caller", "small parts", "locked",  "irregular", "seams",    "topology",
    "turning", "price",  "coarsest",    "stopped", "stuck",     "area lost"};

/// Those that occur.
nb::dict limiting_factor_counts(const std::array<uint64_t, lod::kLimitingFactors>& counts) {
  nb::dict result;
  for (size_t i = 0; i < counts.size(); ++i)
    if (counts[i] > 0) result[kLimitingFactorNames[i]] = counts[i];
  return result;
}

}  // namespace

Dict build_report(const lod::Report& report) {
  Dict result;
  PUT_FIELDS(result, report, input_triangles, input_vertices, degenerate_triangles, root_groups,
             root_triangles, stuck_groups);
  constexpr const char* kMethodNames[] = {"regular", "permissive", "prune", "sloppy", "root"};
  nb::dict methods, limiting_factors;
  for (size_t i = 0; i < report.groups_by_method.size(); ++i) {
    methods[kMethodNames[i]] = report.groups_by_method[i];
    limiting_factors[kMethodNames[i]] = limiting_factor_counts(report.groups_by_limiting_factor[i]);
  }
  result["groups_by_rung"] = methods;
  result["groups_by_reason"] = limiting_factors;
  result["waits_by_reason"] = limiting_factor_counts(report.waits_by_limiting_factor);
  result["largest_move"] = report.largest_move;
  if (report.measured_groups > 0) {
    result["measured_groups"] = report.measured_groups;
    result["underestimated_groups"] = report.underestimated_groups;
    result["mean_overestimate"] = std::exp2(report.mean_log2_overestimate);
  }
  result["seconds"] = report.seconds;
  return result;
}

namespace {

Dict verify_dag(const lod::Dag& dag, uint32_t cuts, uint32_t seed, const nb::object& progress,
                uint32_t threads) {
  return report_dict(run(progress, threads, [&](const BuildOptions& options) {
    lod::VerifyConfig config;
    config.cuts = cuts;
    config.seed = seed;
    config.max_triangles = dag.config.max_triangles;
    config.max_vertices = dag.config.max_vertices;
    config.source_triangles = dag.report.input_triangles;
    config.source_digest = dag.source_digest;
    return lod::verify(
        dag.tables, [&](uint32_t cluster) { return dag.geometry(cluster); }, config, options);
  }));
}

template <typename T>
std::vector<T> rows_from(const nb::dict& answer, const char* key) {
  using Scalar = std::conditional_t<std::is_same_v<T, Triangle> || std::is_same_v<T, uint32_t>,
                                    uint32_t, float>;
  std::vector<T> rows;
  if (!answer.contains(key)) return rows;
  const auto words =
      nb::cast<nb::ndarray<const Scalar, nb::c_contig, nb::device::cpu>>(answer[key]);
  if (words.size() % (sizeof(T) / 4) != 0)
    throw Error(ErrorCode::kInvalidArgument,
                std::string("decimate: ") + key + " has rows of another length");
  rows.resize(words.size() * 4 / sizeof(T));
  if (!rows.empty()) std::memcpy(static_cast<void*>(rows.data()), words.data(), words.size() * 4);
  return rows;
}

/// Calls a Python decimation on whatever thread; what it raises is kept, and ends the build.
bool ask_python(const nb::object& decimate, const lod::DecimationInput& input,
                lod::DecimationResult& result, std::exception_ptr& raised, std::mutex& mutex) {
  nb::gil_scoped_acquire acquire;
  try {
    const MeshView& view = input.mesh;
    Mesh mesh;
    mesh.positions.assign(view.positions.begin(), view.positions.end());
    mesh.triangles.assign(view.triangles.begin(), view.triangles.end());
    mesh.normals.assign(view.normals.begin(), view.normals.end());
    mesh.tangents.assign(view.tangents.begin(), view.tangents.end());
    mesh.uvs.assign(view.uvs.begin(), view.uvs.end());
    mesh.colors.assign(view.colors.begin(), view.colors.end());
    mesh.materials.assign(view.materials.begin(), view.materials.end());
    mesh.extras.assign(view.extras.begin(), view.extras.end());
    mesh.extra_values.assign(view.extra_values.begin(), view.extra_values.end());
    std::vector<uint8_t> locked(input.locked.begin(), input.locked.end());
    const nb::object why =
        input.refused ? nb::cast(lod::to_string(*input.refused)) : nb::object(nb::none());
    const nb::object given =
        decimate(dict_of(std::move(mesh)), take<uint8_t>(std::move(locked)), input.target, why);
    if (given.is_none()) return false;
    const auto answer = nb::cast<nb::dict>(given);
    result.triangles = rows_from<Triangle>(answer, "triangles");
    result.added.positions = rows_from<Vec3>(answer, "positions");
    result.added.normals = rows_from<Vec3>(answer, "normals");
    result.added.tangents = rows_from<Vec4>(answer, "tangents");
    result.added.uvs = rows_from<Vec2>(answer, "uvs");
    result.added.colors = rows_from<Vec4>(answer, "colors");
    result.added.extra_values = rows_from<float>(answer, "extra_values");
    result.added_materials = rows_from<uint32_t>(answer, "materials");
    result.error = nb::cast<float>(answer["error"]);
    return true;
  } catch (const nb::python_error&) {
    const std::scoped_lock lock(mutex);
    if (!raised) raised = std::current_exception();
  } catch (const nb::cast_error&) {
    throw Error(ErrorCode::kInvalidArgument,
                "decimate gave arrays of another type, or no number for its error");
  }
  throw Error(ErrorCode::kCancelled, "decimate raised an exception");
}

/// Over 60 lines: a list of methods.
void bind_dag(nb::module_& module) {
  using lod::Dag;
  nb::class_<Dag>(module, "Dag", "A mesh as a DAG of clusters.")
      .def_prop_ro(
          "tables", [](const Dag& dag) -> const lod::Tables& { return dag.tables; },
          nb::rv_policy::reference_internal)
      .def_prop_ro(
          "limiting_factors",
          [](const Dag& dag) {
            std::vector<std::string> names;
            for (const lod::LimitingFactor limiting_factor : dag.limiting_factors)
              names.emplace_back(kLimitingFactorNames[static_cast<size_t>(limiting_factor)]);
            return names;
          })
      .def_prop_ro("source_vertices",
                   [](nb::handle_t<Dag> self) {
                     const auto& dag = nb::cast<const Dag&>(self);
                     return array_over<const uint32_t>(
                         std::span<const uint32_t>(dag.source_vertices), self);
                   })
      .def_prop_ro("cluster_vertices",
                   [](nb::handle_t<Dag> self) {
                     const auto& dag = nb::cast<const Dag&>(self);
                     return array_over<const uint32_t>(
                         std::span<const uint32_t>(dag.cluster_vertices), self);
                   })
      .def_prop_ro("report", [](const Dag& dag) { return build_report(dag.report); })
      .def_prop_ro("source_digest", [](const Dag& dag) { return dag.source_digest; })
      .def(
          "geometry",
          [](const Dag& dag, uint32_t cluster) {
            check_cut(dag.tables, {&cluster, 1});
            return geometry_dict(dag.geometry(cluster));
          },
          "cluster"_a)
      .def(
          "mesh",
          [](const Dag& dag, const Flat<uint32_t>& cut) {
            return cut_dict(
                dag.tables, [&](uint32_t cluster) { return dag.geometry(cluster); }, cut);
          },
          "cut"_a)
      .def(
          "normal_cones",
          [](const Dag& dag, const nb::object& progress, uint32_t threads) {
            return normal_cone_array(
                dag.tables, [&](uint32_t cluster) { return dag.geometry(cluster); }, progress,
                threads);
          },
          "progress"_a = nb::none(), "threads"_a = 0)
      .def("verify", &verify_dag, "cuts"_a = 64, "seed"_a = 1, "progress"_a = nb::none(),
           "threads"_a = 0);
  module.def(
      "build_lod",
      [](const MeshArrays& mesh, const lod::Config& config, const nb::object& progress,
         uint32_t threads, const nb::object& decimate, const std::optional<Flat<uint8_t>>& locked) {
        std::exception_ptr raised;
        std::mutex mutex;
        const auto build = [&](const BuildOptions& options) {
          lod::Decimator decimator;
          if (!decimate.is_none())
            decimator = [&](const lod::DecimationInput& input, lod::DecimationResult& result) {
              return ask_python(decimate, input, result, raised, mutex);
            };
          return lod::build(mesh.view(), config, options, decimator, rows_of<uint8_t>(locked));
        };
        try {
          return run(progress, threads, build);
        } catch (const Error&) {
          if (raised) std::rethrow_exception(raised);
          throw;
        }
      },
      "mesh"_a, "config"_a, "progress"_a = nb::none(), "threads"_a = 0, "decimate"_a = nb::none(),
      "locked"_a = nb::none());
}

}  // namespace

void bind_lod(nb::module_& module) {
  bind_config(module);
  bind_tables(module);
  bind_dag(module);
  bind_select(module);
}

}  // namespace umbel::python
