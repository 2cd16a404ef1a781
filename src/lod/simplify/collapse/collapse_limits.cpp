// Why EdgeCollapser went no further: what stands in the way of the positions that are left.
#include <algorithm>
#include <array>

#include "lod/simplify/collapse/collapse.hpp"

namespace umbel::lod {

LimitingFactor EdgeCollapser::limiting_factor() {
  std::array<size_t, kLimitingFactors> counts{};
  for (uint32_t p = 0; p < points_.size(); ++p)
    if (ring_of_[p].count > 0) ++counts[static_cast<size_t>(limiting_factor_at(p))];
  return static_cast<LimitingFactor>(std::max_element(counts.begin(), counts.end()) -
                                     counts.begin());
}

// Of the moves of a position, the one that fails at the last of the tests says why.
LimitingFactor EdgeCollapser::limiting_factor_at(uint32_t p) {
  if (input_.locked[p]) return LimitingFactor::kLocked;
  if (kinds_[p] == Kind::kFixed) return LimitingFactor::kNonManifold;
  constexpr std::array kTests = {LimitingFactor::kTopology, LimitingFactor::kFlip,
                                 LimitingFactor::kSeams, LimitingFactor::kCost};
  size_t passed = 0;
  mark_neighbours(p);
  for_each_target(p, [&](uint32_t, uint32_t target, bool) {
    size_t passes = 0;
    if (moves_non_manifold(p) ? keeps_non_manifold_link(p, target) : keeps_link(p, target)) {
      passes = 1;
      if (input_.allow_flips || keeps_orientation(p, target)) passes = 2;
      if (passes == 2 && (!has_wedges_ || map_wedges(p, target))) passes = 3;
    }
    passed = std::max(passed, passes);
  });
  return kTests[passed];
}

}  // namespace umbel::lod
