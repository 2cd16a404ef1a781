// Which splits are legal and what missing items cost: the one cost model of all splitters.
#pragma once

#include <algorithm>
#include <cstdint>

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
  /// split is one of the last, which decides how many clusters there will be, and twice as much
  /// where the vertices will leave clusters less full.
  float underfill_cost(uint32_t n) const {
    const float cost = config.underfill_cost * (config.max_vertices ? 2.0f : 1.0f);
    return std::min(n <= 3 * uint64_t(config.max_items) ? 3.0f * cost : cost, 1.0f);
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
};

}  // namespace umbel::cluster
