// The tree of k-means clusters from C, beside the C++ interface.
#include <gtest/gtest.h>

#include <cstring>

#include "capi/bvh_call.hpp"
#include "umbel/umbel_bvh.h"

namespace umbel {
namespace {

using namespace bvh_call;

struct KaryCall : Call {
  KaryCall() {
    EXPECT_EQ(umbel_bvh_config_builder(&config, "kmeans-q2"), UMBEL_OK);
    umbel_bvh2_capacity room;
    umbel_bvh2_capacity_init(&room);
    EXPECT_EQ(umbel_bvh2_requirements(source.triangles.size(), &config, &room), UMBEL_OK);
    nodes.resize(room.nodes);
    primitives.resize(room.primitives);
    umbel_kary_init(&tree);
    tree.nodes = nodes.data();
    tree.node_capacity = nodes.size();
    tree.primitives = primitives.data();
    tree.primitive_capacity = primitives.size();
  }
  std::vector<umbel_kary_node> nodes;
  std::vector<uint32_t> primitives;
  umbel_kary tree;
};

TEST(CapiKary, trees_are_those_of_cpp) {
  KaryCall c;
  bvh::Config config;
  config.builder = bvh::Builder::kKmeans;
  config.kmeans = bvh::kmeans_preset("q2");
  const bvh::KaryTree expected = bvh::build_kmeans_kary(c.source.view(), config);
  const auto expect_same = [&] {
    ASSERT_EQ(c.tree.node_count, expected.nodes.size());
    ASSERT_EQ(c.tree.primitive_count, expected.primitives.size());
    EXPECT_EQ(std::memcmp(c.nodes.data(), expected.nodes.data(),
                          expected.nodes.size() * sizeof(bvh::KaryNode)),
              0);
    EXPECT_TRUE(
        std::equal(expected.primitives.begin(), expected.primitives.end(), c.primitives.begin()));
  };
  ASSERT_EQ(umbel_kary_build_triangles(&c.mesh, &c.config, nullptr, &c.tree), UMBEL_OK)
      << umbel_last_error();
  expect_same();
  umbel_bvh2_statistics s;
  umbel_bvh2_statistics_init(&s);
  ASSERT_EQ(umbel_kary_get_statistics(&c.tree, &c.config, &s), UMBEL_OK) << umbel_last_error();
  EXPECT_EQ(s.nodes, expected.nodes.size());
  EXPECT_EQ(s.sah_cost, bvh::sah_cost(expected, config.cost));
  EXPECT_EQ(s.max_depth, bvh::statistics(expected).max_depth);
  std::vector<umbel_aabb> boxes;
  for (const Triangle& t : c.source.triangles) {
    Vec3 low = c.source.positions[t[0]], high = low;
    for (const uint32_t v : t) {
      const Vec3& p = c.source.positions[v];
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    boxes.push_back({vec(low), vec(high)});
  }
  c.tree.node_count = 0;
  ASSERT_EQ(umbel_kary_build(boxes.data(), boxes.size(), &c.config, nullptr, &c.tree), UMBEL_OK)
      << umbel_last_error();
  expect_same();
}

TEST(CapiKary, trees_are_traced) {
  KaryCall c;
  ASSERT_EQ(umbel_kary_build_triangles(&c.mesh, &c.config, nullptr, &c.tree), UMBEL_OK);
  umbel_bvh* made = nullptr;
  ASSERT_EQ(umbel_bvh_from_kary(&c.tree, &c.mesh, &c.config, nullptr, &made), UMBEL_OK)
      << umbel_last_error();
  const Owned bvh(made);
  const Bvh truth = Bvh::build(c.source.view());
  const std::vector<Ray> rays = random_rays(300, 4);
  std::vector<umbel_hit> hits(rays.size());
  ASSERT_EQ(umbel_bvh_intersect(made, as_c(rays), rays.size(), nullptr, hits.data()), UMBEL_OK);
  for (size_t i = 0; i < rays.size(); ++i)
    ASSERT_TRUE(same(hits[i], truth.intersect(rays[i]))) << i;
}

TEST(CapiKary, mistakes_are_refused) {
  KaryCall c;
  umbel_bvh* made = nullptr;
  umbel_bvh2_statistics s;
  umbel_bvh2_statistics_init(&s);
  expect_failure(umbel_kary_build_triangles(nullptr, nullptr, nullptr, &c.tree),
                 UMBEL_ERROR_INVALID_ARGUMENT, "mesh");
  expect_failure(umbel_kary_build_triangles(&c.mesh, nullptr, nullptr, nullptr),
                 UMBEL_ERROR_INVALID_ARGUMENT, "tree");
  expect_failure(umbel_kary_build(nullptr, 3, nullptr, nullptr, &c.tree),
                 UMBEL_ERROR_INVALID_ARGUMENT, "boxes");
  c.tree.node_capacity = 3;
  expect_failure(umbel_kary_build_triangles(&c.mesh, &c.config, nullptr, &c.tree),
                 UMBEL_ERROR_CAPACITY, "room for 3 nodes");
  EXPECT_GT(c.tree.node_count, 3u);
  c.tree.node_capacity = c.nodes.size();
  ASSERT_EQ(umbel_kary_build_triangles(&c.mesh, &c.config, nullptr, &c.tree), UMBEL_OK);
  c.config.intersection_cost = 0;
  expect_failure(umbel_kary_get_statistics(&c.tree, &c.config, &s), UMBEL_ERROR_INVALID_ARGUMENT,
                 "cost.intersection is 0");
  expect_failure(umbel_bvh_from_kary(&c.tree, &c.mesh, &c.config, nullptr, &made),
                 UMBEL_ERROR_INVALID_ARGUMENT, "cost.intersection is 0");
  c.nodes[0].children = 1;
  expect_failure(umbel_kary_get_statistics(&c.tree, nullptr, &s), UMBEL_ERROR_CORRUPT, "node 0");
  expect_failure(umbel_bvh_from_kary(&c.tree, &c.mesh, nullptr, nullptr, &made),
                 UMBEL_ERROR_CORRUPT, "node 0");
  EXPECT_EQ(made, nullptr);
  c.tree.struct_size = 0;
  expect_failure(umbel_kary_get_statistics(&c.tree, nullptr, &s), UMBEL_ERROR_INVALID_ARGUMENT,
                 "tree->struct_size");
}

}  // namespace
}  // namespace umbel
