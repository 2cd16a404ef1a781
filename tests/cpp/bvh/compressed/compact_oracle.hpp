// What holds of every compact tree, whoever made it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <vector>

#include "bvh/compressed/compact_refit.hpp"
#include "umbel/mesh.hpp"

namespace umbel::bvh {

/// A tree in the memory of the processor, without a value at first.
struct CompactTree {
  std::vector<CompactNode> nodes;
  std::vector<CompactTriangle> triangles;
  CompactInfo info{};

  explicit CompactTree(uint32_t references)
      : nodes(compact_node_capacity(references)), triangles(references) {
    std::memset(static_cast<void*>(nodes.data()), 0xa5, nodes.size() * sizeof(CompactNode));
    std::memset(static_cast<void*>(&info), 0xa5, sizeof info);
  }
  CompactArrays view() { return {nodes.data(), triangles.data(), &info}; }
};

inline void expect_same(const CompactTree& a, const CompactTree& b) {
  using Words = std::array<uint32_t, sizeof(CompactInfo) / 4>;
  ASSERT_EQ(std::bit_cast<Words>(a.info), std::bit_cast<Words>(b.info));
  ASSERT_EQ(std::memcmp(a.triangles.data(), b.triangles.data(),
                        a.triangles.size() * sizeof(CompactTriangle)),
            0);
  ASSERT_EQ(std::memcmp(a.nodes.data(), b.nodes.data(), a.info.nodes * sizeof(CompactNode)), 0);
}

inline bool holds(const Aabb& box, const Vec3& p) {
  return p.x >= box.min.x && p.y >= box.min.y && p.z >= box.min.z && p.x <= box.max.x &&
         p.y <= box.max.y && p.z <= box.max.z;
}

/// Walks a tree from its root.
class CompactOracle {
 public:
  CompactOracle(const CompactTree& tree, bool repeats)
      : tree_(tree), repeats_(repeats), seen_(tree.triangles.size()) {}

  void check() {
    ASSERT_LE(tree_.info.nodes, tree_.nodes.size());
    ASSERT_EQ(tree_.info.triangles, tree_.triangles.size());
    visit(0, 1, {});
    for (const uint8_t seen : seen_) ASSERT_EQ(seen, 1);
  }
  uint32_t deepest() const { return deepest_; }
  uint32_t largest_leaf() const { return largest_leaf_; }

 private:
  void visit(uint32_t index, uint32_t depth, std::vector<Aabb> above) {
    ASSERT_LT(index, tree_.info.nodes);
    ASSERT_LE(depth, kMaxCompactDepth);
    deepest_ = std::max(deepest_, depth);
    const CompactNode& node = tree_.nodes[index];
    uint32_t child = node.first_child, triangle = node.first_triangle, slots = 0;
    for (uint32_t slot = 0; slot < 8; ++slot) {
      const uint8_t meta = node.meta[slot];
      ASSERT_EQ((node.inner >> slot & 1) != 0, meta == CompactNode::kInner);
      if (meta == 0) continue;
      ++slots;
      above.push_back(compact_box(node, slot));
      if (meta == CompactNode::kInner) {
        ASSERT_EQ(compact_child(node, slot), child);
        ASSERT_GT(child, index);
        visit(child++, depth + 1, above);
      } else {
        ASSERT_EQ(compact_leaf(node, slot), triangle);
        ASSERT_LE(meta, 8);
        largest_leaf_ = std::max<uint32_t>(largest_leaf_, meta);
        for (uint32_t k = 0; k < meta; ++k) expect_below(triangle++, above);
      }
      above.pop_back();
    }
    ASSERT_GT(slots, 0u);
  }
  void expect_below(uint32_t triangle, const std::vector<Aabb>& above) {
    ASSERT_LT(triangle, tree_.triangles.size());
    ++seen_[triangle];
    const CompactTriangle& t = tree_.triangles[triangle];
    ASSERT_EQ(t.reserved1 | t.reserved2, 0u);
    // The parts of a triangle hold it only together.
    if (repeats_ || is_empty(box_of_finite(t.p0, t.p1, t.p2))) return;
    for (const Aabb& box : above)
      for (const Vec3& p : {t.p0, t.p1, t.p2}) ASSERT_TRUE(holds(box, p));
    for (const Vec3& p : {t.p0, t.p1, t.p2}) ASSERT_TRUE(holds(tree_.info.bounds, p));
  }

  const CompactTree& tree_;
  bool repeats_;
  std::vector<uint8_t> seen_;
  uint32_t deepest_ = 0, largest_leaf_ = 0;
};

}  // namespace umbel::bvh
