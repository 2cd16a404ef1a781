#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>

#include "base/math.hpp"
#include "bvh/tree_tests.hpp"
#include "heap_peak.hpp"
#include "umbel/bvh_traverse.hpp"
#include "umbel/dynamic_bvh.hpp"
#include "umbel/mesh.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel {
namespace {

using bvh::DynamicTree;
using bvh::random_boxes;

bool meet(const Aabb& a, const Aabb& b) {
  return a.min.x <= b.max.x && a.max.x >= b.min.x && a.min.y <= b.max.y && a.max.y >= b.min.y &&
         a.min.z <= b.max.z && a.max.z >= b.min.z;
}

/// The tree holds exactly these boxes, and its own are their unions.
void expect_holds(const DynamicTree& tree, const std::map<uint32_t, Aabb>& truth) {
  ASSERT_EQ(tree.size(), truth.size());
  for (const auto& [number, box] : truth) {
    ASSERT_TRUE(tree.contains(number));
    ASSERT_EQ(tree.box(number), box);
  }
  const bvh::Bvh2 all = tree.snapshot(1);
  std::vector<uint32_t> numbers = all.primitives;
  std::sort(numbers.begin(), numbers.end());
  ASSERT_EQ(numbers.size(), truth.size());
  size_t i = 0;
  for (const auto& [number, box] : truth) ASSERT_EQ(numbers[i++], number);
  for (const bvh::Node& node : all.nodes) {
    Aabb below;
    if (node.is_leaf()) {
      below = truth.at(all.primitives[node.first]);
    } else {
      for (const uint32_t child : {node.first, node.first + 1}) {
        below.min = {std::min(below.min.x, all.nodes[child].min.x),
                     std::min(below.min.y, all.nodes[child].min.y),
                     std::min(below.min.z, all.nodes[child].min.z)};
        below.max = {std::max(below.max.x, all.nodes[child].max.x),
                     std::max(below.max.y, all.nodes[child].max.y),
                     std::max(below.max.z, all.nodes[child].max.z)};
      }
    }
    ASSERT_EQ(node.box(), below);
  }
}

void expect_overlaps(const DynamicTree& tree, const std::map<uint32_t, Aabb>& truth,
                     const Aabb& region) {
  std::vector<uint32_t> expected;
  for (const auto& [number, box] : truth)
    if (meet(box, region)) expected.push_back(number);
  ASSERT_EQ(tree.overlaps(region), expected);
}

TEST(DynamicTree, holds_what_was_put_in_and_not_taken_out) {
  const std::vector<Aabb> boxes = random_boxes(3000, 1);
  std::mt19937 random(2);
  DynamicTree tree;
  std::map<uint32_t, Aabb> truth;
  for (uint32_t i = 0; i < 6000; ++i) {
    const Aabb& box = boxes[random() % boxes.size()];
    const uint32_t what = random() % 4;
    if (truth.empty() || what < 2) {
      const uint32_t number = tree.insert(box);
      ASSERT_TRUE(truth.emplace(number, box).second);
    } else {
      auto some = truth.lower_bound(random() % boxes.size());
      if (some == truth.end()) some = truth.begin();
      if (what == 2) {
        tree.move(some->first, box);
        some->second = box;
      } else {
        tree.remove(some->first);
        truth.erase(some);
      }
    }
    if (i % 1000 == 0) expect_holds(tree, truth);
    if (i % 50 == 0) expect_overlaps(tree, truth, boxes[i % boxes.size()]);
  }
  expect_holds(tree, truth);
  while (!truth.empty()) {
    tree.remove(truth.begin()->first);
    truth.erase(truth.begin());
    if (truth.size() < 5) expect_holds(tree, truth);
  }
  EXPECT_TRUE(tree.nodes().empty());
  EXPECT_EQ(tree.quality().sah_cost, 0);
  tree.insert(boxes[0]);
  EXPECT_EQ(tree.size(), 1u);
}

TEST(DynamicTree, a_built_tree_takes_insertions_moves_and_refits) {
  std::vector<Aabb> boxes = random_boxes(5000, 3);
  for (const bvh::Builder builder : {bvh::Builder::kBinned, bvh::Builder::kLbvh}) {
    bvh::Config config;
    config.builder = builder;
    DynamicTree tree = DynamicTree::build(boxes, config);
    std::map<uint32_t, Aabb> truth;
    for (uint32_t i = 0; i < boxes.size(); ++i) truth[i] = boxes[i];
    expect_holds(tree, truth);
    std::vector<uint32_t> some;
    std::vector<Aabb> there;
    for (uint32_t i = 0; i < 5000; i += 7) {
      some.push_back(i);
      there.push_back(boxes[(i + 1) % boxes.size()]);
      truth[i] = there.back();
    }
    tree.refit(some, there);
    expect_holds(tree, truth);
    tree.rebuild(config);
    expect_holds(tree, truth);
    EXPECT_EQ(tree.quality().sah_cost, tree.quality().built_sah_cost);
  }
}

/// Moving every primitive for good leaves a tree that is nearly as good as a new one; refitting
/// alone does not, and says so.
TEST(DynamicTree, stays_good_where_primitives_move_and_tells_where_it_does_not) {
  const std::vector<Aabb> from = random_boxes(4000, 5), to = random_boxes(4000, 6);
  const double built = DynamicTree::build(to).quality().sah_cost;
  DynamicTree moved = DynamicTree::build(from), refitted = DynamicTree::build(from);
  std::vector<uint32_t> numbers;
  for (uint32_t i = 0; i < from.size(); ++i) {
    moved.move(i, to[i]);
    numbers.push_back(i);
  }
  refitted.refit(numbers, to);
  EXPECT_LT(moved.quality().sah_cost, 1.15 * built);
  EXPECT_FALSE(moved.quality().rebuild_advised);
  EXPECT_GT(refitted.quality().sah_cost, 3 * built);
  EXPECT_TRUE(refitted.quality().rebuild_advised);
}

/// Areas of boxes as large or as small as these are no floats.
TEST(DynamicTree, the_cost_does_not_depend_on_the_scale) {
  const std::vector<Aabb> boxes = random_boxes(1000, 5);
  const double expected = DynamicTree::build(boxes).quality().sah_cost;
  for (const float scale : {0x1p80f, 0x1p120f, 0x1p-80f}) {
    std::vector<Aabb> scaled;
    for (const Aabb& box : boxes) scaled.push_back({box.min * scale, box.max * scale});
    DynamicTree tree = DynamicTree::build(scaled);
    EXPECT_NEAR(tree.quality().sah_cost, expected, 1e-3 * expected) << scale;
    EXPECT_FALSE(tree.quality().rebuild_advised);
    std::vector<uint32_t> numbers(scaled.size());
    std::iota(numbers.begin(), numbers.end(), 0u);
    std::reverse(scaled.begin(), scaled.end());
    tree.refit(numbers, scaled);
    EXPECT_TRUE(tree.quality().rebuild_advised);
  }
}

/// Where areas are 0, infinite or equal, and in any order, trees are not deep.
TEST(DynamicTree, no_boxes_become_a_chain) {
  const std::vector<Aabb> boxes = random_boxes(4000, 9);
  const auto expect_flat = [&](const char* name, auto&& change) {
    DynamicTree tree;
    std::map<uint32_t, Aabb> truth;
    for (const Aabb& box : boxes) {
      const Aabb changed = change(box);
      truth.emplace(tree.insert(changed), changed);
    }
    expect_holds(tree, truth);
    EXPECT_LT(bvh::statistics(tree.snapshot(1)).max_depth, 64u) << name;
  };
  const auto scaled = [](float scale) {
    return [=](const Aabb& box) { return Aabb{box.min * scale, box.max * scale}; };
  };
  expect_flat("one point", [](const Aabb&) { return Aabb{{1, 2, 3}, {1, 2, 3}}; });
  expect_flat("one box", [](const Aabb&) { return Aabb{{1, 2, 3}, {4, 5, 6}}; });
  expect_flat("huge", scaled(0x1p120f));
  expect_flat("tiny", scaled(0x1p-100f));
  expect_flat("points on a line",
              [](const Aabb& box) { return Aabb{{box.min.x, 0, 0}, {box.min.x, 0, 0}}; });
  expect_flat("points on a line, in order", [x = 0.0f](const Aabb&) mutable {
    x += 1;
    return Aabb{{x, 0, 0}, {x, 0, 0}};
  });
}

/// Areas of the refitted boxes overflow or underflow.
TEST(DynamicTree, removals_do_not_depend_on_the_scale) {
  const std::vector<Aabb> boxes = random_boxes(4000, 10);
  const auto cost_after = [&](float scale) {
    DynamicTree tree;
    std::vector<uint32_t> numbers;
    std::vector<Aabb> scaled;
    for (const Aabb& box : boxes) {
      numbers.push_back(tree.insert(box));
      scaled.push_back({box.min * scale, box.max * scale});
    }
    tree.refit(numbers, scaled);
    for (size_t i = 0; i < numbers.size(); i += 2) tree.remove(numbers[i]);
    return tree.quality().sah_cost;
  };
  const double expected = cost_after(1);
  for (const float scale : {0x1p120f, 0x1p-100f})
    EXPECT_NEAR(cost_after(scale), expected, 1e-6 * expected) << scale;
}

TEST(DynamicTree, nearest_box_is_found_in_order) {
  const std::vector<Aabb> boxes = random_boxes(2000, 8);
  DynamicTree tree;
  for (const Aabb& box : boxes) tree.insert(box);
  const auto distance = [](const Aabb& box) {
    const auto outside = [](double low, double high) { return std::max({low, -high, 0.0}); };
    const double x = outside(box.min.x, box.max.x), y = outside(box.min.y, box.max.y),
                 z = outside(box.min.z, box.max.z);
    return x * x + y * y + z * z;
  };
  double truth = 1e30;
  for (const Aabb& box : boxes) truth = std::min(truth, distance(box));
  size_t visits = 0;
  const double found = bvh::traverse_ordered(tree, distance, [&](uint32_t i) {
    ++visits;
    return distance(tree.box(i));
  });
  EXPECT_EQ(found, truth);
  EXPECT_LT(visits, 200u);
}

TEST(DynamicTree, a_snapshot_of_triangles_answers_rays) {
  const Mesh mesh = shapes::blob(4, 1);
  DynamicTree tree;
  for (const Aabb& box : triangle_boxes(mesh.view())) tree.insert(box);
  const bvh::Bvh2 snapshot = tree.snapshot();
  bvh::check(snapshot, static_cast<uint32_t>(mesh.triangles.size()));
  const Bvh widened = Bvh::widen(snapshot, mesh.view()), built = Bvh::build(mesh.view());
  const Ray ray{{0, 0, 0}, 0, {0.3f, 0.2f, 1}};
  EXPECT_EQ(widened.intersect(ray), built.intersect(ray));
}

TEST(DynamicTree, a_snapshot_of_boxes_within_boxes_can_be_traversed) {
  DynamicTree tree;
  for (int i = 1; i <= 2000; ++i) {
    const auto x = float(i);
    tree.insert({{-x, -x, -x}, {x, x, x}});
  }
  for (const uint32_t max_leaf_size : {1u, 8u}) {
    const bvh::Bvh2 snapshot = tree.snapshot(max_leaf_size);
    bvh::check(snapshot, 2000);
    size_t visited = 0;
    bvh::traverse(
        snapshot, [](const bvh::Node&) { return true; },
        [&](std::span<const uint32_t> leaf) {
          visited += leaf.size();
          return true;
        });
    EXPECT_EQ(visited, 2000u);
  }
}

TEST(DynamicTree, an_empty_region_touches_nothing) {
  DynamicTree tree;
  tree.insert({{0, 0, 0}, {1, 1, 1}});
  EXPECT_EQ(tree.overlaps({{1, 1, 1}, {1, 1, 1}}).size(), 1u);
  EXPECT_TRUE(tree.overlaps({{1, 0, 0}, {0, 1, 1}}).empty());
}

TEST(DynamicTree, refuses_what_is_not_there_and_stays_as_it_was) {
  DynamicTree tree;
  const Aabb box{{0, 0, 0}, {1, 1, 1}};
  EXPECT_THROW(tree.remove(0), Error);
  const uint32_t number = tree.insert(box);
  EXPECT_THROW(tree.insert(Aabb{}), Error);
  EXPECT_THROW(tree.insert({{0, 0, 0}, {NAN, 1, 1}}), Error);
  EXPECT_THROW(tree.move(number + 1, box), Error);
  EXPECT_THROW(tree.move(number, Aabb{}), Error);
  EXPECT_THROW(tree.box(7), Error);
  EXPECT_THROW(tree.snapshot(0), Error);
  EXPECT_THROW(DynamicTree({0, 2}), Error);
  const uint32_t numbers[] = {number};
  EXPECT_THROW(tree.refit(numbers, {}), Error);
  expect_holds(tree, {{number, box}});
  const DynamicTree other = std::move(tree);
  expect_holds(other, {{number, box}});
  EXPECT_EQ(tree.size(), 0u);  // NOLINT(bugprone-use-after-move)
}

TEST(DynamicTree, stays_as_it_was_where_there_is_no_memory_for_a_change) {
  if (!testing::FailingAllocation::works()) GTEST_SKIP() << "operator new is another's";
  const std::vector<Aabb> boxes = random_boxes(140, 5);
  DynamicTree tree;
  std::map<uint32_t, Aabb> truth;
  const auto expect_unchanged = [&] { expect_holds(tree, truth); };
  for (const Aabb& box : boxes) {
    uint32_t number = 0;
    testing::fail_each_allocation([&] { number = tree.insert(box); }, expect_unchanged);
    truth.emplace(number, box);
  }
  BuildOptions one_thread;
  one_thread.threads = 1;
  testing::fail_each_allocation([&] { tree.rebuild({}, one_thread); }, expect_unchanged);
  for (uint32_t i = 0; i < 60; ++i) {
    const Aabb& there = boxes[(7 * i) % boxes.size()];
    testing::fail_each_allocation([&] { tree.move(i, there); }, expect_unchanged);
    truth[i] = there;
  }
  const std::vector<uint32_t> some{3, 50, 99};
  const std::vector<Aabb> moved(some.size(), boxes[0]);
  testing::fail_each_allocation([&] { tree.refit(some, moved); }, expect_unchanged);
  for (const uint32_t number : some) truth[number] = boxes[0];
  while (!truth.empty()) {
    const uint32_t number = truth.begin()->first;
    testing::fail_each_allocation([&] { tree.remove(number); }, expect_unchanged);
    truth.erase(number);
  }
  expect_unchanged();
}

}  // namespace
}  // namespace umbel
