// What collapses cost, by quadrics (Garland & Heckbert 1997), and what they have cost so far.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "lod/simplify/collapse/attribute_quadrics.hpp"
#include "lod/simplify/collapse/collapse_mesh.hpp"
#include "lod/simplify/collapse/quadric.hpp"
#include "lod/simplify/collapse/wedge_map.hpp"

namespace umbel::lod {

class CollapseCosts {
 public:
  /// Where the surface is flat, all collapses cost nothing: short edges go first.
  static constexpr float kShape = 1e-4f;

  struct Choice {
    float rank;  ///< order of collapses
    uint32_t target;
  };
  /// To the target, which comes after the position at `corner`, or before it.
  struct Move {
    float rank;  ///< without attributes
    uint32_t target, corner;
    bool after;
  };

  CollapseCosts(const CollapseMesh& mesh, AttributeQuadrics& attributes, WedgeMap& wedges)
      : mesh_(mesh), attributes_(attributes), wedges_(wedges) {}

  /// Whenever the mesh has been loaded.
  void build();

  /// Of all positions that p may move to. The target is kNone where there is none.
  Choice cheapest(uint32_t p);
  /// Without attributes.
  float rank_of_position(uint32_t p, uint32_t target) const;
  /// With attributes; infinite where some vertex has none to become.
  Choice choice(uint32_t p, const Move& move);
  /// What the moves in the wedge map add to the rank of p.
  float rank_of_wedges(uint32_t p, uint32_t target) {
    if (attributes_.is_empty()) return 0.0f;
    return wedges_.cost(mesh_.point(target) - mesh_.point(p)) * quadrics_[p].weight *
           quadrics_[p].scale;
  }
  /// Of a move whose vertices' moves are in the wedge map.
  float rank(uint32_t p, uint32_t target) {
    return rank_of_position(p, target) + rank_of_wedges(p, target);
  }
  /// Turns a sum of weighted squared distances into a rank, by the sum of weights: between the
  /// integral of the squared distance, which keeps means low but lets small details move any
  /// distance, and its mean, which keeps the largest distance low.
  static float scale_of(float weight);

  /// The squared distance that a collapse adds to the error.
  float squared_error(uint32_t p, uint32_t target) const;
  /// The same of the attributes, however little the vertices move. The wedge map holds what the
  /// vertices of p become.
  float squared_attribute_error(uint32_t p, uint32_t target);
  /// Adds p's quadrics to the target's, and what the collapse costs to the errors. The wedge map
  /// holds what the vertices of p become.
  void merge(uint32_t p, uint32_t target);
  /// Whether any other position has been moved to this one.
  bool stands_for_others(uint32_t p) const { return displacements_[p] != 0.0f; }

  float largest_squared_error() const { return largest_; }
  float largest_squared_attribute_error() const { return largest_of_attributes_; }
  /// Of collapses whose vertices moved less, too.
  float largest_attribute_loss() const { return largest_attribute_loss_; }
  double area() const { return area_; }

 private:
  using LinkEdge = CollapseMesh::LinkEdge;

  void add_planes(size_t first);
  void add_boundary_quadrics(uint32_t p);
  void find_slots(uint32_t p);
  bool is_before(uint32_t p, uint32_t x) const {
    const auto link = mesh_.link(p);
    return slots_[x] < link.size() && link[slots_[x]].prev == x;
  }
  bool is_next(uint32_t p, uint32_t x) const {
    const auto link = mesh_.link(p);
    return next_slots_[x] < link.size() && link[next_slots_[x]].next == x;
  }
  void list_moves(uint32_t p);
  Move* room_for_moves(size_t most);
  void keep_cheapest_moves(size_t wedges);
  Choice cheapest_position(uint32_t p) const;
  Choice cheapest_with_attributes(uint32_t p);
  Choice cheapest_of_moves(uint32_t p);
  Choice cheapest_of_wedges(uint32_t p);
  Choice cheapest_of_smooth_moves(uint32_t p) const;

  const CollapseMesh& mesh_;
  AttributeQuadrics& attributes_;
  WedgeMap& wedges_;
  std::vector<Quadric> quadrics_;     // of positions; scale: from cost to rank
  std::vector<float> displacements_;  // of positions: how far vertices that ended there have moved
  std::vector<Move> room_;
  std::span<Move> moves_;  // in room_, of the last position
  // Of positions around the last one: where they come before it and after it. Stale elsewhere.
  std::vector<uint32_t> slots_, next_slots_;
  double area_ = 0.0;
  float largest_ = 0.0f, largest_of_attributes_ = 0.0f;  // squared distances
  float largest_attribute_loss_ = 0.0f;
};

inline float CollapseCosts::rank_of_position(uint32_t p, uint32_t target) const {
  const Vec3 d = mesh_.point(target) - mesh_.point(p);
  const Quadric& q = quadrics_[p];
  const float sum = std::max(value_at(q, d), 0.0f);
  return (sum + kShape * q.weight * dot(d, d)) * q.scale;
}

// A point of the surface moves no farther than the vertices of its triangle.
inline float CollapseCosts::squared_error(uint32_t p, uint32_t target) const {
  const Vec3 d = mesh_.point(target) - mesh_.point(p);
  const float moved = displacements_[p] + length(d), weight = quadrics_[p].weight;
  if (!(weight > 0.0f)) return 0.0f;
  return std::min(std::max(value_at(quadrics_[p], d), 0.0f) / weight, moved * moved);
}

}  // namespace umbel::lod
