// Ordered clusters are the same clusters, and reuse vertices better.
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <set>

#include "umbel/cluster.hpp"

namespace umbel {
namespace {

Clusters clusters_of(const Mesh& mesh, uint32_t max_items = 128) {
  ClusterConfig config = cluster_preset("quality", max_items);
  config.max_vertices = 128;
  return cluster_mesh(mesh.view(), config);
}

bool is_rotation(const Triangle& a, const Triangle& b) {
  return a == b || a == Triangle{b[1], b[2], b[0]} || a == Triangle{b[2], b[0], b[1]};
}

void expect_same_clusters(const Mesh& mesh, const Clusters& clusters, const ClusterMeshlets& m,
                          int level) {
  ASSERT_EQ(m.vertex_offsets.size(), clusters.ranges.size() + 1);
  ASSERT_EQ(m.vertex_offsets.back(), m.vertices.size());
  ASSERT_EQ(m.items.size(), clusters.items.size());
  ASSERT_EQ(m.corners.size(), clusters.items.size());
  for (size_t c = 0; c < clusters.ranges.size(); ++c) {
    const Range& r = clusters.ranges[c];
    const std::multiset<uint32_t> before(clusters.items.begin() + r.offset,
                                         clusters.items.begin() + r.offset + r.count);
    const std::multiset<uint32_t> after(m.items.begin() + r.offset,
                                        m.items.begin() + r.offset + r.count);
    ASSERT_EQ(before, after) << "cluster " << c;
    const uint32_t first = m.vertex_offsets[c], size = m.vertex_offsets[c + 1] - first;
    const std::set<uint32_t> unique(m.vertices.begin() + first, m.vertices.begin() + first + size);
    ASSERT_EQ(unique.size(), size) << "a vertex twice in cluster " << c;
    uint32_t next = 0;
    for (uint32_t i = r.offset; i < r.offset + r.count; ++i) {
      Triangle named;
      for (int k = 0; k < 3; ++k) {
        ASSERT_LE(m.corners[i][k], next) << "vertices are numbered by first use";
        next = std::max(next, m.corners[i][k] + 1u);
        named[k] = m.vertices[first + m.corners[i][k]];
      }
      const Triangle& source = mesh.triangles[m.items[i]];
      ASSERT_TRUE(level ? is_rotation(named, source) : named == source) << "item " << i;
    }
    ASSERT_EQ(next, size) << "a vertex of cluster " << c << " is not used";
  }
}

// Vertices transformed by a cache of 16 that starts empty with every cluster.
size_t transformed(const Mesh& mesh, const Clusters& clusters, const std::vector<uint32_t>& items) {
  size_t total = 0;
  for (const Range& r : clusters.ranges) {
    std::vector<uint32_t> indices;
    for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
      for (const uint32_t v : mesh.triangles[items[i]]) indices.push_back(v);
    total +=
        meshopt_analyzeVertexCache(indices.data(), indices.size(), mesh.positions.size(), 16, 0, 0)
            .vertices_transformed;
  }
  return total;
}

/// Degenerate triangles, and the same one several times in all rotations.
Mesh with_bad_triangles(Mesh mesh) {
  for (size_t i = 0; i < 40; ++i) {
    const Triangle t = mesh.triangles[i * 3];
    mesh.triangles.push_back({t[0], t[0], t[1]});
    mesh.triangles.push_back({t[1], t[1], t[1]});
    mesh.triangles.push_back({t[0], t[1], t[0]});
    mesh.triangles.push_back({t[1], t[2], t[0]});
    mesh.triangles.push_back({t[2], t[1], t[0]});
    mesh.triangles.push_back(t);
  }
  return mesh;
}

TEST(OrderClusters, every_triangle_stays_in_its_cluster) {
  for (const Mesh& mesh : {shapes::blob(5, 1), shapes::terrain(50, 40, 2), shapes::soup(3000, 3),
                           shapes::fan(500), with_bad_triangles(shapes::torus(40, 20))}) {
    const Clusters clusters = clusters_of(mesh);
    for (const int level : {0, 1, 3, 9})
      expect_same_clusters(mesh, clusters, order_clusters(mesh.view(), clusters, level), level);
  }
}

TEST(OrderClusters, vertices_are_reused_more) {
  const Mesh mesh = shapes::blob(6, 1);
  const Clusters clusters = clusters_of(mesh);
  const size_t before = transformed(mesh, clusters, clusters.items);
  for (const int level : {0, 3}) {
    const ClusterMeshlets m = order_clusters(mesh.view(), clusters, level);
    EXPECT_LT(transformed(mesh, clusters, m.items), before * 9 / 10) << "level " << level;
  }
}

TEST(OrderClusters, result_does_not_depend_on_threads) {
  const Mesh mesh = shapes::blob(6, 1);
  const Clusters clusters = clusters_of(mesh, 16);
  ASSERT_GT(clusters.ranges.size(), 4096u) << "more than one batch";
  const ClusterMeshlets all = order_clusters(mesh.view(), clusters, 3);
  for (const uint32_t threads : {1u, 2u, 8u}) {
    BuildOptions options;
    options.threads = threads;
    const ClusterMeshlets m = order_clusters(mesh.view(), clusters, 3, options);
    EXPECT_EQ(m.items, all.items);
    EXPECT_EQ(m.vertex_offsets, all.vertex_offsets);
    EXPECT_EQ(m.vertices, all.vertices);
    EXPECT_EQ(m.corners, all.corners);
  }
}

TEST(OrderClusters, items_of_no_cluster_stay) {
  const Mesh mesh = shapes::grid(10, 10);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  const std::vector<Range> segments{{50, 100}};
  ClusterInput input;
  input.boxes = boxes;
  input.segments = segments;
  const Clusters clusters = build_clusters(input, cluster_preset("quality", 32));
  const ClusterMeshlets m = order_clusters(mesh.view(), clusters);
  for (uint32_t i = 0; i < 50; ++i) {
    EXPECT_EQ(m.items[i], i);
    EXPECT_EQ(m.corners[i], (std::array<uint8_t, 3>{}));
  }
}

TEST(OrderClusters, nothing_is_ordered_to_nothing) {
  const ClusterMeshlets m = order_clusters(MeshView{}, Clusters{});
  EXPECT_TRUE(m.items.empty() && m.vertices.empty() && m.corners.empty());
  EXPECT_EQ(m.vertex_offsets, std::vector<uint32_t>{0});
}

ErrorCode failure_of(const Mesh& mesh, const Clusters& clusters, int level,
                     const BuildOptions& options = {}) {
  try {
    order_clusters(mesh.view(), clusters, level, options);
  } catch (const Error& error) {
    EXPECT_GT(std::string(error.what()).size(), 10u);
    return error.code();
  }
  ADD_FAILURE() << "no error";
  return ErrorCode::kIo;
}

TEST(OrderClusters, mistakes_are_errors) {
  const Mesh mesh = shapes::grid(20, 20);
  const Clusters good = clusters_of(mesh);
  EXPECT_EQ(failure_of(mesh, good, -1), ErrorCode::kInvalidArgument);
  EXPECT_EQ(failure_of(mesh, good, 10), ErrorCode::kInvalidArgument);
  for (const Range range : {Range{0, 0}, Range{799, 2}, Range{0xffffffffu, 1}, Range{0, 600}}) {
    Clusters bad = good;
    bad.ranges[0] = range;
    EXPECT_EQ(failure_of(mesh, bad, 0), ErrorCode::kInvalidArgument) << range.offset;
  }
  Clusters overlapping = good;
  overlapping.ranges.push_back(good.ranges[0]);
  EXPECT_EQ(failure_of(mesh, overlapping, 0), ErrorCode::kInvalidArgument);
  Clusters foreign = good;
  foreign.items[3] = 800;
  EXPECT_EQ(failure_of(mesh, foreign, 0), ErrorCode::kInvalidArgument);
  Mesh broken = mesh;
  broken.triangles[7][2] = 1u << 31;
  EXPECT_EQ(failure_of(broken, good, 0), ErrorCode::kInvalidMesh);
  const Mesh soup = shapes::soup(128, 1);
  Clusters wide;
  wide.ranges = {{0, 128}};
  for (uint32_t i = 0; i < 128; ++i) wide.items.push_back(i);
  EXPECT_EQ(failure_of(soup, wide, 0), ErrorCode::kInvalidArgument) << "384 vertices";
  BuildOptions options;
  options.progress = [](float, std::string_view) { return false; };
  EXPECT_EQ(failure_of(mesh, good, 0, options), ErrorCode::kCancelled);
}

}  // namespace
}  // namespace umbel
