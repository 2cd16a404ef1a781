// Continuous level of detail from C (umbel_lod.h): building, saving, checking, selecting. The
// structs of umbel_lod.h stand for the C++ ones in arrays; only tables are copied.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

#include "base/fields.hpp"
#include "base/parallel.hpp"
#include "capi/cluster_input.hpp"
#include "capi/geometry.hpp"
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
  COPY_FIELDS(result, report, input_triangles, input_vertices, degenerate_triangles,
              root_triangles);
  std::copy(report.groups_by_method.begin(), report.groups_by_method.end(),
            result.groups_by_method);
  for (size_t method = 0; method < report.groups_by_limiting_factor.size(); ++method)
    std::ranges::copy(report.groups_by_limiting_factor[method],
                      result.groups_by_limiting_factor[method]);
  std::ranges::copy(report.waits_by_limiting_factor, result.waits_by_limiting_factor);
  COPY_FIELDS(result, report, seconds, mean_log2_overestimate, measured_groups,
              underestimated_groups);
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
                report.problems.empty() ? "verification failed" : report.problems.front());
}

static_assert(offsetof(umbel_lod_group, sphere) == offsetof(lod::Group, sphere));
static_assert(offsetof(umbel_lod_group, error) == offsetof(lod::Group, error));
static_assert(offsetof(umbel_lod_cluster, material) == offsetof(lod::Cluster, material));
static_assert(offsetof(umbel_lod_cluster, box) == offsetof(lod::Cluster, box));
static_assert(offsetof(umbel_lod_node, group) == offsetof(lod::Node, group));
static_assert(offsetof(umbel_lod_node, children) == offsetof(lod::Node, children));
static_assert(offsetof(umbel_plane, offset) == offsetof(Plane, offset));

void write(const lod::View& view, umbel_lod_view* out) {
  required(out, "view") = {static_cast<uint32_t>(view.kind),
                           view.error,
                           {view.eye.x, view.eye.y, view.eye.z},
                           view.threshold,
                           view.level};
}

lod::Culling culling_of(const umbel_lod_culling* given) {
  if (!given) return {};
  return {elements<const Plane>(given->planes, given->plane_count, "culling->planes"),
          elements<const ClusterBounds>(given->normal_cones, given->normal_cone_count,
                                        "culling->normal_cones")};
}

std::vector<uint32_t> select_by(umbel_lod_method method, const lod::Tables& tables,
                                const lod::View& view, const lod::Culling& culling) {
  switch (method) {
    case UMBEL_LOD_FLAT:
      return lod::select(tables, view, culling);
    case UMBEL_LOD_HIERARCHY:
      return lod::select_hierarchy(tables, view, culling);
    case UMBEL_LOD_BREADTH_FIRST:
      return lod::select_breadth_first(tables, view, culling);
  }
  throw Error(ErrorCode::kInvalidArgument,
              "method is " + std::to_string(static_cast<int>(method)) + ", which is none");
}

Vec3 point(const float* values, const char* name) {
  required(values, name);
  return {values[0], values[1], values[2]};
}

bool is_finite(const Transform& transform) {
  return std::ranges::all_of(transform.rows, [](float value) { return std::isfinite(value); });
}

const Transform& transform_of(const umbel_transform* given) {
  const Transform& transform = elements<const Transform>(given, 1, "transform")[0];
  if (is_finite(transform)) return transform;
  throw Error(ErrorCode::kInvalidArgument, "transform has a NaN or infinite value");
}

std::span<const Transform> transforms_of(const umbel_transform* instances, size_t count) {
  check_nameable(count, "instance_count");
  const auto all = elements<const Transform>(instances, count, "instances");
  for (size_t i = 0; i < all.size(); ++i)
    if (!is_finite(all[i]))
      throw Error(ErrorCode::kInvalidArgument,
                  "instances[" + std::to_string(i) + "] has a NaN or infinite value");
  return all;
}

template <typename To, typename From>
std::vector<To> copied(const From* array, size_t count, const char* name) {
  const auto all = elements<const To>(array, count, name);
  return {all.begin(), all.end()};
}

std::vector<uint32_t> chosen_clusters(const lod::Dag& dag, const uint32_t* clusters, size_t count) {
  const size_t all = dag.tables.clusters.size();
  std::vector<uint32_t> chosen(clusters ? count : all);
  if (!clusters) {
    std::iota(chosen.begin(), chosen.end(), 0u);
    return chosen;
  }
  for (size_t i = 0; i < count; ++i) {
    if (clusters[i] >= all)
      throw Error(ErrorCode::kInvalidArgument, "clusters[" + std::to_string(i) + "] is " +
                                                   std::to_string(clusters[i]) +
                                                   ", but there are " + std::to_string(all));
    chosen[i] = clusters[i];
  }
  return chosen;
}

ClusterStreams streams_of(const Mesh& mesh) {
  return {streams_in(mesh) | UMBEL_LOD_SOURCE_VERTICES, without_material(mesh.extras)};
}

void get_geometry(const lod::Dag& dag, std::span<const uint32_t> chosen,
                  const BuildOptions& options, umbel_lod_geometry* geometry) {
  std::vector<lod::Cluster> clusters;
  for (const uint32_t c : chosen) clusters.push_back(dag.tables.clusters[c]);
  const GeometryArrays arrays(clusters, streams_of(dag.vertices), geometry);
  if (!arrays.need_geometry()) return;
  with_threads(options.threads, [&] {
    parallel_for(chosen.size(), 32, [&](size_t i) {
      const uint32_t c = chosen[i];
      std::vector<uint32_t> sources;
      if (arrays.want_sources())
        for (uint32_t v = dag.vertex_offsets[c]; v < dag.vertex_offsets[c + 1]; ++v)
          sources.push_back(dag.source_vertices[dag.cluster_vertices[v]]);
      arrays.write(i, dag.geometry(c), sources);
    });
  });
}

// What a budget counts; `own` holds costs that are not the caller's array.
struct Budget {
  lod::Costs costs;
  uint64_t limit;
  std::vector<uint32_t> own;
};

Budget budget_of(const lod::Tables& tables, const umbel_lod_budget* given) {
  const umbel_lod_budget budget = read_struct(given, "budget");
  Budget result;
  result.limit = budget.limit == UMBEL_NO_LIMIT || budget.limit == UMBEL_NONE
                     ? std::numeric_limits<uint64_t>::max()
                     : budget.limit;
  switch (budget.unit) {
    case UMBEL_LOD_TRIANGLES:
      result.own = lod::triangle_costs(tables);
      result.costs = lod::Costs(result.own);
      return result;
    case UMBEL_LOD_CLUSTERS:
      result.own.assign(tables.clusters.size(), 1);
      result.costs = lod::Costs(result.own);
      return result;
    case UMBEL_LOD_GROUPS:
      result.own.assign(tables.groups.size(), 1);
      result.costs.groups = result.own;
      return result;
    case UMBEL_LOD_COSTS:
      result.costs = {elements<const uint32_t>(budget.cluster_costs, budget.cluster_cost_count,
                                               "budget->cluster_costs"),
                      elements<const uint32_t>(budget.group_costs, budget.group_cost_count,
                                               "budget->group_costs")};
      return result;
    default:
      throw Error(ErrorCode::kInvalidArgument, "budget->unit is " + std::to_string(budget.unit) +
                                                   ", must be an umbel_lod_budget_unit");
  }
}

lod::Tables copied(const umbel_lod_arrays& arrays) {
  return {copied<Range>(arrays.levels, arrays.level_count, "arrays->levels"),
          copied<lod::Group>(arrays.groups, arrays.group_count, "arrays->groups"),
          copied<lod::Cluster>(arrays.clusters, arrays.cluster_count, "arrays->clusters"),
          copied<lod::Node>(arrays.nodes, arrays.node_count, "arrays->nodes")};
}

}  // namespace
}  // namespace umbel::capi

using namespace umbel;

umbel_result umbel_lod_build(const umbel_lod_mesh* mesh, const umbel_lod_config* config,
                             const umbel_build_options* options, umbel_lod** lod) {
  return capi::hand_out(lod, "lod", [&] {
    const capi::LodMesh given = capi::lod_mesh(mesh);
    umbel_lod made{lod::build(given.view, capi::lod_config(config), capi::build_options(options),
                              capi::lod_decimator(config), given.locked),
                   {}};
    made.tables.tables = made.dag.tables;
    return made;
  });
}

void umbel_lod_free(umbel_lod* lod) { delete lod; }

umbel_result umbel_lod_get_report(const umbel_lod* lod, umbel_lod_report* report) {
  return capi::guard(
      [&] { capi::write_struct(capi::report_of(capi::required(lod, "lod")), report, "report"); });
}

umbel_result umbel_lod_get_limiting_factors(const umbel_lod* lod, uint32_t* limiting_factors,
                                            size_t capacity, size_t* count) {
  return capi::hand_out_found(limiting_factors, "limiting_factors", capacity, count, [&] {
    std::vector<uint32_t> numbers;
    for (const lod::LimitingFactor limiting_factor :
         capi::required(lod, "lod").dag.limiting_factors)
      numbers.push_back(static_cast<uint32_t>(limiting_factor));
    return numbers;
  });
}

umbel_result umbel_lod_verify(const umbel_lod* lod, uint32_t cuts, uint32_t seed,
                              const umbel_build_options* options) {
  return capi::guard(
      [&] { capi::verify(capi::required(lod, "lod"), cuts, seed, capi::build_options(options)); });
}

umbel_result umbel_lod_mesh_of_cut(const umbel_lod* lod, const uint32_t* cut, size_t count,
                                   umbel_mesh** mesh) {
  return capi::hand_out(mesh, "mesh", [&] {
    const umbel_lod& given = capi::required(lod, "lod");
    return umbel_mesh{lod::mesh_of_cut(
        given.dag.tables, [&](uint32_t c) { return capi::geometry(given, c); },
        capi::elements<const uint32_t>(cut, count, "cut"))};
  });
}

umbel_result umbel_lod_get_geometry(const umbel_lod* lod, const uint32_t* clusters, size_t count,
                                    const umbel_build_options* options,
                                    umbel_lod_geometry* geometry) {
  return capi::guard([&] {
    const lod::Dag& dag = capi::required(lod, "lod").dag;
    capi::get_geometry(dag, capi::chosen_clusters(dag, clusters, count),
                       capi::build_options(options), geometry);
  });
}

umbel_result umbel_mesh_arrays(const umbel_mesh* mesh, umbel_lod_mesh* arrays) {
  return capi::guard([&] {
    const umbel_mesh& given = capi::required(mesh, "mesh");
    capi::write_struct(capi::mesh_as_c(given.mesh.view()), arrays, "arrays");
  });
}

void umbel_mesh_free(umbel_mesh* mesh) { delete mesh; }

umbel_result umbel_lod_normal_cones(const umbel_lod* lod, const umbel_build_options* options,
                                    umbel_cluster_bounds* bounds, size_t capacity) {
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

const umbel_lod_tables* umbel_lod_get_tables(const umbel_lod* lod) {
  return lod ? &lod->tables : nullptr;
}

umbel_result umbel_lod_tables_open(const char* path, umbel_lod_tables** tables) {
  return capi::hand_out(tables, "tables", [&] {
    return umbel_lod_tables{Asset(&capi::required(path, "path")).tables()};
  });
}

umbel_result umbel_lod_tables_create(const umbel_lod_arrays* arrays, umbel_lod_tables** tables) {
  return capi::hand_out(tables, "tables", [&] {
    lod::Tables made = capi::copied(capi::read_struct(arrays, "arrays"));
    lod::complete(made);
    lod::validate(made);
    return umbel_lod_tables{std::move(made)};
  });
}

void umbel_lod_tables_free(umbel_lod_tables* tables) { delete tables; }

umbel_result umbel_lod_tables_arrays(const umbel_lod_tables* tables, umbel_lod_arrays* arrays) {
  return capi::guard([&] {
    const lod::Tables& given = capi::required(tables, "tables").tables;
    umbel_lod_arrays result{};
    result.levels = reinterpret_cast<const umbel_range*>(given.levels.data());
    result.level_count = given.levels.size();
    result.groups = reinterpret_cast<const umbel_lod_group*>(given.groups.data());
    result.group_count = given.groups.size();
    result.clusters = reinterpret_cast<const umbel_lod_cluster*>(given.clusters.data());
    result.cluster_count = given.clusters.size();
    result.nodes = reinterpret_cast<const umbel_lod_node*>(given.nodes.data());
    result.node_count = given.nodes.size();
    capi::write_struct(result, arrays, "arrays");
  });
}

umbel_result umbel_lod_view_error(float error, umbel_lod_view* view) {
  return capi::guard([&] { capi::write(lod::view_error(error), view); });
}

umbel_result umbel_lod_view_camera(const float eye[3], float fov_y, uint32_t height,
                                   float pixel_error, umbel_lod_view* view) {
  return capi::guard([&] {
    capi::write(lod::view_camera(capi::point(eye, "eye"), fov_y, height, pixel_error), view);
  });
}

umbel_result umbel_lod_view_level(uint32_t level, umbel_lod_view* view) {
  return capi::guard([&] { capi::write(lod::view_level(level), view); });
}

umbel_result umbel_lod_frustum(const float eye[3], const float target[3], const float up[3],
                               float fov_y, float aspect, float near_plane, float far_plane,
                               umbel_plane planes[6], size_t* count) {
  return capi::guard([&] {
    const auto made = lod::frustum_planes(
        {capi::point(eye, "eye"), capi::point(target, "target"), capi::point(up, "up"), fov_y},
        aspect, near_plane, far_plane);
    const auto room = capi::elements<Plane>(planes, 6, "planes");
    capi::required(count, "count") = made.size();
    std::copy(made.begin(), made.end(), room.begin());
  });
}

umbel_result umbel_lod_view_in_instance(const umbel_lod_view* view,
                                        const umbel_transform* transform, umbel_lod_view* result) {
  return capi::guard([&] {
    capi::write(lod::to_object(capi::view_of(view), capi::transform_of(transform)), result);
  });
}

umbel_result umbel_lod_plane_in_instance(const umbel_plane* plane, const umbel_transform* transform,
                                         umbel_plane* result) {
  return capi::guard([&] {
    const auto given = capi::elements<const Plane>(plane, 1, "plane");
    const auto to = capi::elements<Plane>(result, 1, "result");
    to[0] = lod::to_object(given[0], capi::transform_of(transform));
  });
}

umbel_result umbel_lod_select(const umbel_lod_tables* tables, const umbel_lod_view* view,
                              const umbel_lod_culling* culling, umbel_lod_method method,
                              uint32_t* cut, size_t capacity, size_t* count) {
  return capi::guard([&] {
    capi::hand_out_all(capi::select_by(method, capi::required(tables, "tables").tables,
                                       capi::view_of(view), capi::culling_of(culling)),
                       cut, "cut", capacity, count);
  });
}

umbel_result umbel_lod_select_instances(const umbel_lod_tables* tables, const umbel_lod_view* view,
                                        const umbel_lod_culling* culling,
                                        const umbel_transform* instances, size_t instance_count,
                                        uint32_t* offsets, uint32_t* clusters, size_t capacity,
                                        size_t* count) {
  return capi::guard([&] {
    const auto transforms = capi::transforms_of(instances, instance_count);
    const lod::InstanceCuts cuts =
        lod::select_instances(capi::required(tables, "tables").tables, capi::view_of(view),
                              capi::culling_of(culling), transforms);
    const auto room = capi::elements<uint32_t>(offsets, instance_count + 1, "offsets");
    capi::hand_out_all(cuts.clusters, clusters, "clusters", capacity, count);
    std::copy(cuts.offsets.begin(), cuts.offsets.end(), room.begin());
  });
}

umbel_result umbel_lod_view_for_budget(const umbel_lod_tables* tables, const umbel_lod_view* view,
                                       const umbel_lod_budget* budget,
                                       const umbel_lod_culling* culling,
                                       const umbel_transform* instances, size_t instance_count,
                                       umbel_lod_view* result) {
  return capi::guard([&] {
    const lod::Tables& given = capi::required(tables, "tables").tables;
    const capi::Budget wanted = capi::budget_of(given, budget);
    capi::write(lod::view_for_budget(given, capi::view_of(view), wanted.costs, wanted.limit,
                                     capi::culling_of(culling),
                                     capi::transforms_of(instances, instance_count)),
                result);
  });
}

umbel_result umbel_lod_select_for_budget(const umbel_lod_tables* tables, const umbel_lod_view* view,
                                         const umbel_lod_budget* budget,
                                         const umbel_lod_culling* culling,
                                         const umbel_transform* instances, size_t instance_count,
                                         uint32_t* offsets, uint32_t* clusters, size_t capacity,
                                         size_t* count, uint64_t* cost) {
  return capi::guard([&] {
    const lod::Tables& given = capi::required(tables, "tables").tables;
    const capi::Budget wanted = capi::budget_of(given, budget);
    const lod::BudgetCuts made = lod::select_for_budget(
        given, capi::view_of(view), wanted.costs, wanted.limit, capi::culling_of(culling),
        capi::transforms_of(instances, instance_count));
    if (cost) *cost = made.cost;
    const auto room = capi::elements<uint32_t>(offsets, made.cuts.offsets.size(), "offsets");
    capi::hand_out_all(made.cuts.clusters, clusters, "clusters", capacity, count);
    std::ranges::copy(made.cuts.offsets, room.begin());
  });
}

double umbel_angular_error(double error, double distance) {
  if (!(error >= 0)) return std::numeric_limits<double>::quiet_NaN();
  return umbel::lod::angular_error(error, distance);
}

double umbel_pixel_error(double error, double distance, double fov_y, uint32_t height) {
  if (!(error >= 0)) return std::numeric_limits<double>::quiet_NaN();
  return umbel::lod::pixel_error(error, distance, fov_y, height);
}
