// Which splits are legal and what missing items cost: the one cost model of all splitters.
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/simd/box4.hpp"
#include "umbel/cluster.hpp"

namespace umbel::cluster {

struct SplitConstraints {
  explicit SplitConstraints(const ClusterConfig& config)
      : config(config), simple(config.max_items - config.min_items >= config.min_items - 1) {}

  /// Whether n items can be cut into clusters that are all within [min_items, max_items].
  bool feasible(uint32_t n) const {
    if (simple) return n >= config.min_items;
    const uint64_t slack = config.max_items - config.min_items;
    return n % config.min_items <= slack * (n / config.min_items);
  }

  /// Items that n lack to fill all their clusters.
  uint32_t missing(uint32_t n) const {
    const uint32_t rest = n % config.max_items;
    return rest ? config.max_items - rest : 0;
  }

  /// What a missing item costs where a node of n items is split: three times as much where the
  /// split is one of the last, which decides how many clusters there will be. At most 1, so that
  /// weights grow with the number of items.
  float underfill_cost(uint32_t n) const {
    const float cost = cost_of_large_nodes();
    return std::min(n <= 3 * uint64_t(config.max_items) ? 3.0f * cost : cost, 1.0f);
  }

  /// The same in nodes that are not among the last. With a limit on vertices more, up to twice as
  /// much, as vertices leave clusters less full. Where that limit decides how many items a cluster
  /// has, what is missing are vertices too.
  float cost_of_large_nodes() const {
    const float cost = config.underfill_cost;
    if (!config.max_vertices) return cost;
    constexpr float kBend = 0.3f;
    const float more = cost <= kBend ? cost * 2.0f : 2.0f * kBend + (cost - kBend) * (4.0f / 7.0f);
    return few_vertices ? more + (1.0f - more) * config.vertex_underfill_cost : more;
  }

  /// What i items weigh in the surface area heuristic, at that cost.
  float weight(uint32_t i, float underfill_cost) const {
    return static_cast<float>(i) + underfill_cost * static_cast<float>(missing(i));
  }

  /// Whether n items may be split after the first i. Where n is not feasible itself, one side
  /// has to carry the undersized cluster; where it is, neither may.
  bool legal(uint32_t i, uint32_t n, bool n_is_feasible) const {
    if (!n_is_feasible) return feasible(i) || feasible(n - i);
    if (simple) return i >= config.min_items && n - i >= config.min_items;
    return feasible(i) && feasible(n - i);
  }
  bool legal(uint32_t i, uint32_t n) const { return legal(i, n, feasible(n)); }

  /// The legal split near i, of full clusters on the left where that is legal.
  uint32_t full_near(uint32_t i, uint32_t n) const {
    const uint64_t whole = (uint64_t(i) + config.max_items / 2) / config.max_items;
    const uint64_t full = std::max<uint64_t>(whole, 1) * config.max_items;
    if (full < n && legal(uint32_t(full), n)) return uint32_t(full);
    for (uint32_t d = 0; d < n; ++d) {
      if (i > d && i - d < n && legal(i - d, n)) return i - d;
      if (i < n - d && i + d > 0 && legal(i + d, n)) return i + d;
    }
    return n / 2;
  }
  uint32_t middle(uint32_t n) const { return full_near(n / 2, n); }

  ClusterConfig config;
  bool simple;  ///< every n >= min_items is feasible
  /// Clusters run out of vertices before they are full of items: max_items is about as many as they
  /// will have.
  bool few_vertices = false;
};

/// What the overlap of two sides costs at an overlap_cost of 1, where n items are split.
inline float overlap_weight(const Box4& left, const Box4& right, uint32_t n) {
  Box4 both = right;
  both.intersect(left);
  if (both.extent(0) < 0.0f || both.extent(1) < 0.0f || both.extent(2) < 0.0f) return 0.0f;
  return static_cast<float>(n) * both.half_area(Float4{});
}

/// What connections of this weight between i items and the other n - i cost, for a node of unit
/// area (ratio cut, scaled as bisect.hpp says).
inline float ratio_cut(float weight, uint32_t i, uint32_t n) {
  const float items = static_cast<float>(n);
  return weight * 0.25f * items * (items / static_cast<float>(i)) / static_cast<float>(n - i);
}

}  // namespace umbel::cluster
