// The tree of k-means clusters as it is traced, measured and checked.
#include <algorithm>

#include "bvh/oracle.hpp"
#include "bvh/tree_tests.hpp"
#include "kdtree/meshes.hpp"

namespace umbel {
namespace {

using namespace testing;
using bvh::KaryNode;
using bvh::KaryTree;

bvh::Config with_clusters(uint32_t clusters) {
  bvh::Config config;
  config.builder = bvh::Builder::kKmeans;
  config.kmeans.clusters = clusters;
  return config;
}

TEST(KaryTree, hits_are_those_of_the_hierarchy_for_every_width) {
  for (const NamedMesh& named : hard_meshes()) {
    const MeshView mesh = named.mesh.view();
    const Bvh truth = Bvh::build(mesh);
    const std::vector<Ray> rays = adversarial_rays(mesh, 420, 5);
    for (const uint32_t clusters : {2u, 8u, 20u, 64u})
      for (const uint32_t width : {2u, 4u, 8u})
        for (const uint32_t leaf : {1u, 8u, 40u}) {
          SCOPED_TRACE(named.name + ", k " + std::to_string(clusters) + ", width " +
                       std::to_string(width) + ", leaves of " + std::to_string(leaf));
          BvhConfig config;
          config.tree = with_clusters(clusters);
          config.tree.max_leaf_size = leaf;
          config.width = width;
          config.compact = leaf == 8;
          const KaryTree tree = bvh::build_kmeans_kary(mesh, config.tree);
          bvh::check(tree, static_cast<uint32_t>(mesh.triangles.size()));
          const Bvh bvh = Bvh::widen(tree, mesh, config);
          EXPECT_EQ(bvh.statistics().references, mesh.triangles.size());
          size_t differences = 0;
          for (const Ray& ray : rays) differences += bvh.intersect(ray) != truth.intersect(ray);
          EXPECT_EQ(differences, 0u);
        }
  }
}

/// As many inner nodes as the tree has, where its nodes fit: no level is added and none taken away.
TEST(KaryTree, nodes_that_fit_stay_as_they_are) {
  const Mesh mesh = shapes::blob(4, 2);
  for (const uint32_t clusters : {2u, 4u, 8u}) {
    BvhConfig config;
    config.tree = with_clusters(clusters);
    config.width = clusters;
    const KaryTree tree = bvh::build_kmeans_kary(mesh.view(), config.tree);
    const bvh::Statistics s = bvh::statistics(tree, config.tree.cost);
    const BvhStatistics wide = Bvh::widen(tree, mesh.view(), config).statistics();
    EXPECT_EQ(wide.nodes, s.nodes - s.leaves);
    EXPECT_EQ(wide.leaves, s.leaves);
    EXPECT_EQ(wide.max_depth, s.max_depth);
    EXPECT_EQ(wide.sah_cost, s.sah_cost);
  }
}

TEST(KaryTree, costs_less_with_more_children_and_is_what_its_nodes_sum_up_to) {
  const Mesh mesh = shapes::blob(4, 2);
  const KaryTree tree = bvh::build_kmeans_kary(mesh.view(), with_clusters(8));
  double sum = 0;
  const auto area = [](const KaryNode& n) {
    const double x = n.max.x - n.min.x, y = n.max.y - n.min.y, z = n.max.z - n.min.z;
    return x * y + y * z + z * x;
  };
  for (const KaryNode& node : tree.nodes)
    sum += area(node) / area(tree.nodes[0]) * (node.is_leaf() ? 2.0 * node.count : 3.0);
  EXPECT_NEAR(bvh::sah_cost(tree), sum, 1e-4 * sum);
  EXPECT_LT(bvh::sah_cost(tree),
            bvh::sah_cost(bvh::build_kmeans_kary(mesh.view(), with_clusters(2))));
}

TEST(KaryTree, follows_moved_vertices) {
  Mesh mesh = shapes::blob(3, 2);
  const KaryTree tree = bvh::build_kmeans_kary(mesh.view());
  Bvh bvh = Bvh::widen(tree, mesh.view());
  mesh = transformed(mesh, 2, {1, 2, 3});
  const RefitReport report = bvh.refit(mesh.view());
  EXPECT_NEAR(report.sah_cost, report.built_sah_cost, 0.01 * report.sah_cost);
  const Bvh truth = Bvh::build(mesh.view());
  for (const Ray& ray : adversarial_rays(mesh.view(), 300, 3))
    EXPECT_EQ(bvh.intersect(ray), truth.intersect(ray));
}

TEST(KaryTree, invalid_triangles_are_refused_or_left_out) {
  Mesh mesh = shapes::blob(2, 2);
  mesh.positions[7].y = NAN;
  bvh::Config config = with_clusters(8);
  EXPECT_THROW(bvh::build_kmeans_kary(mesh.view(), config), Error);
  config.invalid = bvh::InvalidTriangles::kDrop;
  const KaryTree tree = bvh::build_kmeans_kary(mesh.view(), config);
  for (const uint32_t t : tree.primitives)
    for (const uint32_t vertex : mesh.triangles[t]) EXPECT_NE(vertex, 7u);
  EXPECT_LT(tree.primitives.size(), mesh.triangles.size());
  BvhConfig how;
  EXPECT_THROW(Bvh::widen(tree, mesh.view(), how), Error);
  how.tree.invalid = bvh::InvalidTriangles::kDrop;
  EXPECT_EQ(Bvh::widen(tree, mesh.view(), how).statistics().references, tree.primitives.size());
  EXPECT_EQ(Bvh::widen(KaryTree{}, MeshView{}).statistics().nodes, 0u);
}

/// A chain, each of whose nodes has a leaf and the rest of the chain below.
KaryTree chain(uint32_t levels) {
  KaryTree tree;
  const Vec3 low{0, 0, 0}, high{1, 1, 1};
  for (uint32_t i = 0; i < levels; ++i) {
    const bool is_last = i + 1 == levels;
    tree.nodes.push_back(
        {low, is_last ? i : 2 * i + 1, high, uint16_t(is_last ? 0 : 2), uint16_t(is_last ? 1 : 0)});
    tree.primitives.push_back(i);
    if (!is_last) tree.nodes.push_back({low, i, high, 0, 1});
  }
  // Nodes of a level are neighbours: the inner one first.
  for (uint32_t i = 1; i + 1 < tree.nodes.size(); i += 2)
    std::swap(tree.nodes[i], tree.nodes[i + 1]);
  return tree;
}

TEST(KaryTree, trees_too_deep_to_trace_are_refused) {
  for (const uint32_t levels : {100u, 400u}) {
    Mesh mesh;
    for (uint32_t i = 0; i < levels; ++i) add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
    const KaryTree tree = chain(levels);
    bvh::check(tree, levels);
    if (levels < 255) {
      EXPECT_EQ(Bvh::widen(tree, mesh.view()).statistics().references, levels);
      continue;
    }
    try {
      Bvh::widen(tree, mesh.view());
      ADD_FAILURE() << "was traced";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUnsupported);
    }
  }
}

TEST(KaryTree, check_finds_every_kind_of_fault) {
  const Mesh mesh = shapes::blob(2, 2);
  const auto count = static_cast<uint32_t>(mesh.triangles.size());
  const KaryTree sound = bvh::build_kmeans_kary(mesh.view());
  const auto leaf =
      static_cast<size_t>(std::find_if(sound.nodes.begin(), sound.nodes.end(),
                                       [](const KaryNode& n) { return n.is_leaf(); }) -
                          sound.nodes.begin());
  const auto broken = [&](auto&& change) {
    KaryTree tree = sound;
    change(tree);
    EXPECT_THROW(bvh::check(tree, count), Error);
    EXPECT_THROW(Bvh::widen(tree, mesh.view()), Error);
  };
  broken([](KaryTree& t) { t.nodes.pop_back(); });
  broken([](KaryTree& t) { t.nodes.push_back(t.nodes.back()); });
  broken([](KaryTree& t) { t.nodes[0].first = 0; });
  broken([](KaryTree& t) { t.nodes[0].first = 0xffffffff; });
  broken([](KaryTree& t) { t.nodes[0].children = 65; });
  broken([](KaryTree& t) { t.nodes[0].children = 1; });
  broken([](KaryTree& t) { t.nodes[0].count = 1; });
  broken([](KaryTree& t) { t.nodes[0].max.x = NAN; });
  broken([](KaryTree& t) { t.nodes[1].max.x += 1; });
  broken([](KaryTree& t) { std::swap(t.nodes[1].min, t.nodes[1].max); });
  broken([&](KaryTree& t) { t.nodes[leaf].count = 0; });
  broken([&](KaryTree& t) { t.nodes[leaf].first = 0xffffffff; });
  broken([&](KaryTree& t) { t.nodes[leaf].first += 1; });
  broken([&](KaryTree& t) { t.primitives[0] = count; });
  broken([](KaryTree& t) { t.primitives[0] = t.primitives[1]; });
  broken([](KaryTree& t) { t.primitives.push_back(0); });
}

}  // namespace
}  // namespace umbel
