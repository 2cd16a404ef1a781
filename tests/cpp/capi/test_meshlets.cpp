// Order and bounds of clusters through the C interface equal those of the C++ one.
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "capi/cluster_call.hpp"

namespace umbel {
namespace {

using namespace cluster_call;

struct MeshletCall : Call {
  MeshletCall() : mesh(grid()) {
    set_mesh(*this, mesh);
    config.max_vertices = 128;
    EXPECT_EQ(run(), UMBEL_OK) << umbel_last_error();
    umbel_cluster_meshlets_init(&out);
  }
  void reserve_meshlets(size_t vertex_room) {
    ordered.assign(output.item_count, kNone);
    offsets.assign(output.range_count + 1, kNone);
    vertices.assign(vertex_room, kNone);
    corners.assign(3 * output.item_count, 255);
    out.items = ordered.data();
    out.item_capacity = ordered.size();
    out.vertex_offsets = offsets.data();
    out.vertex_offset_capacity = offsets.size();
    out.vertices = vertices.data();
    out.vertex_capacity = vertices.size();
    out.corners = corners.data();
    out.corner_capacity = corners.size();
  }
  umbel_result order(int level = 0) {
    return umbel_cluster_order(&input, &output, level, &options, &out);
  }

  const Mesh mesh;
  umbel_cluster_meshlets out;
  std::vector<uint32_t> ordered, offsets, vertices;
  std::vector<uint8_t> corners;
};

TEST(CapiMeshlets, order_equals_the_cpp_order) {
  for (const int level : {0, 3}) {
    MeshletCall call;
    call.reserve_meshlets(3 * call.output.item_count);
    const umbel_result result = call.order(level);
    if (level > 0 && result == UMBEL_ERROR_UNSUPPORTED) continue;
    ASSERT_EQ(result, UMBEL_OK) << umbel_last_error();
    const ClusterMeshlets expected = order_clusters(call.mesh.view(), call.clusters(), level);
    call.vertices.resize(call.out.vertex_count);
    EXPECT_EQ(call.ordered, expected.items);
    EXPECT_EQ(call.offsets, expected.vertex_offsets);
    EXPECT_EQ(call.vertices, expected.vertices);
    ASSERT_EQ(call.out.corner_count, 3 * expected.corners.size());
    EXPECT_EQ(std::memcmp(call.corners.data(), expected.corners.data(), call.out.corner_count), 0);
  }
}

TEST(CapiMeshlets, bounds_equal_the_cpp_bounds) {
  MeshletCall call;
  std::vector<umbel_cluster_bounds> bounds(call.output.range_count);
  ASSERT_EQ(umbel_cluster_get_bounds(&call.input, &call.output, &call.options, bounds.data(),
                                     bounds.size()),
            UMBEL_OK)
      << umbel_last_error();
  const std::vector<ClusterBounds> expected = cluster_bounds(call.mesh.view(), call.clusters());
  ASSERT_EQ(expected.size(), bounds.size());
  EXPECT_EQ(std::memcmp(bounds.data(), expected.data(), bounds.size() * sizeof bounds[0]), 0);
}

TEST(CapiMeshlets, small_arrays_stay_and_are_named_with_what_they_need) {
  MeshletCall call;
  call.reserve_meshlets(10);
  EXPECT_EQ(call.order(), UMBEL_ERROR_CAPACITY);
  EXPECT_NE(std::string(umbel_last_error()).find("vertex_capacity is 10"), std::string::npos);
  EXPECT_EQ(call.ordered[0], kNone);
  EXPECT_EQ(call.vertices[0], kNone);
  call.reserve_meshlets(call.out.vertex_count);
  EXPECT_EQ(call.order(), UMBEL_OK) << umbel_last_error();
  umbel_cluster_bounds one;
  EXPECT_EQ(umbel_cluster_get_bounds(&call.input, &call.output, nullptr, &one, 1),
            UMBEL_ERROR_CAPACITY);
}

TEST(CapiMeshlets, mistakes_are_named) {
  MeshletCall call;
  call.reserve_meshlets(3 * call.output.item_count);
  const auto fails = [&](umbel_result expected, const char* part) {
    EXPECT_EQ(call.order(), expected);
    EXPECT_NE(std::string(umbel_last_error()).find(part), std::string::npos) << umbel_last_error();
    EXPECT_EQ(call.out.item_count, 0u);
  };
  call.items[5] = 1u << 30;
  fails(UMBEL_ERROR_INVALID_ARGUMENT, "");
  call.items[5] = call.items[4];
  call.out.items = nullptr;
  fails(UMBEL_ERROR_INVALID_ARGUMENT, "items is NULL");
  call.out.items = call.ordered.data();
  call.input.positions = nullptr;
  call.input.position_count = 0;
  const std::vector<Aabb> boxes = triangle_boxes(call.mesh.view());
  call.input.boxes = reinterpret_cast<const umbel_aabb*>(boxes.data());
  fails(UMBEL_ERROR_INVALID_ARGUMENT, "positions");
  EXPECT_EQ(umbel_cluster_order(&call.input, &call.output, 0, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_cluster_get_bounds(&call.input, &call.output, nullptr, nullptr, 7),
            UMBEL_ERROR_INVALID_ARGUMENT);
}

TEST(CapiMeshlets, nothing_has_no_order_and_no_bounds) {
  Call empty;
  ASSERT_EQ(empty.run(), UMBEL_OK);
  umbel_cluster_meshlets out;
  umbel_cluster_meshlets_init(&out);
  uint32_t offset = kNone;
  out.vertex_offsets = &offset;
  out.vertex_offset_capacity = 1;
  EXPECT_EQ(umbel_cluster_order(&empty.input, &empty.output, 0, nullptr, &out), UMBEL_OK)
      << umbel_last_error();
  EXPECT_EQ(offset, 0u);
  EXPECT_EQ(umbel_cluster_get_bounds(&empty.input, &empty.output, nullptr, nullptr, 0), UMBEL_OK);
}

}  // namespace
}  // namespace umbel
