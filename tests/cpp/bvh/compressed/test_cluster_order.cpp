// Orders of triangles by clusters: a radix tree over them has a subtree for every cluster.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "bvh/build/radix_merges.hpp"
#include "bvh/compressed/cluster_order.hpp"
#include "umbel/frame_clusters.hpp"

namespace umbel::bvh {
namespace {

struct Clustered {
  std::vector<Aabb> boxes;  ///< of triangles, in cluster order
  std::vector<Aabb> around;
  std::vector<uint32_t> offsets;
  uint32_t count;

  Clustered(const Mesh& mesh, const FrameClusterConfig& config) {
    FrameClusterer clusters(mesh.triangles, mesh.positions.size(), config);
    clusters.build(mesh.positions);
    for (const Triangle& t : clusters.triangles()) {
      Aabb box;
      for (const uint32_t v : t) extend(box, mesh.positions[v]);
      boxes.push_back(box);
    }
    around.assign(clusters.boxes().begin(), clusters.boxes().end());
    offsets.assign(clusters.offsets().begin(), clusters.offsets().end());
    count = uint32_t(clusters.count());
  }
  ClusterRanges ranges(uint32_t most) const {
    return {offsets.data(), around.data(), &count, most};
  }
  /// The cluster of each triangle.
  std::vector<uint32_t> owners() const {
    std::vector<uint32_t> of(boxes.size());
    for (uint32_t c = 0; c < count; ++c)
      std::fill(of.begin() + offsets[c], of.begin() + offsets[c + 1], c);
    return of;
  }
};

/// Every merge is within a cluster, or has whole clusters.
void expect_subtrees(const Clustered& scene, uint32_t most) {
  const auto n = uint32_t(scene.boxes.size());
  CpuExec exec;
  const auto order = cluster_order(exec, scene.boxes.data(), n, scene.ranges(most));
  std::vector<uint32_t> sorted(order.primitives.data(), order.primitives.data() + n);
  std::vector<Merge> merges(n);
  Subtree root{};
  radix_merges(exec, order.codes.data(), order.primitives.data(), scene.boxes.data(), n,
               merges.data(), &root);
  const std::vector<uint32_t> owners = scene.owners();
  std::vector<uint32_t> firsts;  // where clusters begin in the order
  for (uint32_t i = 0; i < n; ++i)
    if (i == 0 || owners[sorted[i]] != owners[sorted[i - 1]]) firsts.push_back(i);
  EXPECT_EQ(firsts.size(), scene.count) << "a cluster is in parts";
  firsts.push_back(n);
  std::sort(sorted.begin(), sorted.end());
  for (uint32_t i = 0; i < n; ++i) ASSERT_EQ(sorted[i], i);
  uint32_t roots = 0;
  const auto check = [&](const auto& self, Subtree s, uint32_t begin) -> uint32_t {
    const uint32_t count = s.is_primitive() ? 1 : merges[s.index()].count;
    const auto of = std::upper_bound(firsts.begin(), firsts.end(), begin) - 1;
    const bool is_within = begin + count <= of[1];
    const bool is_whole =
        begin == *of && std::binary_search(firsts.begin(), firsts.end(), begin + count);
    EXPECT_TRUE(is_within || is_whole);
    roots += begin == *of && begin + count == of[1];
    if (s.is_primitive()) return begin + 1;
    return self(self, merges[s.index()].right, self(self, merges[s.index()].left, begin));
  };
  EXPECT_EQ(check(check, root, 0), n);
  EXPECT_GE(roots, scene.count);
}

TEST(ClusterOrder, every_cluster_is_a_subtree) {
  Mesh one_place = shapes::soup(500, 2);
  for (Vec3& p : one_place.positions) p = {1, 2, 3};
  for (const Mesh& mesh : {shapes::blob(4, 3), shapes::soup(3000, 1), shapes::soup(1, 1),
                           shapes::grid(60, 40), one_place})
    for (const uint32_t size : {2u, 30u, 128u})
      for (const FrameMethod method : {FrameMethod::kMorton, FrameMethod::kHybrid}) {
        FrameClusterConfig config;
        config.method = method;
        config.max_triangles = size;
        const Clustered scene(mesh, config);
        expect_subtrees(scene, std::max(scene.count, 1u));
        const auto n = uint32_t(mesh.triangles.size());
        const uint32_t most = max_frame_clusters(n, config);
        Clustered roomy = scene;
        roomy.around.resize(most);
        roomy.offsets.resize(most + 1, 0xffffffff);
        expect_subtrees(roomy, most);
      }
}

TEST(ClusterOrder, codes_fit_for_any_number_of_clusters) {
  for (const uint32_t most : {1u, 2u, 3u, 1u << 10, 1u << 20, 1u << 28}) {
    const ClusterCodeBits bits(most);
    EXPECT_LE(3 * bits.of_cluster + bits.below_cluster(), 64u);
    EXPECT_GE(bits.of_cluster, 4u);
    EXPECT_LE(bits.of_cluster, 10u);
    EXPECT_LE(uint64_t(most - 1) >> bits.rank, 0u);
  }
}

TEST(ClusterOrder, boxes_take_no_nan) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  const Aabb box = box_around({none, 1, none});
  EXPECT_TRUE(box.min.y == 1 && box.max.y == 1);
  EXPECT_TRUE(box.min.x > box.max.x && box.min.z > box.max.z);
}

}  // namespace
}  // namespace umbel::bvh
