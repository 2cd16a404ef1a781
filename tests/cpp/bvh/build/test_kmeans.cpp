#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bvh/oracle.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

Config kmeans(const KmeansConfig& settings) {
  Config config;
  config.builder = Builder::kKmeans;
  config.kmeans = settings;
  return config;
}

double cost_of(const std::vector<Aabb>& boxes, const Config& config) {
  return sah_cost(build(boxes, config), config.cost);
}

double cost_of(const std::vector<Aabb>& boxes, Builder builder) {
  Config config;
  config.builder = builder;
  return cost_of(boxes, config);
}

/// Three tight groups of boxes far from each other.
std::vector<Aabb> separated() {
  std::vector<Aabb> boxes = random_boxes(600, 3);
  for (size_t i = 0; i < boxes.size(); i += 3) {
    boxes[i].min.x += 50, boxes[i].max.x += 50;
    boxes[i + 1].min.y += 90, boxes[i + 1].max.y += 90;
  }
  return boxes;
}

TEST(Kmeans, trees_are_better_the_more_treelets_forward) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  const double alone = cost_of(boxes, kmeans({.forwarded_clusters = 1}));
  const double two = cost_of(boxes, kmeans({.forwarded_clusters = 2}));
  const double most = cost_of(boxes, kmeans({}));
  EXPECT_LT(two, alone);
  EXPECT_LT(most, two);
}

TEST(Kmeans, treelets_of_64_clusters_forward_two) {
  const std::vector<Aabb> boxes = random_boxes(5000, 2);
  KmeansConfig settings = kmeans_preset("q5");
  const Bvh2 most = build(boxes, kmeans(settings));
  settings.forwarded_clusters = 2;
  expect_same(most, build(boxes, kmeans(settings)));
}

TEST(Kmeans, up_to_1024_clusters_make_trees_about_as_good) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  const double few = cost_of(boxes, kmeans({.clusters = 64}));
  for (const uint32_t k : {65u, 256u, 257u, 1024u})
    EXPECT_LT(cost_of(boxes, kmeans({.clusters = k})), 1.1 * few) << k;
}

TEST(Kmeans, large_clusters_are_the_same_on_any_number_of_threads) {
  const std::vector<Aabb> boxes = random_boxes(30000, 6);
  for (const uint32_t k : {100u, 1024u}) {
    const Config config = kmeans({.clusters = k});
    expect_same(build(boxes, config, with_thread_count(1)),
                build(boxes, config, with_thread_count(8)));
  }
}

TEST(Kmeans, treelets_of_256_clusters_forward_four) {
  const std::vector<Aabb> boxes = random_boxes(5000, 2);
  const Bvh2 most = build(boxes, kmeans({.clusters = 256}));
  expect_same(most, build(boxes, kmeans({.clusters = 256, .forwarded_clusters = 4})));
}

TEST(Kmeans, times_of_all_stages_are_told_and_change_nothing) {
  const std::vector<Aabb> boxes = random_boxes(50000, 4);
  std::vector<std::string> stages;
  const StageObserver observer = [&](std::string_view stage, double seconds) {
    stages.emplace_back(stage);
    EXPECT_GT(seconds, 0) << stage;
  };
  expect_same(build(boxes, kmeans({}), {}, observer), build(boxes, kmeans({})));
  EXPECT_EQ(stages, (std::vector<std::string>{"boxes", "seeding", "iterations", "sizes",
                                              "reordering", "agglomeration"}));
}

TEST(Kmeans, distances_give_different_trees) {
  const std::vector<Aabb> boxes = random_boxes(5000, 2);
  const KmeansConfig means{}, medians{.distance = KmeansDistance::kManhattan};
  EXPECT_NE(build(boxes, kmeans(means)).primitives, build(boxes, kmeans(medians)).primitives);
}

TEST(Kmeans, presets_are_those_of_the_slides) {
  const KmeansConfig q4 = kmeans_preset("q4");
  EXPECT_EQ(q4.clusters, 32u);
  EXPECT_EQ(q4.candidates, 20u);
  EXPECT_EQ(q4.iterations, 10u);
  EXPECT_EQ(kmeans_preset("q1").iterations, 0u);
  EXPECT_THROW(kmeans_preset("q6"), Error);
}

TEST(Kmeans, separated_groups_are_separated_first) {
  KmeansConfig settings = kmeans_preset("q4");
  settings.clusters = 3;
  const std::vector<Aabb> boxes = separated();
  const KaryTree tree = build_kmeans_kary(boxes, kmeans(settings));
  ASSERT_EQ(tree.nodes[0].children, 3);
  for (uint32_t i = 0; i < 3; ++i) {
    const KaryNode& child = tree.nodes[tree.nodes[0].first + i];
    EXPECT_LT(child.max.x - child.min.x, 2);
    EXPECT_LT(child.max.y - child.min.y, 2);
  }
}

TEST(Kmeans, iterations_settle) {
  const Mesh mesh = shapes::blob(6, 4);
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
  KmeansConfig settings = kmeans_preset("q3");
  settings.iterations = 0;
  const double at_first = cost_of(boxes, kmeans(settings));
  settings.iterations = 5;
  const double after_five = cost_of(boxes, kmeans(settings));
  settings.iterations = 10;
  const double after_ten = cost_of(boxes, kmeans(settings));
  EXPECT_LT(after_five, at_first);
  EXPECT_NEAR(after_ten, after_five, 0.03 * after_five);
}

TEST(Kmeans, bounds_the_depth_on_request) {
  Config config = kmeans({});
  config.max_depth = 20;
  for (const NamedBoxes& input : nasty_boxes())
    EXPECT_LE(statistics(build(input.boxes, config)).max_depth, 20u) << input.name;
}

/// Every primitive once, boxes exact, limits kept.
void expect_sound(const KaryTree& tree, const std::vector<Aabb>& boxes, const Config& config) {
  std::vector<uint32_t> reached(tree.nodes.size()), seen(boxes.size());
  reached[0] = 1;
  for (size_t i = 0; i < tree.nodes.size(); ++i) {
    const KaryNode& node = tree.nodes[i];
    ASSERT_EQ(reached[i], 1u);
    Aabb box;
    const auto add = [&](const Aabb& b) {
      box = {{std::min(box.min.x, b.min.x), std::min(box.min.y, b.min.y),
              std::min(box.min.z, b.min.z)},
             {std::max(box.max.x, b.max.x), std::max(box.max.y, b.max.y),
              std::max(box.max.z, b.max.z)}};
    };
    if (node.is_leaf()) {
      ASSERT_GE(node.count, 1);
      ASSERT_LE(node.count, config.max_leaf_size);
      for (uint32_t k = 0; k < node.count; ++k) {
        ++seen[tree.primitives[node.first + k]];
        add(boxes[tree.primitives[node.first + k]]);
      }
    } else {
      ASSERT_GE(node.children, 2);
      ASSERT_LE(node.children, config.kmeans.clusters);
      ASSERT_GT(node.first, i);
      for (uint32_t k = 0; k < node.children; ++k) {
        ++reached[node.first + k];
        add(tree.nodes[node.first + k].box());
      }
    }
    ASSERT_EQ(node.box(), box);
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), 1u), std::ptrdiff_t(boxes.size()));
}

TEST(KmeansKary, trees_are_sound_and_the_same_for_any_threads) {
  std::vector<NamedBoxes> inputs = nasty_boxes();
  inputs.push_back({"random", random_boxes(30000, 1)});
  for (const uint32_t k : {2u, 8u, 64u}) {
    const Config config = kmeans({.clusters = k});
    for (const NamedBoxes& input : inputs) {
      SCOPED_TRACE(input.name);
      const KaryTree tree = build_kmeans_kary(input.boxes, config, with_thread_count(1));
      expect_sound(tree, input.boxes, config);
      const KaryTree other = build_kmeans_kary(input.boxes, config, with_thread_count(8));
      EXPECT_EQ(tree.nodes, other.nodes);
      EXPECT_EQ(tree.primitives, other.primitives);
    }
  }
}

TEST(KmeansKary, scale_changes_nothing_but_boxes) {
  std::vector<Aabb> boxes = random_boxes(3000, 9);
  const KaryTree tree = build_kmeans_kary(boxes);
  for (Aabb& b : boxes)
    for (float* v : {&b.min.x, &b.min.y, &b.min.z, &b.max.x, &b.max.y, &b.max.z}) *v *= 0x1p90f;
  const KaryTree huge = build_kmeans_kary(boxes);
  EXPECT_EQ(tree.primitives, huge.primitives);
  ASSERT_EQ(tree.nodes.size(), huge.nodes.size());
  EXPECT_EQ(tree.nodes[0].max.x * 0x1p90f, huge.nodes[0].max.x);
}

TEST(KmeansKary, more_than_64_children_are_refused) {
  EXPECT_THROW(build_kmeans_kary(random_boxes(10, 1), kmeans({.clusters = 65})), Error);
}

TEST(KmeansKary, bad_boxes_are_refused) {
  std::vector<Aabb> boxes = random_boxes(10, 1);
  boxes[7].min.y = NAN;
  EXPECT_THROW(build_kmeans_kary(boxes), Error);
  boxes[7] = {};
  EXPECT_THROW(build_kmeans_kary(boxes), Error);
  EXPECT_TRUE(build_kmeans_kary(std::span<const Aabb>{}).nodes.empty());
}

struct Scene {
  const char* file;
  double over_sweep;  ///< most that the cost at q4 may be of the full sweep's
  bool is_scan;       ///< smooth, and so better divided by planes
};

class KmeansScenes : public ::testing::TestWithParam<Scene> {};

TEST_P(KmeansScenes, are_cheaper_than_linear_trees_and_near_the_sweep) {
  const auto mesh = testing::read_mesh(GetParam().file);
  if (!mesh) GTEST_SKIP() << "no " << GetParam().file;
  const std::vector<Aabb> boxes = triangle_boxes(mesh->view());
  const double cost = cost_of(boxes, kmeans(kmeans_preset("q4")));
  EXPECT_LT(cost, cost_of(boxes, Builder::kLbvh));
  EXPECT_LT(cost, GetParam().over_sweep * cost_of(boxes, Builder::kSweep));
  if (GetParam().is_scan) return;
  EXPECT_LT(cost, cost_of(boxes, Builder::kHlbvh));
  EXPECT_LT(cost_of(boxes, kmeans({})), cost_of(boxes, Builder::kHlbvh));
}

INSTANTIATE_TEST_SUITE_P(RealMeshes, KmeansScenes,
                         ::testing::Values(Scene{"sibenik_75k.ply", 1.10, false},
                                           Scene{"conference_331k.ply", 1.0, false},
                                           Scene{"lucy_100k.ply", 1.15, true}));

}  // namespace
}  // namespace umbel::bvh
