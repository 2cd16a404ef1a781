// Why EdgeCollapser went no further: what stands in the way of the positions that are left.
#include <algorithm>
#include <array>

#include "lod/simplify/collapse/collapse.hpp"

namespace umbel::lod {

Reason EdgeCollapser::hindrance() {
  std::array<size_t, kReasons> counts{};
  for (uint32_t p = 0; p < points_.size(); ++p)
    if (ring_of_[p].count > 0) ++counts[static_cast<size_t>(hindrance_at(p))];
  return static_cast<Reason>(std::max_element(counts.begin(), counts.end()) - counts.begin());
}

// Of the moves of a position, the one that fails at the last of the tests says why.
Reason EdgeCollapser::hindrance_at(uint32_t p) {
  if (input_.locked[p]) return Reason::kLocked;
  if (kinds_[p] == Kind::kFixed) return Reason::kIrregular;
  constexpr std::array kTests = {Reason::kTopology, Reason::kTurning, Reason::kSeams,
                                 Reason::kPrice};
  size_t passed = 0;
  mark_neighbours(p);
  for_each_target(p, [&](uint32_t, uint32_t target, bool) {
    size_t passes = 0;
    if (moves_loosely(p) ? keeps_irregular_link(p, target) : keeps_link(p, target)) {
      passes = 1;
      if (input_.any_turn || keeps_facing(p, target)) passes = 2;
      if (passes == 2 && (!has_wedges_ || map_wedges(p, target))) passes = 3;
    }
    passed = std::max(passed, passes);
  });
  return kTests[passed];
}

}  // namespace umbel::lod
