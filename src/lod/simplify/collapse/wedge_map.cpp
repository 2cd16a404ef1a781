#include "lod/simplify/collapse/wedge_map.hpp"

#include <algorithm>
#include <limits>

namespace umbel::lod {

// Triangles at the edge say what their own vertices become. Where they do not agree, a seam ends
// here, and where a vertex has none of them, its side of a seam does not reach the target.
bool WedgeMap::find(uint32_t p, uint32_t target) {
  moves_.clear();
  const Vec3 d = mesh_.point(target) - mesh_.point(p);
  const bool protect = is_protected(p, target);
  const auto link = mesh_.link(p);
  for (size_t i = 0; i < link.size(); ++i) {
    const bool after = link[i].next == target;
    if (!after && link[i].prev != target) continue;
    const uint32_t c = mesh_.corner(p, i);
    const uint32_t from = mesh_.vertex(c);
    const uint32_t to = mesh_.vertex(after ? next_corner(c) : previous_corner(c));
    const auto same = std::find_if(moves_.begin(), moves_.end(),
                                   [&](const Move& move) { return move.from == from; });
    if (same == moves_.end()) {
      moves_.push_back({from, to, true});
    } else if (same->to != to) {
      if (protect) return false;
      same->along = false;
      if (!attributes_.is_empty() &&
          attributes_.cost(from, to, d) < attributes_.cost(from, same->to, d))
        same->to = to;
    }
  }
  if (!mesh_.has_wedges(p)) return true;
  for (size_t i = 0; i < link.size(); ++i) {
    const uint32_t from = mesh_.vertex(mesh_.corner(p, i));
    if (new_vertex(from) != kNone) continue;
    const uint32_t to = protect ? kNone : cheapest(from, target, d);
    if (to == kNone) return false;
    moves_.push_back({from, to, false});
  }
  return true;
}

bool WedgeMap::find_cheapest(uint32_t p, uint32_t target) {
  const bool is_single = !mesh_.has_wedges(p);
  if (!is_single && is_protected(p, target)) return false;
  const Vec3 d = mesh_.point(target) - mesh_.point(p);
  moves_.clear();
  for (size_t i = 0; i < mesh_.link(p).size(); ++i) {
    const uint32_t from = mesh_.vertex(mesh_.corner(p, i));
    if (new_vertex(from) != kNone) continue;
    const uint32_t to = mesh_.has_wedges() ? cheapest(from, target, d) : target;
    if (to == kNone) return false;
    moves_.push_back({from, to, is_single});
  }
  return true;
}

uint32_t WedgeMap::cheapest(uint32_t from, uint32_t target, const Vec3& d) const {
  uint32_t best = kNone, other = kNone;  // the last that was not
  float least = std::numeric_limits<float>::infinity();
  const size_t count = mesh_.link(target).size();
  for (size_t i = 0; i < count; ++i) {
    const uint32_t to = mesh_.vertex(mesh_.corner(target, i));
    if (to == best || to == other || !mesh_.same_material(from, to)) continue;
    const float cost = attributes_.is_empty() ? 0.0f : attributes_.cost(from, to, d);
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

float WedgeMap::cost(const Vec3& d) const {
  float sum = 0.0f;
  for (const Move& move : moves_)
    if (move.along || mesh_.rule(mesh_.input().position_of[move.from]) != SeamRule::kIgnore)
      sum += attributes_.cost(move.from, move.to, d);
  return sum;
}

}  // namespace umbel::lod
