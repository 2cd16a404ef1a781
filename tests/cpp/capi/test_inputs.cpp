// What callers hand in, as engines have it: strides, no limit, segments, locks.
#include <gtest/gtest.h>

#include <cstring>

#include "capi/arguments.hpp"
#include "capi/bvh_call.hpp"
#include "capi/cluster_call.hpp"
#include "capi/lod_call.hpp"

namespace umbel {
namespace {

using namespace lod_call;

#pragma pack(push, 1)
struct Vertex {  // at no alignment
  uint8_t flags;
  umbel_vec3 position;
  umbel_vec2 uv;
  umbel_vec3 normal;
};
#pragma pack(pop)

std::vector<Vertex> interleaved(const Mesh& mesh) {
  std::vector<Vertex> vertices(mesh.positions.size());
  for (size_t v = 0; v < vertices.size(); ++v) {
    std::memcpy(&vertices[v].position, &mesh.positions[v], sizeof(Vec3));
    if (!mesh.uvs.empty()) std::memcpy(&vertices[v].uv, &mesh.uvs[v], sizeof(Vec2));
    if (!mesh.normals.empty()) std::memcpy(&vertices[v].normal, &mesh.normals[v], sizeof(Vec3));
  }
  return vertices;
}

template <typename T>
const T* at(const std::vector<Vertex>& vertices, size_t offset) {
  const void* address = reinterpret_cast<const char*>(vertices.data()) + offset;
  return static_cast<const T*>(address);
}

TEST(InputsFromC, one_buffer_with_strides_is_the_same_mesh) {
  Mesh mesh = blob();
  mesh.normals = mesh.positions;
  const std::vector<Vertex> vertices = interleaved(mesh);
  umbel_lod_mesh given = c_mesh(mesh);
  given.positions = at<umbel_vec3>(vertices, offsetof(Vertex, position));
  given.uvs = at<umbel_vec2>(vertices, offsetof(Vertex, uv));
  given.normals = at<umbel_vec3>(vertices, offsetof(Vertex, normal));
  given.position_stride = given.uv_stride = given.normal_stride = sizeof(Vertex);
  const umbel_lod_config config = small_config();
  const auto lod = built(given, config);
  const lod::Dag dag = lod::build(mesh.view(), small_cpp_config());
  expect_groups_of(dag, lod.get());
  umbel_lod* made = nullptr;
  given.uv_stride = 7;
  EXPECT_EQ(umbel_lod_build(&given, &config, nullptr, &made), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(umbel_last_error()).find("mesh->uvs"), std::string::npos);
}

TEST(InputsFromC, clusters_and_trees_take_strides) {
  const Mesh mesh = blob();
  const std::vector<Vertex> vertices = interleaved(mesh);
  cluster_call::Call tight, strided;
  cluster_call::set_mesh(tight, mesh);
  cluster_call::set_mesh(strided, mesh);
  strided.input.positions = at<umbel_vec3>(vertices, offsetof(Vertex, position));
  strided.input.position_stride = sizeof(Vertex);
  ASSERT_EQ(tight.run(), UMBEL_OK);
  ASSERT_EQ(strided.run(), UMBEL_OK) << umbel_last_error();
  cluster_call::expect_equal(tight.clusters(), strided.clusters());

  umbel_bvh_mesh given;
  umbel_bvh_mesh_init(&given);
  given.positions = strided.input.positions;
  given.position_count = mesh.positions.size();
  given.position_stride = sizeof(Vertex);
  given.triangles = mesh.triangles[0].data();
  given.triangle_count = mesh.triangles.size();
  umbel_bvh* bvh = nullptr;
  ASSERT_EQ(umbel_bvh_build(&given, nullptr, nullptr, &bvh), UMBEL_OK) << umbel_last_error();
  umbel_bvh_statistics found;
  umbel_bvh_statistics_init(&found);
  ASSERT_EQ(umbel_bvh_get_statistics(bvh, &found), UMBEL_OK);
  const Aabb expected = bounds(mesh.view());
  const Aabb got{{found.bounds.min.x, found.bounds.min.y, found.bounds.min.z},
                 {found.bounds.max.x, found.bounds.max.y, found.bounds.max.z}};
  EXPECT_TRUE(got == expected);
  umbel_bvh_free(bvh);
  umbel_bvh2 tree;
  umbel_bvh2_init(&tree);
  EXPECT_EQ(umbel_bvh2_build_triangles(&given, nullptr, nullptr, &tree), UMBEL_ERROR_CAPACITY);
}

TEST(InputsFromC, arrays_at_odd_addresses_are_copied) {
  const std::vector<Vec3> positions = shapes::blob(1, 2).positions;
  std::vector<char> buffer(1 + positions.size() * sizeof(Vec3));
  std::memcpy(buffer.data() + 1, positions.data(), buffer.size() - 1);
  const void* odd = buffer.data() + 1;
  for (const size_t stride : {size_t{0}, sizeof(Vec3)}) {
    std::vector<Vec3> copies;
    const auto taken = capi::strided(static_cast<const umbel_vec3*>(odd), positions.size(), stride,
                                     "positions", copies);
    EXPECT_EQ(taken.data(), copies.data());
    EXPECT_EQ(copies, positions);
  }
}

TEST(InputsFromC, requirements_look_at_counts_alone) {
  cluster_call::Call call;
  call.input.item_count = 1000;
  ASSERT_EQ(call.require(), UMBEL_OK) << umbel_last_error();
  EXPECT_EQ(call.capacity.items, 1000u);
  EXPECT_EQ(call.capacity.ranges, (1000u + 63) / 64);
  EXPECT_EQ(call.capacity.segments, 1u);
}

TEST(InputsFromC, no_segments_are_none_and_null_is_all) {
  cluster_call::GoodCall call;
  const umbel_range nothing{};
  call.input.segments = &nothing;
  call.input.segment_count = 0;
  ASSERT_EQ(call.require(), UMBEL_OK);
  EXPECT_EQ(call.capacity.ranges, 0u);
  EXPECT_EQ(call.capacity.segments, 0u);
  ASSERT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
  EXPECT_EQ(call.output.range_count, 0u);
  EXPECT_EQ(call.output.segment_count, 0u);
  for (uint32_t i = 0; i < call.output.item_count; ++i) EXPECT_EQ(call.items[i], i);
  call.input.segments = nullptr;
  ASSERT_EQ(call.build(), UMBEL_OK);
  EXPECT_EQ(call.output.segment_count, 1u);
  EXPECT_GT(call.output.range_count, 1u);
}

TEST(InputsFromC, no_limit_has_one_spelling_and_one_synonym) {
  cluster_call::GoodCall call;
  for (const uint32_t none : {UMBEL_NO_LIMIT, UMBEL_NONE}) {
    call.config.max_vertices = none;
    ASSERT_EQ(call.require(), UMBEL_OK);
    EXPECT_LT(call.capacity.ranges, call.input.item_count / 32);
    ASSERT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
  }
  umbel_lod_config config = small_config();
  config.max_vertices = config.max_triangles = 256;
  config.min_group = 4;
  config.max_group = 8;
  umbel_lod_config same = config;
  same.max_vertices = UMBEL_NO_LIMIT;
  same.max_triangles = same.max_levels = UMBEL_NONE;
  const auto a = built(blob(), config), b = built(blob(), same);
  umbel_lod_arrays first, second;
  umbel_lod_arrays_init(&first);
  umbel_lod_arrays_init(&second);
  umbel_lod_tables_arrays(umbel_lod_get_tables(a.get()), &first);
  umbel_lod_tables_arrays(umbel_lod_get_tables(b.get()), &second);
  ASSERT_EQ(first.cluster_count, second.cluster_count);
  EXPECT_EQ(
      std::memcmp(first.clusters, second.clusters, first.cluster_count * sizeof *first.clusters),
      0);
}

TEST(InputsFromC, bits_without_weights_only_count_vertices) {
  const Mesh mesh = shapes::grid(30, 30);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  std::vector<umbel_range> ranges;
  std::vector<uint32_t> targets;
  std::vector<uint8_t> bits;
  for (const Triangle& t : mesh.triangles) {
    ranges.push_back({uint32_t(targets.size()), 0});
    for (uint32_t other = 0; other < mesh.triangles.size(); ++other) {
      uint8_t shared = 0;
      for (uint32_t k = 0; k < 3; ++k)
        for (const uint32_t v : mesh.triangles[other]) shared |= uint8_t((v == t[k]) << k);
      if (shared == 0 || &mesh.triangles[other] == &t) continue;
      targets.push_back(other);
      bits.push_back(shared);
      ++ranges.back().count;
    }
  }
  const auto clusters = [&](const float* weights) {
    cluster_call::Call call;
    call.input.item_count = boxes.size();
    call.input.boxes = reinterpret_cast<const umbel_aabb*>(boxes.data());
    call.input.vertices_per_item = 3;
    call.input.connection_ranges = ranges.data();
    call.input.connection_targets = targets.data();
    call.input.connection_count = targets.size();
    call.input.connection_vertex_bits = bits.data();
    call.input.connection_weights = weights;
    call.config.max_vertices = 48;
    EXPECT_EQ(call.run(), UMBEL_OK) << umbel_last_error();
    return call.clusters();
  };
  const std::vector<float> zeros(targets.size(), 0.0f), ones(targets.size(), 1.0f);
  cluster_call::expect_equal(clusters(nullptr), clusters(zeros.data()));
  EXPECT_NE(clusters(nullptr).items, clusters(ones.data()).items);
}

TEST(InputsFromC, errors_name_the_fields_of_c) {
  cluster_call::GoodCall call;
  const std::vector<umbel_range> ranges(call.boxes.size(), umbel_range{0, 1});
  const uint32_t nowhere = 1u << 30;
  call.input.connection_ranges = ranges.data();
  call.input.connection_targets = &nowhere;
  call.input.connection_count = 1;
  cluster_call::expect_failure(call.build(), UMBEL_ERROR_INVALID_ARGUMENT, "connection_targets[0]");
  EXPECT_STREQ(umbel_result_name(UMBEL_ERROR_CORRUPT), "corrupt data");
}

TEST(InputsFromC, tables_need_no_nodes_and_no_levels) {
  const auto lod = built(blob(), small_config());
  umbel_lod_arrays arrays;
  umbel_lod_arrays_init(&arrays);
  ASSERT_EQ(umbel_lod_tables_arrays(umbel_lod_get_tables(lod.get()), &arrays), UMBEL_OK);
  umbel_lod_arrays bare = arrays;
  bare.nodes = nullptr;
  bare.node_count = 0;
  bare.levels = nullptr;
  bare.level_count = 0;
  umbel_lod_tables* made = nullptr;
  ASSERT_EQ(umbel_lod_tables_create(&bare, &made), UMBEL_OK) << umbel_last_error();
  const std::unique_ptr<umbel_lod_tables, Free> tables(made);
  umbel_lod_arrays completed;
  umbel_lod_arrays_init(&completed);
  ASSERT_EQ(umbel_lod_tables_arrays(made, &completed), UMBEL_OK);
  ASSERT_EQ(completed.node_count, arrays.node_count);
  EXPECT_EQ(std::memcmp(completed.nodes, arrays.nodes, arrays.node_count * sizeof *arrays.nodes),
            0);
  EXPECT_EQ(completed.level_count, arrays.level_count);
}

TEST(InputsFromC, locks_borders_and_vertices) {
  const Mesh mesh = shapes::grid(30, 30);
  umbel_lod_mesh given = c_mesh(mesh);
  umbel_lod_config config = small_config();
  const auto root_triangles = [&] {
    umbel_lod* lod = nullptr;
    EXPECT_EQ(umbel_lod_build(&given, &config, nullptr, &lod), UMBEL_OK) << umbel_last_error();
    umbel_lod_report report;
    umbel_lod_report_init(&report);
    umbel_lod_get_report(lod, &report);
    umbel_lod_free(lod);
    return report.root_triangles;
  };
  EXPECT_LE(root_triangles(), 32u);
  config.lock_borders = 1;
  EXPECT_GE(root_triangles(), 118u);  // 120 edges of the border need as many triangles, but two
  config.lock_borders = 0;
  const std::vector<uint8_t> locked(mesh.positions.size(), 1);
  given.locked = locked.data();
  EXPECT_EQ(root_triangles(), mesh.triangles.size());
}

TEST(InputsFromC, budgets_count_what_they_are_told) {
  const auto lod = built(blob(), small_config());
  const umbel_lod_tables* tables = umbel_lod_get_tables(lod.get());
  umbel_lod_view view;
  umbel_lod_view_error(0, &view);
  umbel_lod_budget budget;
  umbel_lod_budget_init(&budget);
  uint32_t offsets[2];
  std::vector<uint32_t> cut(10000);
  size_t count = 0;
  uint64_t cost = 0;
  const auto select = [&] {
    return umbel_lod_select_for_budget(tables, &view, &budget, nullptr, nullptr, 0, offsets,
                                       cut.data(), cut.size(), &count, &cost);
  };
  budget.unit = UMBEL_LOD_CLUSTERS;
  budget.limit = 20;
  ASSERT_EQ(select(), UMBEL_OK) << umbel_last_error();
  EXPECT_LE(count, 20u);
  EXPECT_EQ(cost, count);
  EXPECT_EQ(offsets[1], count);
  budget.unit = UMBEL_LOD_GROUPS;
  budget.limit = 5;
  ASSERT_EQ(select(), UMBEL_OK);
  EXPECT_LE(cost, 5u);
  budget.unit = UMBEL_LOD_TRIANGLES;
  budget.limit = UMBEL_NO_LIMIT;
  ASSERT_EQ(select(), UMBEL_OK);
  EXPECT_EQ(cost, blob().triangles.size());
  budget.unit = UMBEL_LOD_COSTS;
  budget.limit = 10;
  const uint32_t few[2] = {1, 1};
  budget.cluster_costs = few;
  budget.cluster_cost_count = 2;
  EXPECT_EQ(select(), UMBEL_ERROR_INVALID_ARGUMENT);
  budget.unit = 9;
  EXPECT_EQ(select(), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(umbel_last_error()).find("unit"), std::string::npos);
}

}  // namespace
}  // namespace umbel
