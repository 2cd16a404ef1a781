// What the vertices at a position become when it moves: its wedges (Hoppe 1999), one a side of each
// seam.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "lod/simplify/collapse/attribute_quadrics.hpp"
#include "lod/simplify/collapse/collapse_mesh.hpp"

namespace umbel::lod {

class WedgeMap {
 public:
  struct Move {
    uint32_t from, to;
    bool along;          ///< along a seam, or on the smooth surface; else across a seam
    float cost = -1.0f;  ///< of its attributes; negative: not known yet
  };

  WedgeMap(const CollapseMesh& mesh, const AttributeQuadrics& attributes)
      : mesh_(mesh), attributes_(attributes) {}

  /// As p moves onto its neighbour. False where a seam that is protected forbids it, or no vertex
  /// there has the same material.
  bool find(uint32_t p, uint32_t target);
  /// What the attributes of an interior p cost as it moves onto its neighbour, which comes after it
  /// at `corner` and before it at `other`; infinite where `find` is false, and some part of it once
  /// `is_too_high(part)`. The map is not changed.
  template <typename IsTooHigh>
  float cost_of(uint32_t p, uint32_t target, uint32_t corner, uint32_t other,
                const IsTooHigh& is_too_high) const;
  /// As p moves there with a loop: each becomes the vertex of its material that costs least.
  bool find_cheapest(uint32_t p, uint32_t target);
  void set(std::span<const Move> moves) { moves_.assign(moves.begin(), moves.end()); }

  std::span<const Move> moves() const { return moves_; }
  /// kNone: the vertex is not in the map.
  uint32_t new_vertex(uint32_t vertex) const {
    for (const Move& move : moves_)
      if (move.from == vertex) return move.to;
    return kNone;
  }
  /// Of all moves, `d` being the way.
  float cost(const Vec3& d);
  /// Adds the attributes' quadrics of what moves to those of what it becomes.
  void merge(const Vec3& d, AttributeQuadrics& attributes);

 private:
  bool is_protected(uint32_t p, uint32_t target) const {
    return mesh_.rule(p) == SeamRule::kProtect || mesh_.rule(target) == SeamRule::kProtect;
  }
  Move cheapest(uint32_t from, uint32_t target, const Vec3& d) const;
  void find_cost(Move& move, const Vec3& d) const {
    if (move.cost < 0.0f) move.cost = attributes_.cost(move.from, move.to, d);
  }

  const CollapseMesh& mesh_;
  const AttributeQuadrics& attributes_;
  std::vector<Move> moves_;
};

template <typename IsTooHigh>
float WedgeMap::cost_of(uint32_t p, uint32_t target, uint32_t corner, uint32_t other,
                        const IsTooHigh& is_too_high) const {
  constexpr float kNever = std::numeric_limits<float>::infinity();
  const Vec3 d = mesh_.point(target) - mesh_.point(p);
  const bool protect = is_protected(p, target);
  const bool across_is_free = mesh_.rule(p) == SeamRule::kIgnore;
  const uint32_t from = mesh_.vertex(corner), to = mesh_.vertex(next_corner(corner));
  const uint32_t second = mesh_.vertex(other), second_to = mesh_.vertex(previous_corner(other));
  float sum = 0.0f;
  if (from == second && to != second_to) {
    if (protect) return kNever;
    if (!across_is_free)
      sum = std::min(attributes_.cost(from, to, d), attributes_.cost(from, second_to, d));
  } else {
    sum = attributes_.cost(from, to, d);
    if (from != second && !is_too_high(sum)) sum += attributes_.cost(second, second_to, d);
  }
  for (uint32_t wedge : mesh_.wedges(p)) {
    if (wedge == from || wedge == second || !mesh_.is_used(wedge)) continue;
    if (protect || is_too_high(sum)) return kNever;
    const Move move = cheapest(wedge, target, d);
    if (move.to == kNone) return kNever;
    if (!across_is_free) sum += move.cost;
  }
  return sum;
}

}  // namespace umbel::lod
