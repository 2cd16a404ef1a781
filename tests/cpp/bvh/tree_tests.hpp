// What every builder's tests need: inputs, nasty ones among them, and comparisons of trees.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "umbel/bvh.hpp"

namespace umbel::bvh {

inline std::vector<Aabb> random_boxes(uint32_t count, uint32_t seed, float size = 0.02f) {
  std::mt19937 random(seed);
  const auto next = [&] { return float(random() >> 8) * 0x1p-24f; };
  std::vector<Aabb> boxes(count);
  for (Aabb& box : boxes) {
    box.min = {next(), next(), next()};
    box.max = {box.min.x + size * next(), box.min.y + size * next(), box.min.z + size * next()};
  }
  return boxes;
}

struct NamedBoxes {
  std::string name;
  std::vector<Aabb> boxes;
};

/// Few boxes, identical ones, one centre for all, flat and collinear ones, clusters far apart.
inline std::vector<NamedBoxes> nasty_boxes() {
  std::vector<NamedBoxes> all;
  for (const uint32_t n : {1u, 2u, 3u, 9u})
    all.push_back({std::to_string(n) + " boxes", random_boxes(n, n)});
  all.push_back({"identical", std::vector<Aabb>(3000, Aabb{{1, 2, 3}, {2, 3, 5}})});
  all.push_back({"points at one place", std::vector<Aabb>(3000, Aabb{{1, 2, 3}, {1, 2, 3}})});
  NamedBoxes concentric{"one centre", {}}, flat{"flat", random_boxes(3000, 5)};
  for (int i = 1; i <= 3000; ++i) {
    const float r = float(i);
    concentric.boxes.push_back({{-r, -r, -2 * r}, {r, r, 2 * r}});
  }
  for (Aabb& box : flat.boxes) box.min.y = box.max.y = 0.5f;
  all.push_back(concentric);
  all.push_back(flat);
  NamedBoxes line{"points on a line", random_boxes(3000, 6, 0)};
  for (Aabb& box : line.boxes) box.min.y = box.max.y = box.min.z = box.max.z = -7;
  all.push_back(line);
  NamedBoxes far{"far apart", random_boxes(3000, 7)};
  for (size_t i = 0; i < far.boxes.size(); i += 3)
    far.boxes[i].min.x += 1e5f, far.boxes[i].max.x += 1e5f;
  all.push_back(far);
  NamedBoxes pairs{"duplicates", random_boxes(2000, 8)};
  pairs.boxes.insert(pairs.boxes.end(), pairs.boxes.begin(), pairs.boxes.begin() + 1500);
  all.push_back(pairs);
  return all;
}

/// Each node's box is the union of the primitives' below it, and leaves are in order.
inline void expect_exact_boxes(const Bvh2& tree, const std::vector<Aabb>& boxes) {
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    const Node& node = tree.nodes[i];
    Aabb box;
    const auto add = [&](const Aabb& b) {
      box.min = {std::min(box.min.x, b.min.x), std::min(box.min.y, b.min.y),
                 std::min(box.min.z, b.min.z)};
      box.max = {std::max(box.max.x, b.max.x), std::max(box.max.y, b.max.y),
                 std::max(box.max.z, b.max.z)};
    };
    if (node.is_leaf()) {
      for (uint32_t k = 0; k < node.count; ++k) {
        add(boxes[tree.primitives[node.first + k]]);
        if (k > 0) ASSERT_LT(tree.primitives[node.first + k - 1], tree.primitives[node.first + k]);
      }
    } else {
      add(tree.nodes[node.first].box());
      add(tree.nodes[node.first + 1].box());
    }
    ASSERT_EQ(node.box(), box) << "node " << i;
  }
}

inline void expect_same(const Bvh2& a, const Bvh2& b) {
  EXPECT_EQ(a.primitives, b.primitives);
  EXPECT_EQ(a.nodes, b.nodes);
}

inline BuildOptions with_thread_count(uint32_t threads) {
  BuildOptions options;
  options.threads = threads;
  return options;
}

/// A correct tree within its limits for every input above, and the same one for any threads.
inline void expect_sound_builder(const Config& config) {
  std::vector<NamedBoxes> inputs = nasty_boxes();
  inputs.push_back({"random", random_boxes(20000, 1)});
  for (const NamedBoxes& input : inputs) {
    SCOPED_TRACE(input.name);
    const Bvh2 tree = build(input.boxes, config, with_thread_count(1));
    ASSERT_NO_THROW(check(tree, uint32_t(input.boxes.size())));
    expect_exact_boxes(tree, input.boxes);
    for (const Node& node : tree.nodes) ASSERT_LE(node.count, config.max_leaf_size);
    EXPECT_LE(statistics(tree).max_depth, config.max_depth);
    expect_same(tree, build(input.boxes, config, with_thread_count(2)));
    expect_same(tree, build(input.boxes, config, with_thread_count(8)));
  }
}

}  // namespace umbel::bvh
