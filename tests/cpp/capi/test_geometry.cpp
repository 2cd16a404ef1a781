// The geometry of many clusters in one call: of a build, of a cut, of a page.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <set>
#include <string>

#include "asset/scratch.hpp"
#include "capi/lod_call.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using namespace lod_call;
using umbel::testing::Scratch;

// A caller's arrays.
struct Geometry {
  Geometry() { umbel_lod_geometry_init(&c); }

  void reserve() {
    c.cluster_capacity = c.cluster_count;
    c.vertex_capacity = c.vertex_count;
    c.triangle_capacity = c.triangle_count;
    const auto room = [](auto& array, size_t count, auto*& pointer) {
      array.resize(count + 1);
      pointer = array.data();
    };
    room(vertex_offsets, c.cluster_count, c.vertex_offsets);
    room(triangle_offsets, c.cluster_count, c.triangle_offsets);
    room(materials, c.cluster_count, c.materials);
    room(positions, c.vertex_count, c.positions);
    room(normals, c.vertex_count, c.normals);
    room(uvs, c.vertex_count, c.uvs);
    room(extra_values, c.vertex_count * c.extra_width, c.extra_values);
    room(source_vertices, c.vertex_count, c.source_vertices);
    room(triangles, 3 * c.triangle_count, c.triangles);
    room(triangle_materials, c.triangle_count, c.triangle_materials);
  }

  umbel_lod_geometry c;
  std::vector<uint32_t> vertex_offsets, triangle_offsets, materials, source_vertices,
      triangle_materials;
  std::vector<umbel_vec3> positions, normals;
  std::vector<umbel_vec2> uvs;
  std::vector<float> extra_values;
  std::vector<uint8_t> triangles;
};

// With everything that is checked below: materials, normals, UVs and a second set.
Mesh rich() {
  Mesh mesh = blob();
  for (size_t i = 0; i < mesh.triangles.size(); ++i) mesh.materials.push_back(i % 3 == 0 ? 4 : 2);
  mesh.normals = mesh.positions;
  mesh.extras = {{ExtraKind::kUvs, 1}};
  for (const Vec3& p : mesh.positions)
    mesh.extra_values.insert(mesh.extra_values.end(), {p.z, p.x});
  return mesh;
}

std::unique_ptr<umbel_lod, Free> built_rich(const Mesh& mesh, umbel_lod_config config) {
  umbel_lod_mesh given = c_mesh(mesh);
  given.normals = reinterpret_cast<const umbel_vec3*>(mesh.normals.data());
  given.extras = reinterpret_cast<const umbel_extra*>(mesh.extras.data());
  given.extra_count = mesh.extras.size();
  given.extra_values = mesh.extra_values.data();
  umbel_lod* lod = nullptr;
  EXPECT_EQ(umbel_lod_build(&given, &config, nullptr, &lod), UMBEL_OK) << umbel_last_error();
  return std::unique_ptr<umbel_lod, Free>(lod);
}

TEST(LodGeometry, one_call_gives_what_cpp_gives_cluster_by_cluster) {
  const Mesh mesh = rich();
  for (const bool mix : {false, true}) {
    umbel_lod_config config = small_config();
    config.mix_materials = mix;
    const auto lod = built_rich(mesh, config);
    lod::Config cpp = small_cpp_config();
    cpp.mix_materials = mix;
    const lod::Dag dag = lod::build(mesh.view(), cpp);
    Geometry g;
    ASSERT_EQ(umbel_lod_get_geometry(lod.get(), nullptr, 0, nullptr, &g.c), UMBEL_OK);
    ASSERT_EQ(g.c.cluster_count, dag.tables.clusters.size());
    EXPECT_EQ(g.c.streams, uint32_t{UMBEL_LOD_NORMALS} | UMBEL_LOD_UVS | UMBEL_LOD_EXTRAS |
                               UMBEL_LOD_SOURCE_VERTICES);
    EXPECT_EQ(g.c.extra_width, 2u);
    g.reserve();
    ASSERT_EQ(umbel_lod_get_geometry(lod.get(), nullptr, 0, nullptr, &g.c), UMBEL_OK);
    std::set<uint32_t> materials;
    for (uint32_t i = 0; i < g.c.cluster_count; ++i) {
      const lod::ClusterGeometry expected = dag.geometry(i);
      const uint32_t v0 = g.vertex_offsets[i], t0 = g.triangle_offsets[i];
      ASSERT_EQ(g.vertex_offsets[i + 1] - v0, expected.positions.size());
      ASSERT_EQ(g.triangle_offsets[i + 1] - t0, expected.triangles.size() / 3);
      EXPECT_EQ(g.materials[i], dag.tables.clusters[i].material);
      const size_t width = extra_width(expected.extras);
      for (size_t v = 0; v < expected.positions.size(); ++v) {
        EXPECT_EQ(g.positions[v0 + v].x, expected.positions[v].x);
        EXPECT_EQ(g.normals[v0 + v].z, expected.normals[v].z);
        EXPECT_EQ(g.uvs[v0 + v].y, expected.uvs[v].y);
        EXPECT_EQ(g.extra_values[2 * (v0 + v) + 1], expected.extra_values[width * v + 1]);
        EXPECT_EQ(g.source_vertices[v0 + v],
                  dag.source_vertices[dag.cluster_vertices[dag.vertex_offsets[i] + v]]);
      }
      for (size_t k = 0; k < expected.triangles.size(); ++k)
        EXPECT_EQ(g.triangles[3 * t0 + k], expected.triangles[k]);
      for (uint32_t t = t0; t < g.triangle_offsets[i + 1]; ++t) {
        materials.insert(g.triangle_materials[t]);
        if (!mix) EXPECT_EQ(g.triangle_materials[t], g.materials[i]);
      }
    }
    EXPECT_EQ(materials, (std::set<uint32_t>{2, 4}));
  }
}

TEST(LodGeometry, of_a_cut_in_its_order_with_the_arrays_that_are_wanted) {
  const auto lod = built(blob(), small_config());
  const uint32_t cut[] = {7, 3, 3};
  Geometry g;
  ASSERT_EQ(umbel_lod_get_geometry(lod.get(), cut, 3, nullptr, &g.c), UMBEL_OK);
  EXPECT_EQ(g.c.cluster_count, 3u);
  std::vector<umbel_vec3> positions(g.c.vertex_count);
  g.c.positions = positions.data();
  g.c.vertex_capacity = g.c.vertex_count;
  ASSERT_EQ(umbel_lod_get_geometry(lod.get(), cut, 3, nullptr, &g.c), UMBEL_OK);
  const lod::Dag dag = lod::build(blob().view(), small_cpp_config());
  EXPECT_EQ(positions[0].x, dag.geometry(7).positions[0].x);
  EXPECT_EQ(positions.back().y, dag.geometry(3).positions.back().y);
}

TEST(LodGeometry, too_little_room_and_no_such_cluster_are_named) {
  const auto lod = built(blob(), small_config());
  Geometry g;
  ASSERT_EQ(umbel_lod_get_geometry(lod.get(), nullptr, 0, nullptr, &g.c), UMBEL_OK);
  g.reserve();
  for (size_t* capacity : {&g.c.cluster_capacity, &g.c.vertex_capacity, &g.c.triangle_capacity}) {
    --*capacity;
    g.positions[0].x = -99;
    EXPECT_EQ(umbel_lod_get_geometry(lod.get(), nullptr, 0, nullptr, &g.c), UMBEL_ERROR_CAPACITY);
    EXPECT_EQ(g.positions[0].x, -99);
    ++*capacity;
  }
  const uint32_t nowhere = 1u << 30;
  EXPECT_EQ(umbel_lod_get_geometry(lod.get(), &nowhere, 1, nullptr, &g.c),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(umbel_last_error()).find("clusters[0]"), std::string::npos);
  EXPECT_EQ(umbel_lod_get_geometry(nullptr, nullptr, 0, nullptr, &g.c),
            UMBEL_ERROR_INVALID_ARGUMENT);
  g.c.struct_size = 3;
  EXPECT_EQ(umbel_lod_get_geometry(lod.get(), nullptr, 0, nullptr, &g.c),
            UMBEL_ERROR_INVALID_ARGUMENT);
}

TEST(LodGeometry, pages_have_the_clusters_of_the_tables) {
  const Scratch scratch;
  const Mesh mesh = rich();
  const lod::Dag dag = lod::build(mesh.view(), small_cpp_config());
  const lod::Dag plain = lod::build(shapes::blob(3, 2).view(), small_cpp_config());
  AssetContents contents;
  contents.meshes = {&dag, &plain};
  AssetConfig exact = AssetConfig::exact();
  exact.page_bytes = 8192;
  write_asset(scratch / "two.umbel", contents, {}, exact);
  umbel_asset* asset = nullptr;
  ASSERT_EQ(umbel_asset_open((scratch / "two.umbel").c_str(), &asset), UMBEL_OK);
  umbel_asset_info info;
  umbel_asset_info_init(&info);
  ASSERT_EQ(umbel_asset_get_info(asset, &info), UMBEL_OK);
  size_t clusters = 0;
  for (uint32_t number = 0; number < info.pages; ++number) {
    umbel_page* page = nullptr;
    ASSERT_EQ(umbel_asset_read_page(asset, number, &page), UMBEL_OK);
    size_t count = 0;
    ASSERT_EQ(umbel_page_get_groups(page, nullptr, 0, &count), UMBEL_OK);
    std::vector<umbel_page_group> groups(count);
    ASSERT_EQ(umbel_page_get_groups(page, groups.data(), count, &count), UMBEL_OK);
    Geometry g;
    ASSERT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_OK) << umbel_last_error();
    EXPECT_FALSE(g.c.streams & UMBEL_LOD_SOURCE_VERTICES);
    g.reserve();
    EXPECT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_ERROR_UNSUPPORTED);
    g.c.source_vertices = nullptr;
    ASSERT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_OK) << umbel_last_error();
    for (const umbel_page_group& group : groups) {
      const lod::Dag& of = group.mesh == 0 ? dag : plain;
      for (uint32_t k = 0; k < group.cluster_count; ++k, ++clusters) {
        const lod::ClusterGeometry expected = of.geometry(group.first_cluster + k);
        const uint32_t i = group.page_cluster + k;
        ASSERT_EQ(g.vertex_offsets[i + 1] - g.vertex_offsets[i], expected.positions.size());
        for (const umbel_vec3* p = &g.positions[g.vertex_offsets[i]];
             p != &g.positions[g.vertex_offsets[i + 1]]; ++p)
          EXPECT_NE(std::find(expected.positions.begin(), expected.positions.end(),
                              Vec3{p->x, p->y, p->z}),
                    expected.positions.end());
      }
    }
    umbel_page_free(page);
  }
  EXPECT_EQ(clusters, dag.tables.clusters.size() + plain.tables.clusters.size());
  umbel_page* page = nullptr;
  EXPECT_EQ(umbel_asset_read_page(asset, info.pages, &page), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(page, nullptr);
  umbel_residency* residency = nullptr;
  ASSERT_EQ(umbel_residency_create(asset, nullptr, &residency), UMBEL_OK) << umbel_last_error();
  EXPECT_EQ(umbel_residency_get_page(residency, 0, &page), UMBEL_OK);  // has the roots
  umbel_residency_free(residency);
  Geometry g;
  EXPECT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_OK);
  umbel_page_free(page);
  umbel_page_free(nullptr);
  umbel_asset_free(asset);
}

// One page of all meshes.
void with_page_of(const AssetContents& contents, const std::function<void(umbel_page*)>& look) {
  const Scratch scratch;
  write_asset(scratch / "all.umbel", contents, {}, AssetConfig::exact());
  umbel_asset* asset = nullptr;
  ASSERT_EQ(umbel_asset_open((scratch / "all.umbel").c_str(), &asset), UMBEL_OK);
  umbel_page* page = nullptr;
  ASSERT_EQ(umbel_asset_read_page(asset, 0, &page), UMBEL_OK);
  look(page);
  umbel_page_free(page);
  umbel_asset_free(asset);
}

TEST(LodGeometry, further_attributes_are_told_of_behind_a_mesh_that_mixes_materials) {
  Mesh mixed = blob();
  for (size_t i = 0; i < mixed.triangles.size(); ++i) mixed.materials.push_back(i % 3);
  lod::Config mixing = small_cpp_config();
  mixing.mix_materials = true;
  const lod::Dag without = lod::build(mixed.view(), mixing);
  const lod::Dag with = lod::build(rich().view(), small_cpp_config());
  AssetContents contents;
  contents.meshes = {&without, &with};
  with_page_of(contents, [&](umbel_page* page) {
    size_t count = 0;
    ASSERT_EQ(umbel_page_get_groups(page, nullptr, 0, &count), UMBEL_OK);
    std::vector<umbel_page_group> groups(count);
    ASSERT_EQ(umbel_page_get_groups(page, groups.data(), count, &count), UMBEL_OK);
    ASSERT_EQ(groups.front().mesh, 0u);
    ASSERT_TRUE(std::any_of(groups.begin(), groups.end(),
                            [](const umbel_page_group& group) { return group.mesh == 1; }));
    Geometry g;
    ASSERT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_OK) << umbel_last_error();
    EXPECT_TRUE(g.c.streams & UMBEL_LOD_EXTRAS);
    ASSERT_EQ(g.c.extra_width, 2u);
    g.reserve();
    g.c.source_vertices = nullptr;
    ASSERT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_OK) << umbel_last_error();
    for (const umbel_page_group& group : groups)
      for (uint32_t v = g.vertex_offsets[group.page_cluster];
           v < g.vertex_offsets[group.page_cluster + group.cluster_count]; ++v) {
        EXPECT_EQ(g.extra_values[2 * v], group.mesh == 0 ? 0 : g.positions[v].z);
        EXPECT_EQ(g.extra_values[2 * v + 1], group.mesh == 0 ? 0 : g.positions[v].x);
      }
  });
}

TEST(LodGeometry, further_attributes_that_differ_are_refused_before_anything_is_written) {
  Mesh third = rich();
  third.extras = {{ExtraKind::kUvs, 2}};
  const lod::Dag one = lod::build(rich().view(), small_cpp_config());
  const lod::Dag two = lod::build(third.view(), small_cpp_config());
  AssetContents contents;
  contents.meshes = {&one, &two};
  with_page_of(contents, [](umbel_page* page) {
    Geometry g;
    ASSERT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_OK) << umbel_last_error();
    g.reserve();
    g.c.source_vertices = nullptr;
    EXPECT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_ERROR_UNSUPPORTED);
    EXPECT_NE(std::string(umbel_last_error()).find("extra_values"), std::string::npos);
    EXPECT_EQ(g.vertex_offsets[1], 0u);
    EXPECT_TRUE(std::all_of(g.positions.begin(), g.positions.end(),
                            [](const umbel_vec3& p) { return p.x == 0 && p.y == 0 && p.z == 0; }));
    g.c.extra_values = nullptr;
    EXPECT_EQ(umbel_page_get_geometry(page, nullptr, &g.c), UMBEL_OK);
    EXPECT_GT(g.vertex_offsets[1], 0u);
  });
}

}  // namespace
}  // namespace umbel
