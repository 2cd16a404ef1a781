// Edge collapse by quadrics of one sub-mesh of a surface (Garland & Heckbert 1997; attributes by
// Hoppe 1999), cheapest first.
//
// A vertex moves onto a neighbour and takes its own triangles along; no new vertex is made. A
// collapse is done only if it keeps the surface a surface (the link condition of Dey et al. 1999;
// where that fails, a loop around a handle or a neck is drawn together: collapse_loop.cpp), turns
// no triangle over, and has for every vertex at the position one to become. All vertices at a
// position move together: along a seam each becomes the one on its own side, across it the one
// that costs least, as far as the rule of the seam allows; materials never mix.
// What a collapse changes is looked at again at once, so the order is greedy but for the width of
// a bucket of the queue.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "lod/dag/locked_edges.hpp"
#include "lod/dag/topology.hpp"
#include "lod/simplify/collapse/bucket_queue.hpp"
#include "lod/simplify/collapse/quadric.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// A sub-mesh with vertices and positions numbered from 0. Several vertices may be at one position;
/// no triangle has two corners at one.
struct CollapseInput {
  std::span<const Triangle> triangles;       ///< of vertices
  std::span<const uint32_t> position_of;     ///< of vertices
  std::span<const Vec3> positions;           ///< of vertices
  std::span<const float> attributes;         ///< attribute_count a vertex
  std::span<const float> attribute_weights;  ///< attribute_count; a difference of 1 counts as this
                                             ///< part of the root of the area that has it
  std::span<const uint8_t> locked;           ///< of positions: stays where it is
  std::span<const uint32_t> component;       ///< of positions, see topology.hpp
  bool locked_edges = true;                  ///< new edges between locked positions are legal
  const LockedEdgeSet* taken = nullptr;      ///< but for these
  std::span<const uint32_t> position_ids = {};  ///< of positions, as in `taken`
  std::span<const uint32_t> materials = {};     ///< of vertices; empty: one
  std::span<const SeamRule> rules = {};         ///< of positions; empty: SeamRule::kAllow
  /// Non-manifold positions move too, within their component. The result must be checked.
  bool non_manifold = true;
  /// Below so many triangles only what costs little more than what it took to get there.
  size_t limit_below = 0;
  /// And where that leaves more than so many, down to these whatever it costs.
  size_t unlimited_until = std::numeric_limits<size_t>::max();
  /// Separate parts that may be left out: of positions, which they are of; of parts, how far one is
  /// from the rest at most, infinite for those that stay. Empty: none may.
  std::span<const uint32_t> part_of = {};
  std::span<const float> part_radii = {};
  bool non_manifold_moves = false;  ///< regular positions move as non-manifold ones do
  bool allow_flips = false;         ///< triangles may turn over
};

/// Reusable; not thread-safe.
class EdgeCollapser {
 public:
  /// Collapses edges until at most `target` triangles are left or nothing can go. The
  /// triangles that are left keep their order.
  void run(const CollapseInput& input, size_t target);

  const std::vector<Triangle>& triangles() const { return result_; }
  /// The largest root of mean squared distance of one collapse from the planes it stands for, in
  /// the units of the positions.
  float error() const;
  /// Of the sub-mesh, the longest side of its box.
  float extent() const { return extent_; }
  double area() const { return area_; }
  /// The same of the attributes, as a length.
  float attribute_error() const;
  /// The largest radius of a part that was left out.
  float removed_radius() const { return removed_radius_; }
  /// Moves `values`, the attributes of a vertex that is left, to those that fit best to all that it
  /// stands for. False where that is not known to be better: it stands for itself alone, or
  /// others stand at its position, or the border of the sub-mesh does.
  bool refit(uint32_t vertex, std::span<float> values) const;
  /// What stands most in the way of the positions that are left.
  LimitingFactor limiting_factor();
  /// New edges between locked positions of different components.
  const std::vector<PositionPair>& locked_edges() const { return locked_edges_; }

 private:
  struct alignas(16) Point {
    float x, y, z, unused;
  };
  enum class Kind : uint8_t { kFixed, kInterior, kBorder, kNonManifold };
  // Of a position: a triangle there, by its other two positions in the triangle's order.
  struct LinkEdge {
    uint32_t next, prev;
  };
  // Rings have room for whole blocks of link.
  static constexpr uint32_t kBlock = 4;
  static uint32_t blocks(uint32_t count) { return (count + kBlock - 1) / kBlock * kBlock; }
  struct Ring {
    uint32_t offset, count;
  };
  struct Choice {
    float rank;  // order of collapses
    uint32_t target;
  };

  struct Move {
    float least;  // rank without attributes
    uint32_t target, corner;
    bool after;  // the target, at the corner
  };

  void load(const CollapseInput& input);
  void count_wedges();
  void build_rings();
  void find_kinds();
  Kind kind_of(uint32_t p);
  void build_quadrics();
  void add_planes(size_t first);
  static float scale_of(float weight);
  void settle_scale(uint32_t p);
  void add_boundary_quadrics(uint32_t p);
  void build_attribute_quadrics();
  void finish();

  Vec3 point(uint32_t p) const { return {points_[p].x, points_[p].y, points_[p].z}; }
  std::span<const LinkEdge> ring(uint32_t p) const {
    return {link_.data() + ring_of_[p].offset, ring_of_[p].count};
  }
  // The corner at p of its i-th triangle: 3 t + k is the k-th of triangle t.
  uint32_t corner(uint32_t p, size_t i) const { return corners_[ring_of_[p].offset + i]; }
  uint32_t& vertex(uint32_t c) { return triangles_.data()->data()[c]; }
  uint32_t vertex(uint32_t c) const { return triangles_.data()->data()[c]; }
  Triangle positions_of(const Triangle& t) const {
    if (!has_wedges_) return t;
    return {input_.position_of[t[0]], input_.position_of[t[1]], input_.position_of[t[2]]};
  }
  float* values_of(size_t v) { return &values_[v * stride_]; }
  const float* values_of(size_t v) const { return &values_[v * stride_]; }
  float* gradients_of(size_t v) { return &gradients_[4 * v * stride_]; }
  const float* gradients_of(size_t v) const { return &gradients_[4 * v * stride_]; }
  static uint32_t next(uint32_t c) { return c % 3 == 2 ? c - 2 : c + 1; }
  static uint32_t prev(uint32_t c) { return c % 3 == 0 ? c + 2 : c - 1; }
  uint32_t corner_before(uint32_t p, uint32_t q) const;

  float attribute_cost(uint32_t from, uint32_t to, const Vec3& d) const;
  Choice position_choice(uint32_t p, uint32_t target) const;
  Choice cheapest_position(uint32_t p) const;
  Choice choice(uint32_t p, const Move& move);
  Choice cheapest(uint32_t p);
  template <typename Visit>
  void for_each_target(uint32_t p, const Visit& visit) const;
  void enqueue_best(uint32_t p);
  void enqueue_best_legal(uint32_t p);
  void enqueue_postponed();
  void offer(uint32_t p, uint32_t target);
  void choose(uint32_t p, const Choice& choice);

  void load_parts();
  void enqueue_parts();
  uint32_t key_of_part(uint32_t part) const { return static_cast<uint32_t>(points_.size()) + part; }
  float rank_of_part(uint32_t part) const;
  void leave_out(uint32_t part, size_t target, float most_squared);
  LimitingFactor limiting_factor_at(uint32_t p);
  bool find_loop(uint32_t p, uint32_t target);
  bool add_to_loop(uint32_t p);
  bool is_in_loop(uint32_t p) const;
  bool complete_loop();
  void count_around(uint32_t from);
  bool keeps_orientation_in_loop(uint32_t p) const;
  bool map_loop_wedges(uint32_t p);
  void take_loop_wedges(size_t i);
  float rank_of_loop();
  void collapse_loop();
  bool is_legal(uint32_t p, uint32_t target);
  bool moves_non_manifold(uint32_t p) const {
    return input_.non_manifold_moves || kinds_[p] == Kind::kNonManifold;
  }
  void mark_neighbours(uint32_t p);
  void find_opposites(uint32_t p, uint32_t target);
  bool keeps_link(uint32_t p, uint32_t target);
  void list_neighbours(uint32_t p, uint32_t target);
  uint32_t list_all_neighbours(uint32_t p, uint32_t target);
  bool keeps_non_manifold_link(uint32_t p, uint32_t target);
  bool keeps_locked_edges(uint32_t target) const;
  bool keeps_orientation(uint32_t p, uint32_t target) const;
  // The cosine by which a triangle may turn in one collapse.
  static constexpr double kLeastCosine = 0.25;
  // Whether a triangle does, or becomes too thin to tell, as its corner moves.
  bool flips(const Vec3& from, const Vec3& to, const LinkEdge& s) const {
    const Vec3 n = point(s.next), side = point(s.prev) - n;
    const Vec3 before = cross(n - from, side), after = cross(n - to, side);
    const double turn = dot(before, after), size = double{dot(after, after)};
    const double old_size = double{dot(before, before)};
    if (!(size > 0.0)) return true;
    return old_size > 0.0 &&
           !(turn > 0.0 && turn * turn >= kLeastCosine * kLeastCosine * size * old_size);
  }
  bool map_wedges(uint32_t p, uint32_t target);
  uint32_t cheapest_wedge(uint32_t from, uint32_t target, const Vec3& d) const;
  uint32_t mapped(uint32_t vertex) const;
  bool same_material(uint32_t a, uint32_t b) const {
    return input_.materials.empty() || input_.materials[a] == input_.materials[b];
  }
  SeamRule rule(uint32_t p) const {
    return input_.rules.empty() ? SeamRule::kAllow : input_.rules[p];
  }
  float wedge_cost(const Vec3& d) const;
  void collapse(uint32_t p, uint32_t target);
  void move_ring(uint32_t p, uint32_t target);
  void make_room(uint32_t end);
  void rename(uint32_t at, uint32_t p, uint32_t target);
  void remove_folded(uint32_t at);
  void record_locked_edges(uint32_t target);
  float cost_of(uint32_t p, uint32_t target) const;
  void merge_quadrics(uint32_t p, uint32_t target);
  void merge_attributes(uint32_t from, uint32_t to, const Vec3& d);

  CollapseInput input_;
  bool has_wedges_ = false;
  uint32_t attribute_count_ = 0;
  float extent_ = 0.0f;                           // of the sub-mesh
  float area_unit_ = 1.0f;                        // scales areas of a sub-mesh of any extent alike
  double area_ = 0.0;                             // of the sub-mesh
  size_t live_ = 0;                               // triangles
  float worst_ = 0.0f, worst_attributes_ = 0.0f;  // squared distances

  std::vector<Point> points_;        // of positions
  std::vector<Triangle> triangles_;  // of vertices
  std::vector<uint8_t> dead_;        // triangles
  std::vector<Ring> ring_of_;        // of positions
  std::vector<LinkEdge> link_;       // merged rings are appended
  std::vector<uint32_t> corners_;    // of link_
  uint32_t link_end_ = 0;            // how many of link_ are used
  std::vector<Kind> kinds_;
  std::vector<uint8_t> wedge_counts_;        // vertices at a position, at most 2 counted
  std::vector<Quadric> quadrics_;            // of positions; scale: from cost to rank
  std::vector<Quadric> attribute_quadrics_;  // of vertices
  uint32_t stride_ = 0;                      // attribute_count_ in whole blocks of 4
  std::vector<float> gradients_;  // of vertices: stride_ each by x, y, z, and for the mean
  std::vector<float> values_;     // of vertices: weighted attributes, stride_ each
  std::vector<float> drifts_;     // of positions: how far vertices that ended there have moved
  std::vector<Choice> choices_;
  enum class State : uint8_t { kCurrent, kStale, kLoop };
  std::vector<State> states_;    // of choices: to be made anew, or to draw a loop together
  std::vector<uint32_t> marks_;  // of positions
  std::vector<uint32_t> slots_;  // of positions: index in a ring
  std::vector<uint8_t> wedge_seen_;
  std::vector<Move> moves_;
  std::vector<Choice> candidates_;
  std::vector<uint32_t> postponed_;  // too dear as yet
  std::vector<float> part_areas_;
  std::vector<uint32_t> part_live_;                      // of parts: triangles when last counted
  std::vector<uint32_t> part_offsets_, part_triangles_;  // of parts: their triangles
  float removed_radius_ = 0.0f;
  uint32_t stamp_ = 0;
  BucketQueue queue_;

  // Of the collapse being looked at.
  struct WedgeMove {
    uint32_t from, to;
    bool along;  // a seam, or on the smooth surface
  };
  std::vector<WedgeMove> wedge_map_;
  struct LoopNeighbour {
    uint32_t position, from, triangles;  // those that stay
    bool several, at_target;             // of the loop's positions
  };
  std::vector<uint32_t> loop_;  // where it is drawn together, and what goes there
  std::vector<LoopNeighbour> around_loop_;
  std::vector<WedgeMove> loop_moves_;  // for each that goes there those up to its end
  std::vector<size_t> loop_ends_;
  std::vector<uint32_t> neighbour_room_;
  std::span<const uint32_t>
      neighbours_;        // of p but for the target, third corners at the edge first
  size_t opposites_ = 0;  // how many those are
  std::pair<uint32_t, uint32_t> opposite_{kNone, kNone};  // of a regular position, the same if one
  bool has_loop_ = false;  // the link fails as others than those are neighbours of both ends
  std::vector<Triangle> result_;
  std::vector<PositionPair> locked_edges_;
};

// Calls visit(corner at p, target, whether the target comes after p there) for the neighbours
// that p may move to: all from the interior, along the border from there.
template <typename Visit>
void EdgeCollapser::for_each_target(uint32_t p, const Visit& visit) const {
  const auto link = ring(p);
  const auto is_in = [&](uint32_t x, uint32_t LinkEdge::* side) {
    return std::any_of(link.begin(), link.end(), [&](const LinkEdge& s) { return s.*side == x; });
  };
  for (size_t i = 0; i < link.size(); ++i) {
    const auto [n, q] = link[i];
    if (kinds_[p] == Kind::kInterior) {
      visit(corner(p, i), n, true);
    } else if (kinds_[p] == Kind::kNonManifold) {
      visit(corner(p, i), n, true);
      if (!is_in(q, &LinkEdge::next)) visit(corner(p, i), q, false);
    } else {
      if (!is_in(n, &LinkEdge::prev)) visit(corner(p, i), n, true);
      if (!is_in(q, &LinkEdge::next)) visit(corner(p, i), q, false);
    }
  }
}

}  // namespace umbel::lod
