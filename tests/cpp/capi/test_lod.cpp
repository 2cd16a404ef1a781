// Levels of detail from C: the same as from C++, and mistakes in sentences.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "capi/lod_call.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using namespace lod_call;

TEST(LodFromC, builds_what_cpp_builds) {
  const Mesh mesh = blob();
  const auto lod = built(mesh, small_config());
  const lod::Dag dag = lod::build(mesh.view(), small_cpp_config());
  umbel_lod_arrays arrays;
  umbel_lod_arrays_init(&arrays);
  ASSERT_EQ(umbel_lod_tables_arrays(umbel_lod_get_tables(lod.get()), &arrays), UMBEL_OK);
  ASSERT_EQ(arrays.group_count, dag.tables.groups.size());
  ASSERT_EQ(arrays.cluster_count, dag.tables.clusters.size());
  ASSERT_EQ(arrays.node_count, dag.tables.nodes.size());
  EXPECT_EQ(std::memcmp(arrays.groups, dag.tables.groups.data(),
                        arrays.group_count * sizeof *arrays.groups),
            0);
  EXPECT_EQ(std::memcmp(arrays.clusters, dag.tables.clusters.data(),
                        arrays.cluster_count * sizeof *arrays.clusters),
            0);
  umbel_lod_report report;
  umbel_lod_report_init(&report);
  ASSERT_EQ(umbel_lod_get_report(lod.get(), &report), UMBEL_OK);
  EXPECT_EQ(report.root_groups, 1u);
  EXPECT_EQ(report.levels, dag.tables.levels.size());
  EXPECT_EQ(report.input_triangles, mesh.triangles.size());
  EXPECT_EQ(report.groups_by_method[0], dag.report.groups_by_method[0]);
  EXPECT_EQ(umbel_lod_verify(lod.get(), 16, 1, nullptr), UMBEL_OK) << umbel_last_error();
}

// Charts of a texture, a second set of coordinates, joints and their weights.
Mesh rich() {
  const Mesh smooth = blob();
  Mesh mesh;
  for (const float chart : {0.0f, 10.0f}) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (size_t v = 0; v < smooth.positions.size(); ++v) {
      mesh.positions.push_back(smooth.positions[v]);
      mesh.uvs.push_back({smooth.uvs[v].x + chart, smooth.uvs[v].y});
    }
    for (const Triangle& t : smooth.triangles)
      if ((smooth.positions[t[0]].x > 0) == (chart > 0))
        mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  mesh.extras = {{ExtraKind::kUvs, 1}, {ExtraKind::kJoints, 0}, {ExtraKind::kWeights, 0}};
  for (const Vec3& p : mesh.positions)
    mesh.extra_values.insert(mesh.extra_values.end(), {p.y, p.z, 1, 2, 0, 0, 0.75f, 0.25f, 0, 0});
  return mesh;
}

TEST(LodFromC, passes_rules_and_weights_and_further_attributes_on) {
  const Mesh mesh = rich();
  umbel_lod_mesh given = c_mesh(mesh);
  given.extras = reinterpret_cast<const umbel_extra*>(mesh.extras.data());
  given.extra_count = mesh.extras.size();
  given.extra_values = mesh.extra_values.data();
  umbel_lod_config config = small_config();
  config.seams = UMBEL_SEAM_PROTECT;
  config.creases = UMBEL_SEAM_IGNORE;
  config.skin_weight = 0.1f;
  const auto lod = built(given, config);
  lod::Config cpp = small_cpp_config();
  cpp.seams = lod::SeamRule::kProtect;
  cpp.creases = lod::SeamRule::kIgnore;
  cpp.skin_weight = 0.1f;
  const lod::Dag dag = lod::build(mesh.view(), cpp);
  expect_groups_of(dag, lod.get());
  cpp.seams = lod::SeamRule::kIgnore;
  EXPECT_FALSE(lod::build(mesh.view(), cpp).tables.groups == dag.tables.groups);

  umbel_lod_view view;
  ASSERT_EQ(umbel_lod_view_level(1, &view), UMBEL_OK);
  const CutMesh shown(lod.get(), view);
  const umbel_lod_mesh& out = shown.arrays;
  ASSERT_EQ(out.extra_count, 3u);
  EXPECT_EQ(out.extras[2].kind, uint32_t{UMBEL_EXTRA_WEIGHTS});
  for (size_t v = 0; v < out.position_count; ++v) {
    EXPECT_EQ(out.extra_values[10 * v], out.positions[v].y);
    EXPECT_EQ(out.extra_values[10 * v + 6], 0.75f);
  }
}

TEST(LodFromC, says_why_each_group_is_as_it_is) {
  const Mesh mesh = shapes::soup(600, 1);
  const auto lod = built(mesh, small_config());
  const lod::Dag dag = lod::build(mesh.view(), small_cpp_config());
  size_t count = 0;
  ASSERT_EQ(umbel_lod_get_limiting_factors(lod.get(), nullptr, 0, &count), UMBEL_OK);
  ASSERT_EQ(count, dag.limiting_factors.size());
  std::vector<uint32_t> limiting_factors(count);
  EXPECT_EQ(umbel_lod_get_limiting_factors(lod.get(), limiting_factors.data(), count - 1, &count),
            UMBEL_ERROR_CAPACITY);
  ASSERT_EQ(umbel_lod_get_limiting_factors(lod.get(), limiting_factors.data(),
                                           limiting_factors.size(), &count),
            UMBEL_OK);
  for (size_t g = 0; g < count; ++g)
    EXPECT_EQ(limiting_factors[g], static_cast<uint32_t>(dag.limiting_factors[g])) << g;
  umbel_lod_report report;
  umbel_lod_report_init(&report);
  ASSERT_EQ(umbel_lod_get_report(lod.get(), &report), UMBEL_OK);
  for (size_t method = 0; method < 5; ++method)
    for (size_t limiting_factor = 0; limiting_factor < lod::kLimitingFactors; ++limiting_factor)
      EXPECT_EQ(report.groups_by_limiting_factor[method][limiting_factor],
                dag.report.groups_by_limiting_factor[method][limiting_factor]);
  EXPECT_EQ(report.groups_by_limiting_factor[4][UMBEL_LOD_LIMIT_COARSEST], 1u);
}

TEST(LodFromC, reports_how_far_estimates_were_from_measured_errors) {
  umbel_lod_config config = small_config();
  config.measured_error = 1;
  const auto lod = built(blob(), config);
  lod::Config same = small_cpp_config();
  same.measured_error = true;
  const lod::Report expected = lod::build(blob().view(), same).report;
  umbel_lod_report report;
  umbel_lod_report_init(&report);
  ASSERT_EQ(umbel_lod_get_report(lod.get(), &report), UMBEL_OK);
  EXPECT_GT(report.measured_groups, 0u);
  EXPECT_EQ(report.measured_groups, expected.measured_groups);
  EXPECT_EQ(report.underestimated_groups, expected.underestimated_groups);
  EXPECT_EQ(report.mean_log2_overestimate, expected.mean_log2_overestimate);
}

TEST(LodFromC, selects_what_cpp_selects) {
  const auto lod = built(blob(), small_config());
  const lod::Dag dag = lod::build(blob().view(), small_cpp_config());
  const umbel_lod_tables* tables = umbel_lod_get_tables(lod.get());
  const float eye[] = {0.4f, 0.2f, 2.5f}, target[] = {0, 0, 0}, up[] = {0, 1, 0};
  umbel_plane planes[6];
  size_t plane_count = 0;
  ASSERT_EQ(umbel_lod_frustum(eye, target, up, 0.5f, 1.5f, 0.1f, 10, planes, &plane_count),
            UMBEL_OK);
  ASSERT_EQ(plane_count, 6u);
  const auto cpp_planes =
      lod::frustum_planes({{0.4f, 0.2f, 2.5f}, {0, 0, 0}, {0, 1, 0}, 0.5f}, 1.5f, 0.1f, 10);
  std::vector<umbel_cluster_bounds> normal_cones(dag.tables.clusters.size());
  ASSERT_EQ(umbel_lod_normal_cones(lod.get(), nullptr, normal_cones.data(), normal_cones.size()),
            UMBEL_OK);
  const auto cpp_facing =
      lod::normal_cone_bounds(dag.tables, [&](uint32_t c) { return dag.geometry(c); });
  const umbel_lod_culling culling{planes, plane_count, normal_cones.data(), normal_cones.size()};
  for (const float pixels : {0.1f, 2.0f, 20.0f, 500.0f}) {
    umbel_lod_view view;
    ASSERT_EQ(umbel_lod_view_camera(eye, 1, 1000, pixels, &view), UMBEL_OK);
    const lod::View cpp_view = lod::view_camera({0.4f, 0.2f, 2.5f}, 1, 1000, pixels);
    for (const auto method : {UMBEL_LOD_FLAT, UMBEL_LOD_HIERARCHY, UMBEL_LOD_BREADTH_FIRST}) {
      EXPECT_EQ(selected(tables, view, nullptr, method), lod::select(dag.tables, cpp_view));
      EXPECT_EQ(selected(tables, view, &culling, method),
                lod::select(dag.tables, cpp_view, {cpp_planes, cpp_facing}));
    }
  }
  umbel_lod_view view;
  ASSERT_EQ(umbel_lod_view_error(0.01f, &view), UMBEL_OK);
  EXPECT_EQ(selected(tables, view, nullptr, UMBEL_LOD_FLAT),
            lod::select(dag.tables, lod::view_error(0.01f)));
  ASSERT_EQ(umbel_lod_view_level(2, &view), UMBEL_OK);
  EXPECT_EQ(selected(tables, view, nullptr, UMBEL_LOD_HIERARCHY),
            lod::select(dag.tables, lod::view_level(2)));
}

TEST(LodFromC, budgets_and_instances_are_those_of_cpp) {
  const auto lod = built(blob(), small_config());
  const lod::Dag dag = lod::build(blob().view(), small_cpp_config());
  const umbel_lod_tables* tables = umbel_lod_get_tables(lod.get());
  umbel_lod_view view, fitting;
  ASSERT_EQ(umbel_lod_view_error(0, &view), UMBEL_OK);
  umbel_lod_budget budget;
  umbel_lod_budget_init(&budget);
  budget.limit = 1000;
  ASSERT_EQ(umbel_lod_view_for_budget(tables, &view, &budget, nullptr, nullptr, 0, &fitting),
            UMBEL_OK);
  EXPECT_EQ(fitting.error, lod::error_for_triangles(dag.tables, 1000));
  const std::vector<umbel_transform> two = {{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}},
                                            {{2, 0, 0, 9, 0, 2, 0, 0, 0, 0, 2, 0}}};
  std::vector<uint32_t> offsets(3), clusters(2 * dag.tables.clusters.size());
  size_t count = 0;
  ASSERT_EQ(umbel_lod_select_instances(tables, &fitting, nullptr, two.data(), 2, offsets.data(),
                                       clusters.data(), clusters.size(), &count),
            UMBEL_OK);
  const Transform cpp[] = {Transform{}, {{2, 0, 0, 9, 0, 2, 0, 0, 0, 0, 2, 0}}};
  const lod::InstanceCuts cuts =
      lod::select_instances(dag.tables, lod::view_error(fitting.error), {}, cpp);
  clusters.resize(count);
  EXPECT_EQ(offsets, cuts.offsets);
  EXPECT_EQ(clusters, cuts.clusters);
  EXPECT_DOUBLE_EQ(umbel_angular_error(1, 2), std::asin(0.5));
  EXPECT_DOUBLE_EQ(umbel_pixel_error(1, 2, 1, 100), lod::pixel_error(1, 2, 1, 100));
  EXPECT_TRUE(std::isnan(umbel_angular_error(-1, 2)));
}

TEST(LodFromC, instances_that_cannot_be_are_named) {
  const auto lod = built(blob(), small_config());
  const umbel_lod_tables* tables = umbel_lod_get_tables(lod.get());
  umbel_lod_view view, fitting;
  ASSERT_EQ(umbel_lod_view_error(0, &view), UMBEL_OK);
  umbel_lod_budget budget;
  umbel_lod_budget_init(&budget);
  const umbel_transform all[] = {{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}},
                                 {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, NAN}}};
  uint32_t offsets[3];
  size_t count = 0;
  const auto expect_named = [](umbel_result result, const std::string& sentence) {
    EXPECT_EQ(result, UMBEL_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(umbel_last_error(), sentence);
  };
  const char* const second = "instances[1] has a NaN or infinite value";
  expect_named(
      umbel_lod_select_instances(tables, &view, nullptr, all, 2, offsets, nullptr, 0, &count),
      second);
  expect_named(umbel_lod_view_for_budget(tables, &view, &budget, nullptr, all, 2, &fitting),
               second);
  expect_named(umbel_lod_select_for_budget(tables, &view, &budget, nullptr, all, 2, offsets,
                                           nullptr, 0, &count, nullptr),
               second);
  expect_named(
      umbel_lod_select_instances(tables, &view, nullptr, all, SIZE_MAX, offsets, nullptr, 0,
                                 &count),
      "instance_count is " + std::to_string(SIZE_MAX) + ", more than 32-bit indices can name");
}

TEST(LodFromC, counts_beyond_32_bits_are_named) {
  const Mesh mesh = shapes::grid(2, 2);
  umbel_lod* lod = nullptr;
  umbel_lod_mesh given = c_mesh(mesh);
  given.position_stride = 16;
  given.position_count = SIZE_MAX / 8;
  EXPECT_EQ(umbel_lod_build(&given, nullptr, nullptr, &lod), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_last_error(), "mesh->position_count is " + std::to_string(SIZE_MAX / 8) +
                                    ", more than 32-bit indices can name");
  given = c_mesh(mesh);
  given.triangle_count = SIZE_MAX / 8;
  EXPECT_EQ(umbel_lod_build(&given, nullptr, nullptr, &lod), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_last_error(), "mesh->triangle_count is " + std::to_string(SIZE_MAX / 8) +
                                    ", more than 32-bit indices can name");
  given = c_mesh(mesh);
  const umbel_extra extra{UMBEL_EXTRA_UVS, 1};
  given.extras = &extra;
  given.extra_count = SIZE_MAX;
  EXPECT_EQ(umbel_lod_build(&given, nullptr, nullptr, &lod), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_last_error(),
            "mesh->extra_count is " + std::to_string(SIZE_MAX) + ", at most 40 are possible");
}

TEST(LodFromC, gives_cuts_as_meshes_and_files) {
  const Mesh mesh = blob();
  const auto lod = built(mesh, small_config());
  umbel_lod_view view;
  umbel_lod_view_level(0, &view);
  const CutMesh shown(lod.get(), view);
  const umbel_lod_mesh& arrays = shown.arrays;
  EXPECT_EQ(arrays.triangle_count, mesh.triangles.size());
  EXPECT_NE(arrays.uvs, nullptr);
  EXPECT_EQ(arrays.normals, nullptr);

  const auto path = std::filesystem::temp_directory_path() / "umbel_test_lod_from_c.umbel";
  ASSERT_EQ(umbel_lod_save(lod.get(), path.c_str(), 1, nullptr), UMBEL_OK) << umbel_last_error();
  umbel_lod_tables* opened = nullptr;
  ASSERT_EQ(umbel_lod_tables_open(path.c_str(), &opened), UMBEL_OK) << umbel_last_error();
  const std::unique_ptr<umbel_lod_tables, Free> tables(opened);
  umbel_lod_view_error(0.02f, &view);
  EXPECT_EQ(selected(opened, view, nullptr, UMBEL_LOD_HIERARCHY),
            selected(umbel_lod_get_tables(lod.get()), view, nullptr, UMBEL_LOD_FLAT));
  std::filesystem::remove(path);
}

TEST(LodFromC, saves_where_the_world_is) {
  const auto lod = built(blob(), small_config());
  const umbel_vec3d origin{500000.25, 4649776, -0.125};
  const auto path = std::filesystem::temp_directory_path() / "umbel_test_lod_origin_from_c.umbel";
  ASSERT_EQ(umbel_lod_save_at(lod.get(), path.c_str(), 1, origin, nullptr), UMBEL_OK);
  umbel_asset* asset = nullptr;
  ASSERT_EQ(umbel_asset_open(path.c_str(), &asset), UMBEL_OK) << umbel_last_error();
  umbel_asset_info info;
  umbel_asset_info_init(&info);
  ASSERT_EQ(umbel_asset_get_info(asset, &info), UMBEL_OK);
  EXPECT_EQ(info.origin.x, origin.x);
  EXPECT_EQ(info.origin.y, origin.y);
  EXPECT_EQ(info.origin.z, origin.z);
  const umbel_vec3 local = umbel_relative_to(info.origin, {500000.5, 4649776.0625, 0});
  EXPECT_EQ(local.x, 0.25f);
  EXPECT_EQ(local.y, 0.0625f);
  EXPECT_EQ(local.z, 0.125f);
  umbel_asset_free(asset);
  const umbel_vec3d nowhere{std::nan(""), 0, 0};
  EXPECT_EQ(umbel_lod_save_at(lod.get(), path.c_str(), 1, nowhere, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  std::filesystem::remove(path);
}

TEST(LodFromC, tables_can_come_from_anywhere_and_are_checked) {
  const auto lod = built(blob(), small_config());
  umbel_lod_arrays arrays;
  umbel_lod_arrays_init(&arrays);
  ASSERT_EQ(umbel_lod_tables_arrays(umbel_lod_get_tables(lod.get()), &arrays), UMBEL_OK);
  umbel_lod_tables* made = nullptr;
  ASSERT_EQ(umbel_lod_tables_create(&arrays, &made), UMBEL_OK) << umbel_last_error();
  umbel_lod_tables_free(made);
  std::vector<umbel_lod_cluster> wrong(arrays.clusters, arrays.clusters + arrays.cluster_count);
  wrong.back().generating_group = 1u << 20;
  arrays.clusters = wrong.data();
  EXPECT_EQ(umbel_lod_tables_create(&arrays, &made), UMBEL_ERROR_CORRUPT);
  EXPECT_EQ(made, nullptr);
  EXPECT_NE(std::string(umbel_last_error()).find("1048576"), std::string::npos);
}

TEST(LodFromC, mistakes_are_named) {
  const auto expect = [](umbel_result got, umbel_result wanted, const char* part) {
    EXPECT_EQ(got, wanted) << part;
    EXPECT_NE(std::string(umbel_last_error()).find(part), std::string::npos) << umbel_last_error();
  };
  const Mesh mesh = blob();
  umbel_lod_mesh given = c_mesh(mesh);
  umbel_lod* lod = nullptr;
  umbel_lod_config config = small_config();
  expect(umbel_lod_build(nullptr, nullptr, nullptr, &lod), UMBEL_ERROR_INVALID_ARGUMENT, "mesh");
  expect(umbel_lod_build(&given, nullptr, nullptr, nullptr), UMBEL_ERROR_INVALID_ARGUMENT, "lod");
  given.struct_size = 0;
  expect(umbel_lod_build(&given, nullptr, nullptr, &lod), UMBEL_ERROR_INVALID_ARGUMENT,
         "struct_size");
  given = c_mesh(mesh);
  given.triangles = nullptr;
  expect(umbel_lod_build(&given, nullptr, nullptr, &lod), UMBEL_ERROR_INVALID_ARGUMENT,
         "triangles");
  given = c_mesh(mesh);
  config.max_triangles = 1000;
  expect(umbel_lod_build(&given, &config, nullptr, &lod), UMBEL_ERROR_INVALID_ARGUMENT, "1000");
  EXPECT_EQ(lod, nullptr);
  umbel_build_options options;
  umbel_build_options_init(&options);
  options.progress = [](float, const char*, void*) { return 0; };
  config = small_config();
  expect(umbel_lod_build(&given, &config, &options, &lod), UMBEL_ERROR_CANCELLED, "cancel");

  const auto good = built(mesh, small_config());
  const umbel_lod_tables* tables = umbel_lod_get_tables(good.get());
  umbel_lod_view view;
  expect(umbel_lod_view_error(-1, &view), UMBEL_ERROR_INVALID_ARGUMENT, "error");
  ASSERT_EQ(umbel_lod_view_error(0, &view), UMBEL_OK);
  size_t count = 0;
  expect(umbel_lod_select(nullptr, &view, nullptr, UMBEL_LOD_FLAT, nullptr, 0, &count),
         UMBEL_ERROR_INVALID_ARGUMENT, "tables");
  expect(umbel_lod_select(tables, nullptr, nullptr, UMBEL_LOD_FLAT, nullptr, 0, &count),
         UMBEL_ERROR_INVALID_ARGUMENT, "view");
  expect(umbel_lod_select(tables, &view, nullptr, static_cast<umbel_lod_method>(3), nullptr, 0,
                          &count),
         UMBEL_ERROR_INVALID_ARGUMENT, "method");
  uint32_t one = 0;
  expect(umbel_lod_select(tables, &view, nullptr, UMBEL_LOD_FLAT, &one, 1, &count),
         UMBEL_ERROR_CAPACITY, "cut has room");
  EXPECT_GT(count, 1u);
  view.kind = 9;
  expect(umbel_lod_select(tables, &view, nullptr, UMBEL_LOD_FLAT, &one, 1, &count),
         UMBEL_ERROR_INVALID_ARGUMENT, "kind");
  umbel_lod_tables* opened = nullptr;
  expect(umbel_lod_tables_open("/nowhere/at.all", &opened), UMBEL_ERROR_IO, "nowhere");
  EXPECT_EQ(umbel_lod_get_tables(nullptr), nullptr);
  umbel_lod_free(nullptr);
  umbel_lod_tables_free(nullptr);
  umbel_mesh_free(nullptr);
}

}  // namespace
}  // namespace umbel
