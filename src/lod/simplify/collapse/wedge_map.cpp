#include "lod/simplify/collapse/wedge_map.hpp"

#include <algorithm>

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
      if (attributes_.is_empty()) continue;
      find_cost(*same, d);
      const float other = attributes_.cost(from, to, d);
      if (other < same->cost) same->to = to, same->cost = other;
    }
  }
  if (!mesh_.has_wedges(p)) return true;
  const size_t at_edge = moves_.size();
  const auto is_at_edge = [&](uint32_t from) {
    for (size_t i = 0; i < at_edge; ++i)
      if (moves_[i].from == from) return true;
    return false;
  };
  for (uint32_t from : mesh_.wedges(p)) {
    if (!mesh_.is_used(from) || is_at_edge(from)) continue;
    if (protect) return false;
    moves_.push_back(cheapest(from, target, d));
    if (moves_.back().to == kNone) return false;
  }
  return true;
}

bool WedgeMap::find_cheapest(uint32_t p, uint32_t target) {
  const bool is_single = !mesh_.has_wedges(p);
  if (!is_single && is_protected(p, target)) return false;
  const Vec3 d = mesh_.point(target) - mesh_.point(p);
  moves_.clear();
  if (!mesh_.has_wedges()) {
    moves_.push_back({p, target, true});
    return true;
  }
  for (uint32_t from : mesh_.wedges(p)) {
    if (!mesh_.is_used(from)) continue;
    moves_.push_back(cheapest(from, target, d));
    moves_.back().along = is_single;
    if (moves_.back().to == kNone) return false;
  }
  return true;
}

// Across a seam. It has nowhere to go where no vertex at the target has its material.
WedgeMap::Move WedgeMap::cheapest(uint32_t from, uint32_t target, const Vec3& d) const {
  Move best{from, kNone, false, 0.0f};
  const auto find = [&](const auto& cost_of) {
    for (uint32_t to : mesh_.wedges(target)) {
      if (!mesh_.is_used(to) || !mesh_.same_material(from, to)) continue;
      const float cost = cost_of(to);
      if (best.to == kNone || cost < best.cost) best.to = to, best.cost = cost;
    }
  };
  if (attributes_.is_empty())
    find([](uint32_t) { return 0.0f; });
  else
    find(AttributeQuadrics::MoveCosts(attributes_, from, d));
  return best;
}

float WedgeMap::cost(const Vec3& d) {
  float sum = 0.0f;
  for (Move& move : moves_) {
    if (!move.along && mesh_.rule(mesh_.input().position_of[move.from]) == SeamRule::kIgnore)
      continue;
    find_cost(move, d);
    sum += move.cost;
  }
  return sum;
}

void WedgeMap::merge(const Vec3& d, AttributeQuadrics& attributes) {
  for (Move& move : moves_) {
    find_cost(move, d);
    attributes.merge(move.from, move.to, d, move.cost);
  }
}

}  // namespace umbel::lod
