// Which edges of a mesh are irregular, by position, and whether a simplified piece brought new
// ones. An edge is regular if two triangles share it, and run along it in opposite directions.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::lod {

using PositionPair = std::pair<uint32_t, uint32_t>;

/// For each position (index of `position_ids`) the component of the graph of irregular edges, or
/// kNone for a position that touches none.
/// Degenerate triangles (two corners at one position) are left out.
std::vector<uint32_t> irregular_components(std::span<const Triangle> triangles,
                                           std::span<const uint32_t> position_ids);

/// The same from the directed edges of all triangles, or at least all edges of those that share
/// one that may be irregular; `count` positions.
std::vector<uint32_t> irregular_components(std::span<const PositionPair> edges, size_t count);

/// Compares a piece of a surface before and after simplification. Edge collapse is a simplicial
/// map, so it keeps the boundary of the piece modulo 2; what it may do wrong is to close a loop
/// of three edges that bounds no triangle, after which four triangles share an edge (the link
/// condition of Dey et al. 1999), and to lay a *chord*, a new edge between two vertices of the
/// piece's border, where a neighbouring piece may have or lay one too (locked_edges.hpp). Reusable;
/// not thread-safe.
class PieceTopology {
 public:
  /// Positions of the piece are numbered 0..; `locked[p]` says that a neighbour has p too, and
  /// `component[p]` is that of irregular_components.
  void set_piece(std::span<const Triangle> triangles, std::span<const uint8_t> locked,
                 std::span<const uint32_t> component);

  /// The edges of `result` that neither the rule of two triangles nor the source explains, in a
  /// fixed order. Empty: the result can take the piece's place in every cut, provided that nobody
  /// else has its chords. Those that `may_add(a, b)` says are legal are collected, others count as
  /// violations.
  template <typename MayAdd>
  std::span<const PositionPair> violations(std::span<const Triangle> result,
                                           const MayAdd& may_add) {
    count_edges(result);
    std::erase_if(chords_, [&](const PositionPair& chord) {
      if (may_add(chord.first, chord.second)) return false;
      violations_.push_back(chord);
      return true;
    });
    return violations_;
  }

  /// Of the last result that was looked at.
  std::span<const PositionPair> chords() const { return chords_; }
  /// The edges of the piece itself between two locked vertices, each as often as a triangle has it.
  std::span<const PositionPair> fixed_edges() const { return fixed_edges_; }

 private:
  struct Entry {
    uint64_t key;
    uint32_t before, after;
  };
  Entry& entry(uint32_t a, uint32_t b);
  void reset(size_t edges);
  void count_edges(std::span<const Triangle> result);

  std::vector<Entry> table_;
  std::vector<uint32_t> used_;
  uint64_t mask_ = 0;
  std::vector<PositionPair> fixed_edges_;
  std::span<const uint8_t> locked_;
  std::span<const uint32_t> component_;
  std::vector<PositionPair> violations_, chords_;
};

}  // namespace umbel::lod
