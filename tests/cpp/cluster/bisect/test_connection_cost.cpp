// Clusters by connections, and by limits on vertices.
#include <gtest/gtest.h>

#include <bit>
#include <map>
#include <random>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

TEST(BisectConnections, ten_thousand_clusters_with_connections_keep_neighbours_together) {
  // A 100 x 100 grid of boxes, where rows are connected strongly.
  Items items;
  for (uint32_t y = 0; y < 100; ++y)
    for (uint32_t x = 0; x < 100; ++x) {
      items.boxes.push_back({{float(x), float(y), 0}, {float(x) + 1, float(y) + 1, 0}});
      const uint32_t i = y * 100 + x;
      const uint32_t start = uint32_t(items.targets.size());
      if (x > 0) items.targets.push_back(i - 1);
      if (x < 99) items.targets.push_back(i + 1);
      items.ranges.push_back({start, uint32_t(items.targets.size()) - start});
    }
  items.weights.assign(items.targets.size(), 20.0f);
  const auto cut_rows = [&](const Clusters& c) {
    return cluster_metrics(items.input(), c, 32).ratio_cut;
  };
  Items plain = items;
  plain.ranges.clear();
  plain.targets.clear();
  plain.weights.clear();
  EXPECT_LT(cut_rows(checked(items, limits(24, 32))),
            0.7 * cut_rows(checked(plain, limits(24, 32))));
}

TEST(BisectConnections, bad_weights_do_not_degenerate_into_single_items) {
  Items items = random_items(20000, 19);
  std::mt19937 random(3);
  for (uint32_t i = 0; i < 20000; ++i) {  // everything hangs on a few hubs
    items.ranges.push_back({uint32_t(items.targets.size()), 3});
    for (int k = 0; k < 3; ++k) items.targets.push_back(random() % 5);
  }
  for (const float weight : {0.0f, 1e-30f, 1.0f, 1e10f, 3e38f}) {
    items.weights.assign(items.targets.size(), weight);
    const Clusters c = checked(items, limits(1, 128));
    EXPECT_LT(c.ranges.size(), 2000u) << weight;
  }
}

TEST(BisectConnections, shared_vertex_weight_lowers_the_vertices_of_a_cluster) {
  const Mesh mesh = grid(150, 150, 10.0f);
  const Items items = items_of(mesh);
  const auto vertices = [&](float weight) {
    return cluster_metrics(items.input(), cluster_mesh(mesh.view(), limits(32, 128), weight), 128)
        .mean_vertices;
  };
  EXPECT_LE(vertices(1.0f), vertices(0.0f));
}

TEST(BisectConnections, vertex_limit_is_kept_and_clusters_stay_full) {
  const Mesh flat = grid(200, 200);
  for (const uint32_t limit : {3u, 10u, 64u, 128u, 255u})
    checked(items_of(flat), limits(32, 128, limit));
  ClusterConfig config = cluster_preset("quality");
  config.max_vertices = 128;
  // 42 triangles of their own vertices fill a cluster of 128 vertices; of a grid, 128 have 81.
  const Items loose = items_of(soup(20000, 4));
  for (const ClusterConfig& c : {config, limits(32, 128, 128)})
    EXPECT_GE(20000.0 / double(checked(loose, c).ranges.size()), 0.95 * 42);
  EXPECT_GE(80000.0 / double(checked(items_of(flat), config).ranges.size()), 0.95 * 128);
}

// Connections between all triangles that share a vertex, with bits for which.
void connect_by_vertices(const Mesh& mesh, Items& items, std::vector<uint8_t>& bits) {
  std::vector<std::vector<uint32_t>> users(mesh.positions.size());
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (const uint32_t v : mesh.triangles[t]) users[v].push_back(t);
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    std::map<uint32_t, uint8_t> shared;
    for (uint32_t k = 0; k < 3; ++k)
      for (const uint32_t other : users[mesh.triangles[t][k]])
        if (other != t) shared[other] |= uint8_t(1u << k);
    items.ranges.push_back({uint32_t(items.targets.size()), uint32_t(shared.size())});
    for (const auto& [other, mask] : shared) {
      items.targets.push_back(other);
      items.weights.push_back(0.1f * float(std::popcount(mask)));
      bits.push_back(mask);
    }
  }
}

TEST(BisectConnections, vertex_bits_limit_clusters_as_vertex_indices_do) {
  for (const Mesh& mesh : {grid(60, 50), soup(3000, 3), grid(100, 8, 2.0f)})
    for (const uint32_t limit : {16u, 64u, 100u}) {
      Items items = items_of(mesh);
      std::vector<uint8_t> bits;
      connect_by_vertices(mesh, items, bits);
      ClusterInput with_indices = items.input();
      const Clusters expected = build_clusters(with_indices, limits(16, 128, limit));
      expect_valid(items, limits(16, 128, limit), expected);
      ClusterInput with_bits = with_indices;
      with_bits.item_vertices = {};
      with_bits.connections.vertex_bits = bits;
      const std::vector<float> ones(bits.size(), 1.0f);  // bits alone would only count vertices
      if (with_bits.connections.weights.empty()) with_bits.connections.weights = ones;
      EXPECT_TRUE(same(expected, build_clusters(with_bits, limits(16, 128, limit))));
      Clusters alone;
      cluster::Bisector().build(with_bits, limits(16, 128, limit), alone);
      EXPECT_TRUE(same(expected, alone));
    }
}

TEST(BisectConnections, bad_vertex_bits_are_rejected) {
  const Mesh mesh = grid(4, 4);
  Items items = items_of(mesh);
  std::vector<uint8_t> bits;
  connect_by_vertices(mesh, items, bits);
  ClusterInput good = items.input();
  good.item_vertices = {};
  good.connections.vertex_bits = bits;
  EXPECT_NO_THROW(build_clusters(good, limits(1, 8, 9)));
  const ClusterConfig config = limits(1, 8, 9);
  ClusterInput in = good;
  for (const uint32_t wrong : {0u, 9u, 2u}) {
    in.vertices_per_item = wrong;
    expect_error(ErrorCode::kInvalidArgument, in, config);
  }
  in = good;
  in.connections.vertex_bits = std::span(bits).first(bits.size() - 1);
  expect_error(ErrorCode::kInvalidArgument, in, config);
  expect_error(ErrorCode::kInvalidArgument, good, limits(1, 8, 2));
}

}  // namespace
}  // namespace umbel
