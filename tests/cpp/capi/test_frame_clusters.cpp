// Clusters of meshes that change every frame, from C: those of C++.
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "capi/newer.hpp"
#include "umbel/frame_clusters.hpp"
#include "umbel/umbel_frame_clusters.h"

namespace umbel {
namespace {

struct Clusterer {
  umbel_frame_clusterer* handle = nullptr;

  Clusterer(const Mesh& mesh, const umbel_frame_config* config) {
    EXPECT_EQ(umbel_frame_clusterer_create(&mesh.triangles[0][0], mesh.triangles.size(),
                                           mesh.positions.size(), config, &handle),
              UMBEL_OK)
        << umbel_last_error();
  }
  Clusterer(const Clusterer&) = delete;
  Clusterer& operator=(const Clusterer&) = delete;
  ~Clusterer() { umbel_frame_clusterer_destroy(handle); }

  umbel_frame_clusters get() const {
    umbel_frame_clusters found{};
    EXPECT_EQ(umbel_frame_clusterer_get(handle, &found), UMBEL_OK);
    return found;
  }
  void expect_same(const FrameClusterer& expected) const {
    const umbel_frame_clusters found = get();
    ASSERT_EQ(found.cluster_count, expected.count());
    ASSERT_EQ(found.triangle_count, expected.items().size());
    const auto same = [](const void* a, auto b) {
      return memcmp(a, b.data(), b.size_bytes()) == 0;
    };
    EXPECT_TRUE(same(found.items, expected.items()));
    EXPECT_TRUE(same(found.indices, expected.triangles()));
    EXPECT_TRUE(same(found.offsets, expected.offsets()));
    EXPECT_TRUE(same(found.boxes, expected.boxes()));
    EXPECT_EQ(found.area_ratio, expected.area_growth().area_ratio);
    EXPECT_EQ(found.area_ratio_at_build, expected.area_growth().area_ratio_at_build);
  }
};

const umbel_vec3* as_c(const std::vector<Vec3>& positions) {
  return reinterpret_cast<const umbel_vec3*>(positions.data());
}

TEST(FrameClustersInC, every_call_gives_what_cpp_gives) {
  Mesh mesh = shapes::blob(4, 3);
  umbel_frame_config config;
  umbel_frame_config_init(&config);
  config.max_triangles = 60;
  FrameClusterConfig same;
  same.max_triangles = 60;
  const Clusterer c(mesh, &config);
  FrameClusterer expected(mesh.triangles, mesh.positions.size(), same);
  const size_t n = mesh.positions.size();
  ASSERT_EQ(umbel_frame_clusterer_build(c.handle, as_c(mesh.positions), n, 0, nullptr), UMBEL_OK);
  expected.build(mesh.positions);
  c.expect_same(expected);
  for (Vec3& p : mesh.positions) p = {p.x * 2 + p.y * p.y, p.y, p.z - p.x};
  ASSERT_EQ(umbel_frame_clusterer_refit(c.handle, as_c(mesh.positions), n, 12, nullptr), UMBEL_OK);
  expected.refit(mesh.positions);
  c.expect_same(expected);
  ASSERT_EQ(umbel_frame_clusterer_rebuild_worst(c.handle, as_c(mesh.positions), n, 0, 20, nullptr),
            UMBEL_OK);
  expected.rebuild_worst(mesh.positions, 20);
  c.expect_same(expected);
  std::vector<float> apart(5 * n);
  for (size_t v = 0; v < n; ++v) memcpy(&apart[5 * v], &mesh.positions[v], sizeof(Vec3));
  ASSERT_EQ(umbel_frame_clusterer_update(c.handle, reinterpret_cast<umbel_vec3*>(apart.data()), n,
                                         20, nullptr),
            UMBEL_OK);
  expected.update(mesh.positions);
  c.expect_same(expected);
}

TEST(FrameClustersInC, vertices_are_those_of_cpp) {
  const Mesh mesh = shapes::sphere(4);
  umbel_frame_config config;
  umbel_frame_config_init(&config);
  config.max_vertices = 64;
  FrameClusterConfig same;
  same.max_vertices = 64;
  const Clusterer c(mesh, &config);
  FrameClusterer expected(mesh.triangles, mesh.positions.size(), same);
  expected.build(mesh.positions);
  ASSERT_EQ(umbel_frame_clusterer_build(c.handle, as_c(mesh.positions), mesh.positions.size(), 0,
                                        nullptr),
            UMBEL_OK);
  const FrameVertexLists lists = list_frame_vertices(expected);
  size_t count = 0;
  ASSERT_EQ(umbel_frame_clusterer_vertices(c.handle, nullptr, nullptr, nullptr, 0, &count, nullptr),
            UMBEL_OK);
  ASSERT_EQ(count, lists.vertices.size());
  std::vector<uint32_t> offsets(expected.count() + 1), vertices(count);
  std::vector<uint8_t> corners(3 * mesh.triangles.size());
  ASSERT_EQ(umbel_frame_clusterer_vertices(c.handle, offsets.data(), vertices.data(),
                                           corners.data(), count, &count, nullptr),
            UMBEL_OK);
  EXPECT_EQ(offsets, lists.vertex_offsets);
  EXPECT_EQ(vertices, lists.vertices);
  EXPECT_EQ(memcmp(corners.data(), lists.corners.data(), corners.size()), 0);
  EXPECT_EQ(umbel_frame_clusterer_vertices(c.handle, nullptr, vertices.data(), nullptr, count - 1,
                                           &count, nullptr),
            UMBEL_ERROR_CAPACITY);
}

TEST(FrameClustersInC, newer_callers_are_served_while_what_is_new_is_zero) {
  auto config = testing::newer(umbel_frame_config_init_sized);
  uint32_t most = 0;
  EXPECT_EQ(umbel_frame_max_clusters(1000, &config.known, &most), UMBEL_OK) << umbel_last_error();
  EXPECT_EQ(most, max_frame_clusters(1000, {}));
  config.fresh[3] = 1;
  EXPECT_EQ(umbel_frame_max_clusters(1000, &config.known, &most), UMBEL_ERROR_UNSUPPORTED);
}

TEST(FrameClustersInC, no_limit_of_vertices_has_two_names) {
  umbel_frame_config config;
  umbel_frame_config_init(&config);
  EXPECT_EQ(config.max_vertices, UMBEL_NO_LIMIT);
  uint32_t most = 0;
  config.max_vertices = UMBEL_NONE;
  EXPECT_EQ(umbel_frame_max_clusters(1000, &config, &most), UMBEL_OK) << umbel_last_error();
  EXPECT_EQ(most, max_frame_clusters(1000, {}));
}

TEST(FrameClustersInC, mistakes_are_named) {
  const Mesh mesh = shapes::sphere(1);
  const size_t n = mesh.positions.size();
  umbel_frame_clusterer* none = nullptr;
  EXPECT_EQ(umbel_frame_clusterer_create(nullptr, 4, 3, nullptr, &none),
            UMBEL_ERROR_INVALID_ARGUMENT);
  const uint32_t wrong[3] = {0, 1, 7};
  EXPECT_EQ(umbel_frame_clusterer_create(wrong, 1, 3, nullptr, &none), UMBEL_ERROR_INVALID_MESH);
  EXPECT_EQ(none, nullptr);
  umbel_frame_config config{};
  EXPECT_EQ(umbel_frame_clusterer_create(wrong, 1, 9, &config, &none),
            UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_frame_config_init(&config);
  config.method = 7;
  EXPECT_EQ(umbel_frame_clusterer_create(wrong, 1, 9, &config, &none),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(umbel_last_error(), "method is 7, but must be 0 (Morton) or 1 (hybrid)");
  // Three times that is 2.
  const size_t many = 0x5555'5555'5555'5556;
  EXPECT_EQ(umbel_frame_clusterer_create(wrong, many, 9, nullptr, &none),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(
      umbel_last_error(),
      ("triangles is " + std::to_string(many) + ", more than 32-bit indices can name").c_str());
  // More than can be clustered; not a byte of them is read.
  EXPECT_EQ(umbel_frame_clusterer_create(wrong, 715'827'883, 9, nullptr, &none),
            UMBEL_ERROR_UNSUPPORTED);
  const Clusterer c(mesh, nullptr);
  EXPECT_EQ(umbel_frame_clusterer_build(nullptr, as_c(mesh.positions), n, 0, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_frame_clusterer_build(c.handle, nullptr, n, 0, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_frame_clusterer_build(c.handle, as_c(mesh.positions), n - 1, 0, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_frame_clusterer_build(c.handle, as_c(mesh.positions), n, 8, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_frame_clusterer_get(c.handle, nullptr), UMBEL_ERROR_INVALID_ARGUMENT);
}

}  // namespace
}  // namespace umbel
