// Continuous level of detail: building, selecting, taking cuts out as meshes, checking.
#include "umbel/lod.hpp"

#include <cstring>

#include "lod.hpp"
#include "umbel/lod_select.hpp"

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
  result["ok"] = report.ok;
  result["cuts"] = report.cuts;
  result["cracks"] = report.cracks;
  result["overlaps"] = report.overlaps;
  result["limit_violations"] = report.limit_violations;
  result["monotone"] = report.monotone;
  result["checksum_errors"] = report.checksum_errors;
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
  mesh.triangles.reserve(geometry.triangles.size() / 3);
  for (size_t i = 0; i + 2 < geometry.triangles.size(); i += 3) {
    mesh.triangles.push_back(
        {geometry.triangles[i], geometry.triangles[i + 1], geometry.triangles[i + 2]});
  }
  return dict_of(std::move(mesh));
}

Array<float> facing_array(const lod::Tables& tables, const lod::GeometryReader& geometry,
                          const nb::object& progress, uint32_t threads) {
  return take<float>(run(progress, threads, [&](const BuildOptions& options) {
    return lod::facing_bounds(tables, geometry, options);
  }));
}

Dict cut_dict(const lod::Tables& tables, const lod::GeometryReader& geometry,
              const Flat<uint32_t>& cut) {
  const auto clusters = rows_of<uint32_t>(cut);
  check_cut(tables, clusters);
  Mesh mesh;
  {
    nb::gil_scoped_release release;
    mesh = lod::cut_mesh(tables, geometry, clusters);
  }
  return dict_of(std::move(mesh));
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

void bind_tables(nb::module_& module) {
  using lod::Tables;
  using Words = nb::ndarray<const uint32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
  nb::class_<Tables>(module, "Tables", "All that selection needs, without geometry.")
      .def(
          "__init__",
          [](Tables* self, const Words& levels, const Words& groups, const Words& clusters,
             const Words& nodes) {
            Tables tables{table_of<Range>(levels, "levels"), table_of<lod::Group>(groups, "groups"),
                          table_of<lod::Cluster>(clusters, "clusters"),
                          table_of<lod::Node>(nodes, "nodes")};
            lod::validate(tables);
            new (self) Tables(std::move(tables));
          },
          "levels"_a, "groups"_a, "clusters"_a, "nodes"_a)
      .def_prop_ro("levels",
                   [](nb::handle_t<Tables> self) {
                     return words_of(nb::cast<const Tables&>(self).levels, self);
                   })
      .def_prop_ro("groups",
                   [](nb::handle_t<Tables> self) {
                     return words_of(nb::cast<const Tables&>(self).groups, self);
                   })
      .def_prop_ro("clusters",
                   [](nb::handle_t<Tables> self) {
                     return words_of(nb::cast<const Tables&>(self).clusters, self);
                   })
      .def_prop_ro("nodes",
                   [](nb::handle_t<Tables> self) {
                     return words_of(nb::cast<const Tables&>(self).nodes, self);
                   })
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
      .def_rw("min_group", &lod::Config::min_group)
      .def_rw("max_group", &lod::Config::max_group)
      .def_rw("ratio", &lod::Config::ratio)
      .def_rw("position_step", &lod::Config::position_step)
      .def_rw("attributes", &lod::Config::attributes)
      .def_rw("normal_weight", &lod::Config::normal_weight)
      .def_rw("uv_weight", &lod::Config::uv_weight)
      .def_rw("color_weight", &lod::Config::color_weight);
}

Dict build_report(const lod::Report& report) {
  Dict result;
  result["input_triangles"] = report.input_triangles;
  result["input_vertices"] = report.input_vertices;
  result["degenerate_triangles"] = report.degenerate_triangles;
  result["root_groups"] = report.root_groups;
  result["root_triangles"] = report.root_triangles;
  result["stuck_groups"] = report.stuck_groups;
  constexpr const char* kRungs[] = {"regular", "permissive", "prune", "sloppy", "root"};
  nb::dict rungs;
  for (size_t i = 0; i < report.groups_by_rung.size(); ++i) {
    rungs[kRungs[i]] = report.groups_by_rung[i];
  }
  result["groups_by_rung"] = rungs;
  result["largest_move"] = report.largest_move;
  result["seconds"] = report.seconds;
  return result;
}

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

void bind_dag(nb::module_& module) {
  using lod::Dag;
  nb::class_<Dag>(module, "Dag", "A mesh as a DAG of clusters.")
      .def_prop_ro(
          "tables", [](const Dag& dag) -> const lod::Tables& { return dag.tables; },
          nb::rv_policy::reference_internal)
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
          "facing",
          [](const Dag& dag, const nb::object& progress, uint32_t threads) {
            return facing_array(
                dag.tables, [&](uint32_t cluster) { return dag.geometry(cluster); }, progress,
                threads);
          },
          "progress"_a = nb::none(), "threads"_a = 0)
      .def("verify", &verify_dag, "cuts"_a = 64, "seed"_a = 1, "progress"_a = nb::none(),
           "threads"_a = 0);
  module.def(
      "build_lod",
      [](const MeshArrays& mesh, const lod::Config& config, const nb::object& progress,
         uint32_t threads) {
        return run(progress, threads, [&](const BuildOptions& options) {
          return lod::build(mesh.view(), config, options);
        });
      },
      "mesh"_a, "config"_a, "progress"_a = nb::none(), "threads"_a = 0);
}

}  // namespace

void bind_lod(nb::module_& module) {
  bind_config(module);
  bind_tables(module);
  bind_dag(module);
  bind_select(module);
}

}  // namespace umbel::python
