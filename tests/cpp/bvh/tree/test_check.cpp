#include <cmath>
#include <limits>
#include <random>

#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kCount = 500;

Bvh2 sound_tree() { return build(random_boxes(kCount, 1)); }

/// The sentence that `check` refuses a tree with after `damage`.
template <typename Damage>
std::string fault_of(const Damage& damage, uint32_t count = kCount, bool repeats = false) {
  Bvh2 tree = sound_tree();
  damage(tree);
  try {
    check(tree, count, repeats);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    return error.what();
  }
  return {};
}

uint32_t first_leaf(const Bvh2& tree) {
  uint32_t i = 0;
  while (!tree.nodes[i].is_leaf()) ++i;
  return i;
}

TEST(Check, accepts_what_builders_give) {
  EXPECT_EQ(fault_of([](Bvh2&) {}), "");
  EXPECT_NO_THROW(check(Bvh2{}, 0));
}

TEST(Check, finds_links_that_leave_the_tree_or_go_back) {
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes[0].first = uint32_t(t.nodes.size()) - 1; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes[0].first = 0xffffffff; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes[0].first = 0; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes[0].first = 3; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) {
              const uint32_t leaf = first_leaf(t);
              t.nodes[leaf].count = 0;
            }),
            "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes.push_back(t.nodes.back()); }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes.pop_back(); }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes.clear(); }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.primitives.clear(); }), "");
}

TEST(Check, finds_leaves_that_leave_the_primitives_or_overlap) {
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes[first_leaf(t)].first = 0xffffffff; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.nodes[first_leaf(t)].count = 0xffffffff; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { ++t.nodes[first_leaf(t)].count; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { ++t.nodes[first_leaf(t)].first; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.primitives.push_back(0); }, kCount, true), "");
}

TEST(Check, finds_boxes_that_are_none_or_too_small) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  for (const uint32_t node : {0u, 1u, 2u, 17u}) {
    EXPECT_NE(fault_of([&](Bvh2& t) { t.nodes[node].min.x = nan; }), "");
    EXPECT_NE(fault_of([&](Bvh2& t) { t.nodes[node].max.z = infinity; }), "");
    EXPECT_NE(fault_of([&](Bvh2& t) { t.nodes[node].max.y = t.nodes[node].min.y - 1; }), "");
  }
  EXPECT_NE(fault_of([](Bvh2& t) {
              t.nodes[0].max.x = std::nextafter(t.nodes[0].max.x, t.nodes[0].min.x);
            }),
            "");
}

TEST(Check, finds_primitives_that_are_missing_twice_or_unknown) {
  EXPECT_NE(fault_of([](Bvh2& t) { t.primitives[5] = t.primitives[6]; }), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.primitives[5] = t.primitives[6]; }, kCount, true), "");
  EXPECT_NE(fault_of([](Bvh2& t) { t.primitives[5] = kCount; }), "");
  EXPECT_NE(fault_of([](Bvh2&) {}, kCount + 1), "");
  EXPECT_NE(fault_of([](Bvh2&) {}, kCount - 1), "");
}

TEST(Check, survives_any_damage) {
  std::mt19937 random(5);
  const Bvh2 tree = sound_tree();
  for (int round = 0; round < 3000; ++round) {
    Bvh2 damaged = tree;
    for (int k = 0; k < 3; ++k) {
      Node& node = damaged.nodes[random() % damaged.nodes.size()];
      const uint32_t value = random() % 3 ? random() % (2 * kCount) : uint32_t(random());
      (random() % 2 ? node.first : node.count) = value;
    }
    try {
      check(damaged, kCount);
      // What it accepts can be traversed: every primitive is in a leaf.
      EXPECT_EQ(statistics(damaged).references, kCount);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    }
  }
}

}  // namespace
}  // namespace umbel::bvh
