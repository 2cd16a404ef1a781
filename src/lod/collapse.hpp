// Edge collapse by quadrics of one piece of a surface (Garland & Heckbert 1997; attributes by
// Hoppe 1999), cheapest first.
//
// A vertex moves onto a neighbour and takes its own triangles along; no new vertex is made. A
// collapse is done only if it keeps the surface a surface (the link condition of Dey et al. 1999),
// turns no triangle over, and has for every vertex at the position exactly one to become, so
// that seams of attributes and borders of materials shorten along themselves and never fray.
// What a collapse changes is looked at again at once, so the order is greedy but for the width of
// a bucket of the queue.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "lod/bucket_queue.hpp"
#include "lod/topology.hpp"
#include "umbel/types.hpp"

namespace umbel::lod {

/// A piece with vertices and positions numbered from 0. Several vertices may be at one position;
/// no triangle has two corners at one.
struct CollapseInput {
  std::span<const Triangle> triangles;       ///< of vertices
  std::span<const uint32_t> position_of;     ///< of vertices
  std::span<const Vec3> positions;           ///< of vertices
  std::span<const float> attributes;         ///< attribute_count a vertex
  std::span<const float> attribute_weights;  ///< attribute_count; a difference of 1 counts as this
                                             ///< part of the piece's extent
  std::span<const uint8_t> locked;           ///< of positions: stays where it is
  std::span<const uint32_t> component;       ///< of positions, see topology.hpp
  bool chords = true;                        ///< new edges between locked positions are legal
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
  /// New edges between locked positions of different components.
  const std::vector<PositionPair>& chords() const { return chords_; }

 private:
  // v A v + 2 b v + c of the vector v from the position or vertex that it belongs to, which keeps
  // its precision where positions are large.
  struct Quadric {
    float xx, yy, zz, xy, xz, yz;
    float x, y, z;
    float c;
    float weight;
    float unused;  // 48 bytes
  };
  enum class Kind : uint8_t { kFixed, kInterior, kBorder };
  struct Ring {
    uint32_t offset, count;
  };
  struct Choice {
    float rank;  // order of collapses; see settle_scale
    float cost;  // squared distance times weight
    uint32_t target;
  };

  void load(const CollapseInput& input);
  void build_rings();
  void find_kinds();
  Kind kind_of(uint32_t p);
  void build_quadrics();
  void settle_scale(uint32_t p);
  void note_error(uint32_t p, const Choice& choice);
  void add_rim_quadrics(uint32_t p);
  void build_attribute_quadrics();

  std::span<const uint32_t> ring(uint32_t p) const {
    return {rings_.data() + ring_of_[p].offset, ring_of_[p].count};
  }
  // Of corners; without wedges vertices and positions are the same.
  const std::vector<uint32_t>& vertices() const {
    return has_wedges_ ? corner_vertex_ : corner_position_;
  }
  uint32_t corner_before(uint32_t p, uint32_t q) const;
  float attribute_cost(uint32_t from, uint32_t to, const Vec3& d) const;
  Choice position_cost(uint32_t p, uint32_t target) const;
  Choice cost(uint32_t p, uint32_t corner, uint32_t target, bool after) const;
  template <typename Visit>
  void for_each_target(uint32_t p, const Visit& visit) const;
  void enqueue_best(uint32_t p);
  void enqueue_best_legal(uint32_t p);
  void offer(uint32_t p, uint32_t target);
  void choose(uint32_t p, const Choice& choice);

  bool is_legal(uint32_t p, uint32_t target);
  bool keeps_link(uint32_t p, uint32_t target);
  bool keeps_facing(uint32_t p, uint32_t target) const;
  bool map_wedges(uint32_t p, uint32_t target);
  void collapse(uint32_t p, uint32_t target);
  void note_chords(uint32_t target);
  void remove_corner(uint32_t p, uint32_t triangle);
  void merge_quadrics(uint32_t p, uint32_t target);

  // Corner 4 t + k is the k-th of triangle t.
  static uint32_t next(uint32_t c) { return (c & 3) == 2 ? c - 2 : c + 1; }
  static uint32_t prev(uint32_t c) { return (c & 3) == 0 ? c + 2 : c - 1; }

  CollapseInput input_;
  bool has_wedges_ = false;
  uint32_t attribute_count_ = 0;
  size_t live_ = 0;     // triangles
  float worst_ = 0.0f;  // squared distance

  std::vector<Vec3> points_;               // of positions
  std::vector<uint32_t> corner_position_;  // 4 a triangle
  std::vector<uint32_t> corner_vertex_;    // 4 a triangle
  std::vector<uint8_t> dead_;              // triangles
  std::vector<Ring> ring_of_;              // of positions
  std::vector<uint32_t> rings_;            // corners; merged rings are appended
  std::vector<Kind> kinds_;
  std::vector<uint8_t> wedge_counts_;        // vertices at a position, at most 3 counted
  std::vector<Quadric> quadrics_;            // of positions
  std::vector<Quadric> attribute_quadrics_;  // of vertices
  std::vector<float> gradients_;             // of vertices: 4 an attribute
  std::vector<float> values_;                // of vertices: weighted attributes
  std::vector<float> scales_;                // of positions: from cost to rank
  std::vector<float> drifts_;  // of positions: how far vertices that ended there have moved
  std::vector<Choice> choices_;
  std::vector<uint8_t> stale_;   // of positions: the choice is to be made anew
  std::vector<uint32_t> marks_;  // of positions
  std::vector<uint32_t> slots_;  // of positions: corners
  std::vector<uint8_t> wedge_seen_;
  std::vector<Choice> candidates_;
  uint32_t stamp_ = 0;
  BucketQueue queue_;

  // Of the collapse being looked at.
  std::array<std::pair<uint32_t, uint32_t>, 2> wedge_map_;
  uint32_t wedge_map_count_ = 0;
  std::vector<uint32_t> neighbours_;

  std::vector<Triangle> result_;
  std::vector<PositionPair> chords_;
};

}  // namespace umbel::lod
