// What the vertices at a position become when EdgeCollapser moves it.
#include <algorithm>
#include <limits>
#include <utility>

#include "lod/simplify/collapse/collapse.hpp"

namespace umbel::lod {

void EdgeCollapser::count_wedges() {
  std::fill(wedge_counts_.begin(), wedge_counts_.end(), uint8_t{0});
  wedge_seen_.assign(input_.position_of.size(), 0);
  for (const Triangle& t : triangles_)
    for (uint32_t v : t) {
      uint8_t& wedges = wedge_counts_[input_.position_of[v]];
      if (!std::exchange(wedge_seen_[v], 1) && wedges < 2) ++wedges;
    }
}

uint32_t EdgeCollapser::mapped(uint32_t vertex) const {
  for (const WedgeMove& move : wedge_map_)
    if (move.from == vertex) return move.to;
  return kNone;
}

// Triangles at the edge say what their own vertices become. Where they do not agree, a seam ends
// here, and where a vertex has none of them, its side of a seam does not reach the target.
bool EdgeCollapser::map_wedges(uint32_t p, uint32_t target) {
  wedge_map_.clear();
  const Vec3 d = point(target) - point(p);
  const bool protect = rule(p) == SeamRule::kProtect || rule(target) == SeamRule::kProtect;
  const auto link = ring(p);
  for (size_t i = 0; i < link.size(); ++i) {
    const bool after = link[i].next == target;
    if (!after && link[i].prev != target) continue;
    const uint32_t c = corner(p, i);
    const uint32_t from = vertex(c), to = vertex(after ? next(c) : prev(c));
    const auto same = std::find_if(wedge_map_.begin(), wedge_map_.end(),
                                   [&](const WedgeMove& move) { return move.from == from; });
    if (same == wedge_map_.end()) {
      wedge_map_.push_back({from, to, true});
    } else if (same->to != to) {
      if (protect) return false;
      same->along = false;
      if (attribute_count_ > 0 && attribute_cost(from, to, d) < attribute_cost(from, same->to, d))
        same->to = to;
    }
  }
  if (wedge_counts_[p] == 1) return true;
  for (size_t i = 0; i < link.size(); ++i) {
    const uint32_t from = vertex(corner(p, i));
    if (mapped(from) != kNone) continue;
    const uint32_t to = protect ? kNone : cheapest_wedge(from, target, d);
    if (to == kNone) return false;
    wedge_map_.push_back({from, to, false});
  }
  return true;
}

uint32_t EdgeCollapser::cheapest_wedge(uint32_t from, uint32_t target, const Vec3& d) const {
  uint32_t best = kNone, other = kNone;  // the last that was not
  float least = std::numeric_limits<float>::infinity();
  const size_t count = ring(target).size();
  for (size_t i = 0; i < count; ++i) {
    const uint32_t to = vertex(corner(target, i));
    if (to == best || to == other || !same_material(from, to)) continue;
    const float cost = attribute_count_ > 0 ? attribute_cost(from, to, d) : 0.0f;
    if (best != kNone && !(cost < least)) {
      other = to;
      continue;
    }
    other = best;
    best = to;
    least = cost;
  }
  return best;
}

// Of the moves in wedge_map_.
float EdgeCollapser::wedge_cost(const Vec3& d) const {
  float sum = 0.0f;
  for (const WedgeMove& move : wedge_map_)
    if (move.along || rule(input_.position_of[move.from]) != SeamRule::kIgnore)
      sum += attribute_cost(move.from, move.to, d);
  return sum;
}

}  // namespace umbel::lod
