#include "bvh/wide/widen_plan.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "base/parallel.hpp"
#include "base/simd/float4.hpp"

namespace umbel {
namespace {

// What a visit costs, in any unit: of a node, of a leaf, and of each triangle of it. Measured with
// ray_bench (see docs/bvh.md).
constexpr float kNodeCost = 1.0f, kLeafCost = 0.5f, kTriangleCost = 0.06f;

/// What a binary node's subtree costs as at most 1 to 4 and 5 to 8 children.
struct SubtreeCosts {
  Float4 few, many;
};

/// Costs of one child more each; `first` is the new first one.
SubtreeCosts shifted(const SubtreeCosts& costs, Float4 first) {
  return {__builtin_shufflevector(first, costs.few, 0, 4, 5, 6),
          __builtin_shufflevector(costs.few, costs.many, 3, 4, 5, 6)};
}

/// How many of 1 to 4 and 5 to 8 children go to the left.
struct ShareLanes {
  Int4 few, many;
};

float leaf_cost(float area, uint32_t primitives) {
  // Larger leaves than a pack become nodes of packs.
  const uint32_t packs = (primitives + kMaxLeafTriangles - 1) / kMaxLeafTriangles;
  return area * ((packs > 1 ? kNodeCost : 0.0f) + kLeafCost * static_cast<float>(packs) +
                 kTriangleCost * static_cast<float>(primitives));
}

class Planner {
 public:
  Planner(const bvh::Bvh2& tree, uint32_t width, WidePlan* plans)
      : tree_(tree), width_(width), plans_(plans) {
    plan(0, 0);
  }

 private:
  /// Subtrees below are planned by one thread.
  static constexpr uint32_t kSharedLevels = 8;
  static constexpr float kNever = std::numeric_limits<float>::infinity();

  /// As deep as the tree, whose depth is bounded.
  SubtreeCosts plan(uint32_t index, uint32_t depth) {
    const bvh::Node& node = tree_.nodes[index];
    WidePlan& p = plans_[index];
    const float area = half_area(node.box());
    if (node.is_leaf()) {
      p = {{}, static_cast<uint8_t>(std::min<uint32_t>(node.count, kTooMany)), 1, true};
      const Float4 cost = splat(leaf_cost(area, node.count));
      return {cost, cost};
    }
    SubtreeCosts left, right;
    const auto plan_left = [&] { left = plan(node.first, depth + 1); };
    const auto plan_right = [&] { right = plan(node.first + 1, depth + 1); };
    if (depth < kSharedLevels) {
      parallel_invoke(plan_left, plan_right);
    } else {
      plan_left();
      plan_right();
    }
    const WidePlan &on_left = plans_[node.first], &on_right = plans_[node.first + 1];
    p.primitives = static_cast<uint8_t>(
        std::min<uint32_t>(on_left.primitives + on_right.primitives, kTooMany));
    p.parts = static_cast<uint8_t>(std::min<uint32_t>(on_left.parts + on_right.parts, kMaxWidth));
    ShareLanes shares;
    const SubtreeCosts apart = distribute(left, right, on_left.parts, on_right.parts, shares);
    // One child: a node of its own, or a leaf.
    std::array<float, kMaxWidth> numbers;
    std::memcpy(numbers.data(), &apart, sizeof numbers);
    float one = numbers[width_ - 1] + area * kNodeCost;
    const uint8_t own_share = bytes_of(shares)[width_ - 1];
    p.is_leaf = false;
    if (p.primitives <= kMaxLeafTriangles) {
      const float as_leaf = leaf_cost(area, p.primitives);
      p.is_leaf = as_leaf <= one;
      one = std::min(one, as_leaf);
    }
    // Only one child can cost less than more of them do, so only that is compared.
    const Float4 as_one = splat(one);
    const SubtreeCosts costs{__builtin_shufflevector(as_one, min4(apart.few, as_one), 0, 5, 6, 7),
                             min4(apart.many, as_one)};
    const SubtreeCosts before = shifted(costs, as_one);
    shares.few &= Int4(apart.few < before.few);
    shares.many &= Int4(apart.many < before.many);
    p.left_share = bytes_of(shares);
    p.left_share[0] = own_share;
    return costs;
  }

  /// What two children and more cost, and how many of them best go to the left.
  static SubtreeCosts distribute(const SubtreeCosts& left, const SubtreeCosts& right,
                                 uint32_t left_parts, uint32_t right_parts, ShareLanes& shares) {
    const Float4 never = splat(kNever);
    const Int4 one{1, 1, 1, 1};
    shares = ShareLanes{one, one};
    // A binary leaf is one child whatever room there is, and the other side takes what is left.
    if (left_parts == 1 || right_parts == 1) {
      if (left_parts > 1) shares = ShareLanes{Int4{0, 1, 2, 3}, Int4{4, 5, 6, 7}};
      const SubtreeCosts rest = shifted(left_parts > 1 ? left : right, never);
      const Float4 leaf = left_parts > 1 ? right.few : left.few;
      return {rest.few + leaf, rest.many + leaf};
    }
    // All numbers of children at once, for one number that goes to the left after the other.
    std::array<float, kMaxWidth> lefts;
    std::memcpy(lefts.data(), &left, sizeof lefts);
    SubtreeCosts best{never, never}, rest = right;
    const uint32_t most = std::min(left_parts, kMaxWidth - 1);
    for (uint32_t k = 1; k <= most; ++k) {
      rest = shifted(rest, never);
      const Float4 own = splat(lefts[k - 1]);
      take(own + rest.few, k, best.few, shares.few);
      take(own + rest.many, k, best.many, shares.many);
    }
    return best;
  }

  static void take(Float4 cost, uint32_t share, Float4& best, Int4& shares) {
    const Int4 is_better = Int4(cost < best);
    best = min4(cost, best);
    const auto number = static_cast<int>(share);
    shares = (Int4{number, number, number, number} & is_better) | (shares & ~is_better);
  }

  static ChildShares bytes_of(const ShareLanes& shares) {
    ChildShares bytes;
#if defined(__SSE2__)
    const __m128i words = _mm_packs_epi32(__m128i(shares.few), __m128i(shares.many));
    const __m128i packed = _mm_packus_epi16(words, words);
    std::memcpy(bytes.data(), &packed, sizeof bytes);
#else
    for (int i = 0; i < 4; ++i) {
      bytes[i] = static_cast<uint8_t>(shares.few[i]);
      bytes[i + 4] = static_cast<uint8_t>(shares.many[i]);
    }
#endif
    return bytes;
  }

  const bvh::Bvh2& tree_;
  uint32_t width_;
  WidePlan* plans_;
};

}  // namespace

WidePlans::WidePlans(const bvh::Bvh2& tree, uint32_t width)
    : plans_(std::make_unique_for_overwrite<WidePlan[]>(tree.nodes.size())) {
  Planner(tree, width, plans_.get());
}

}  // namespace umbel
