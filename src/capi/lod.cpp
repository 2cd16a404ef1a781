// Building levels of detail from C.
#include <algorithm>

#include "capi/cluster_input.hpp"
#include "capi/hand_out.hpp"
#include "capi/lod_input.hpp"
#include "capi/structs.hpp"
#include "umbel/asset.hpp"

namespace umbel::capi {
namespace {

umbel_lod_report report_of(const umbel_lod& lod) {
  const lod::Report& report = lod.dag.report;
  umbel_lod_report result{};
  result.root_groups = report.root_groups;
  result.stuck_groups = report.stuck_groups;
  result.levels = static_cast<uint32_t>(lod.tables.tables.levels.size());
  result.input_triangles = report.input_triangles;
  result.input_vertices = report.input_vertices;
  result.degenerate_triangles = report.degenerate_triangles;
  result.root_triangles = report.root_triangles;
  std::copy(report.groups_by_method.begin(), report.groups_by_method.end(),
            result.groups_by_method);
  for (size_t method = 0; method < report.groups_by_limiting_factor.size(); ++method)
    std::ranges::copy(report.groups_by_limiting_factor[method],
                      result.groups_by_limiting_factor[method]);
  std::ranges::copy(report.waits_by_limiting_factor, result.waits_by_limiting_factor);
  result.seconds = report.seconds;
  result.mean_log2_overestimate = report.mean_log2_overestimate;
  result.measured_groups = report.measured_groups;
  result.underestimated_groups = report.underestimated_groups;
  return result;
}

lod::ClusterGeometry geometry(const umbel_lod& lod, uint32_t cluster) {
  return lod.dag.geometry(cluster);
}

void verify(const umbel_lod& lod, uint32_t cuts, uint32_t seed, const BuildOptions& options) {
  lod::VerifyConfig config;
  config.cuts = cuts;
  config.seed = seed;
  config.max_triangles = lod.dag.config.max_triangles;
  config.max_vertices = lod.dag.config.max_vertices;
  config.source_triangles = lod.dag.report.input_triangles;
  config.source_digest = lod.dag.source_digest;
  const lod::VerifyReport report =
      lod::verify(lod.dag.tables, [&](uint32_t c) { return geometry(lod, c); }, config, options);
  if (!report.ok)
    throw Error(ErrorCode::kCorrupt,
                report.problems.empty() ? "the proof failed" : report.problems.front());
}

}  // namespace
}  // namespace umbel::capi

umbel_result umbel_lod_build(const umbel_lod_mesh* mesh, const umbel_lod_config* config,
                             const umbel_build_options* options, umbel_lod** lod) {
  using namespace umbel;
  return capi::hand_out(lod, "lod", [&] {
    umbel_lod made{lod::build(capi::lod_mesh(mesh), capi::lod_config(config),
                              capi::build_options(options), capi::lod_decimator(config)),
                   {}};
    made.tables.tables = made.dag.tables;
    return made;
  });
}

void umbel_lod_free(umbel_lod* lod) { delete lod; }

umbel_result umbel_lod_get_report(const umbel_lod* lod, umbel_lod_report* report) {
  using namespace umbel;
  return capi::guard(
      [&] { capi::write_struct(capi::report_of(capi::required(lod, "lod")), report, "report"); });
}

umbel_result umbel_lod_get_limiting_factors(const umbel_lod* lod, uint32_t* limiting_factors,
                                            size_t capacity, size_t* count) {
  using namespace umbel;
  return capi::hand_out_found(limiting_factors, "limiting_factors", capacity, count, [&] {
    std::vector<uint32_t> numbers;
    for (const lod::LimitingFactor limiting_factor :
         capi::required(lod, "lod").dag.limiting_factors)
      numbers.push_back(static_cast<uint32_t>(limiting_factor));
    return numbers;
  });
}

umbel_result umbel_lod_save(const umbel_lod* lod, const char* path, int exact,
                            const umbel_build_options* options) {
  return umbel_lod_save_at(lod, path, exact, {0, 0, 0}, options);
}

umbel_result umbel_lod_save_at(const umbel_lod* lod, const char* path, int exact,
                               umbel_vec3d origin, const umbel_build_options* options) {
  using namespace umbel;
  return capi::guard([&] {
    AssetContents contents;
    contents.meshes = {&capi::required(lod, "lod").dag};
    contents.origin = {origin.x, origin.y, origin.z};
    write_asset(&capi::required(path, "path"), contents, capi::build_options(options),
                exact ? AssetConfig::exact() : AssetConfig{});
  });
}

umbel_result umbel_lod_verify(const umbel_lod* lod, uint32_t cuts, uint32_t seed,
                              const umbel_build_options* options) {
  using namespace umbel;
  return capi::guard(
      [&] { capi::verify(capi::required(lod, "lod"), cuts, seed, capi::build_options(options)); });
}

umbel_result umbel_lod_mesh_of_cut(const umbel_lod* lod, const uint32_t* cut, size_t count,
                                   umbel_mesh** mesh) {
  using namespace umbel;
  return capi::hand_out(mesh, "mesh", [&] {
    const umbel_lod& given = capi::required(lod, "lod");
    return umbel_mesh{lod::mesh_of_cut(
        given.dag.tables, [&](uint32_t c) { return capi::geometry(given, c); },
        capi::elements<const uint32_t>(cut, count, "cut"))};
  });
}

umbel_result umbel_mesh_arrays(const umbel_mesh* mesh, umbel_lod_mesh* arrays) {
  using namespace umbel;
  return capi::guard([&] {
    const umbel_mesh& given = capi::required(mesh, "mesh");
    capi::write_struct(capi::mesh_as_c(given.mesh.view()), arrays, "arrays");
  });
}

void umbel_mesh_free(umbel_mesh* mesh) { delete mesh; }

umbel_result umbel_lod_normal_cones(const umbel_lod* lod, const umbel_build_options* options,
                                    umbel_cull_bounds* bounds, size_t capacity) {
  using namespace umbel;
  return capi::guard([&] {
    const umbel_lod& given = capi::required(lod, "lod");
    const size_t count = given.dag.tables.clusters.size();
    if (capacity < count)
      throw capi::CapacityError{"capacity is " + std::to_string(capacity) + ", but " +
                                std::to_string(count) + " are needed"};
    const auto room = capi::elements<ClusterBounds>(bounds, capacity, "bounds");
    const auto made = lod::normal_cone_bounds(
        given.dag.tables, [&](uint32_t c) { return capi::geometry(given, c); },
        capi::build_options(options));
    std::copy(made.begin(), made.end(), room.begin());
  });
}
