// Builds the DAG of clusters of continuous level of detail (Karis, "Nanite: A Deep Dive",
// SIGGRAPH 2021): clusters, groups, simplification of each group with its border locked, clusters
// again, until one group is left (unit_builder.hpp). Such a graph is a multi-triangulation (De
// Floriani, Magillo and Puppo, "Efficient implementation of multi-triangulations", 1998) of patches
// (Cignoni et al., "Batched multi triangulation", 2005); docs/lod.md has its history.
#include "umbel/lod/build.hpp"

#include <chrono>
#include <utility>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "lod/build/check_config.hpp"
#include "lod/build/dag_writer.hpp"
#include "lod/build/hierarchy.hpp"
#include "lod/build/unit_builder.hpp"
#include "lod/dag/source.hpp"

namespace umbel::lod {
namespace {

// All of the mesh is one unit, whose groups go to the DAG.
Dag build_in_core(const MeshView& mesh, const Config& config, const BuildOptions& options,
                  const Decimator& decimate, std::span<const uint8_t> locked, float moved) {
  Dag dag;
  dag.config = config;
  Unit unit;
  unit.moved = moved;
  parallel_invoke([&] { unit.source = make_source(mesh, BuildOptions{}); },
                  [&] { dag.source_digest = triangle_set_digest(mesh); });
  for (size_t v = 0; v < locked.size(); ++v)
    if (locked[v]) unit.locked_positions.push_back(mesh.positions[v]);
  dag.report.input_triangles = mesh.triangles.size();
  dag.report.input_vertices = mesh.positions.size();
  Progress progress(options);
  DagWriter writer(dag);
  UnitBuilder builder(unit, config, decimate, writer, dag.report, progress);
  builder.make_finest_level();
  writer.reserve(unit.pending);
  builder.run();
  builder.write_roots();
  dag.report.mean_log2_overestimate = builder.mean_log2_overestimate();
  dag.tables.nodes = build_hierarchy(dag.tables);
  dag.source_vertices = std::move(unit.source.caller_vertices);
  dag.vertices = std::move(unit.source.mesh);
  dag.vertices.triangles = {};
  dag.vertices.materials = {};
  if (config.mix_materials && !unit.source.vertex_materials.empty())
    keep_vertex_materials(unit.source.vertex_materials, dag.vertices);
  progress.report(1.0, "done");
  return dag;
}

Dag build_valid(const MeshView& mesh, const Config& config, const BuildOptions& options,
                const Decimator& decimate, std::span<const uint8_t> locked) {
  if (config.position_step == 0) return build_in_core(mesh, config, options, decimate, locked, 0);
  std::vector<Vec3> positions(mesh.positions.begin(), mesh.positions.end());
  const float moved = snap_to_grid(positions, config.position_step);
  MeshView snapped = mesh;
  snapped.positions = positions;
  Dag dag = build_in_core(snapped, config, options, decimate, locked, moved);
  dag.report.largest_move = moved;
  return dag;
}

}  // namespace

Dag build(const MeshView& mesh, const Config& given, const BuildOptions& options,
          const Decimator& decimate, std::span<const uint8_t> locked) {
  const Config config = with_limits(given);
  check_config(mesh, config);
  if (!locked.empty() && locked.size() != mesh.positions.size())
    throw Error(ErrorCode::kInvalidArgument,
                "locked has " + std::to_string(locked.size()) + " elements, but there are " +
                    std::to_string(mesh.positions.size()) + " vertices");
  validate(mesh, options.threads == 0 ? BuildOptions{} : BuildOptions{{}, options.threads});
  const auto start = std::chrono::steady_clock::now();
  Dag dag;
  with_threads(options.threads,
               [&] { dag = build_valid(mesh, config, options, decimate, locked); });
  dag.report.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return dag;
}

}  // namespace umbel::lod
