// The one-ring of each position: the triangles around it.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::lod {

/// Rings lie in one array, in whole blocks; a ring that grows is appended.
class OneRings {
 public:
  /// A triangle around a position, by its edge opposite to the position (an edge of the position's
  /// link), in the triangle's order.
  struct LinkEdge {
    uint32_t next, prev;
  };

  /// Of triangles [0, triangles); positions_of(t) are the positions of one, below `positions`.
  template <typename PositionsOf>
  void build(size_t positions, size_t triangles, const PositionsOf& positions_of);

  uint32_t size(uint32_t p) const { return rings_[p].count; }
  std::span<const LinkEdge> link(uint32_t p) const {
    return {edges_.data() + rings_[p].offset, rings_[p].count};
  }
  /// The corner at p of its i-th triangle: 3 t + k is the k-th of triangle t.
  uint32_t corner(uint32_t p, size_t i) const { return corners_[rings_[p].offset + i]; }

  void clear(uint32_t p) { rings_[p].count = 0; }

  /// Moves p onto the target. Triangles at the edge between them go: calls removed(corner at p).
  /// The others become the target's: calls moved(corner). `neighbours` are all of p except for
  /// the target, the first `opposites` of which are the third corners of the triangles that go.
  template <typename Removed, typename Moved>
  void collapse(uint32_t p, uint32_t target, std::span<const uint32_t> neighbours, size_t opposites,
                const Removed& removed, const Moved& moved);

 private:
  static constexpr uint32_t kBlock = 4;
  static uint32_t blocks(uint32_t count) { return (count + kBlock - 1) / kBlock * kBlock; }
  struct Ring {
    uint32_t offset, count;
  };

  void make_room(uint32_t end);
  void rename(uint32_t at, uint32_t p, uint32_t target);
  void remove_folded(uint32_t at);

  std::vector<Ring> rings_;  // of positions
  std::vector<LinkEdge> edges_;
  std::vector<uint32_t> corners_;  // of edges_
  uint32_t end_ = 0;               // how many of edges_ are used
};

template <typename PositionsOf>
void OneRings::build(size_t positions, size_t triangles, const PositionsOf& positions_of) {
  rings_.assign(positions, {0, 0});
  for (size_t t = 0; t < triangles; ++t)
    for (uint32_t p : positions_of(t)) ++rings_[p].count;
  uint32_t offset = 0;
  for (Ring& r : rings_) {
    r.offset = offset;
    offset += blocks(std::exchange(r.count, 0));
  }
  end_ = offset;
  if (edges_.size() <= offset) make_room(offset + offset / 2);
  const auto add = [&](uint32_t p, uint32_t n, uint32_t q, uint32_t corner) {
    Ring& r = rings_[p];
    const uint32_t slot = r.offset + r.count++;
    edges_[slot] = {n, q};
    corners_[slot] = corner;
  };
  for (uint32_t t = 0; t < triangles; ++t) {
    const auto [a, b, c] = positions_of(t);
    add(a, b, c, 3 * t);
    add(b, c, a, 3 * t + 1);
    add(c, a, b, 3 * t + 2);
  }
}

template <typename Removed, typename Moved>
void OneRings::collapse(uint32_t p, uint32_t target, std::span<const uint32_t> neighbours,
                        size_t opposites, const Removed& removed, const Moved& moved) {
  const Ring old = rings_[p], kept = rings_[target];
  const uint32_t offset = end_;
  make_room(offset + blocks(old.count + kept.count));
  LinkEdge* const edges = edges_.data();
  uint32_t* const corners = corners_.data();
  uint32_t end = offset;
  for (uint32_t i = old.offset; i < old.offset + old.count; ++i) {
    const LinkEdge e = edges[i];
    const uint32_t c = corners[i];
    if (e.next == target || e.prev == target) {
      removed(c);
      continue;
    }
    moved(c);
    edges[end] = e;
    corners[end++] = c;
  }
  for (uint32_t i = kept.offset; i < kept.offset + kept.count; ++i) {
    const LinkEdge e = edges[i];
    edges[end] = e;
    corners[end] = corners[i];
    end += e.next != p && e.prev != p;
  }
  rings_[p].count = 0;
  rings_[target] = {offset, end - offset};
  end_ = offset + blocks(end - offset);
  for (uint32_t x : neighbours) rename(x, p, target);
  for (size_t i = 0; i < opposites; ++i) remove_folded(neighbours[i]);
}

// For edges up to `end`, and one more.
inline void OneRings::make_room(uint32_t end) {
  if (end < edges_.size()) return;
  edges_.resize(2 * size_t{end} + 1);
  corners_.resize(edges_.size());
}

// In the ring of a neighbour, whole blocks at a time: what is behind the ring's end does not count.
inline void OneRings::rename(uint32_t at, uint32_t p, uint32_t target) {
  typedef uint32_t Word4 __attribute__((vector_size(16)));
  const Ring r = rings_[at];
  uint32_t* const words = &edges_[r.offset].next;
  const Word4 from{p, p, p, p}, to{target, target, target, target};
  for (uint32_t i = 0; i < 2 * r.count; i += 2 * kBlock)
    for (uint32_t k = i; k < i + 2 * kBlock; k += 4) {
      Word4 word;
      memcpy(&word, words + k, sizeof word);
      const Word4 is_p = word == from;
      word = (word & ~is_p) | (to & is_p);
      memcpy(words + k, &word, sizeof word);
    }
}

// From the ring of a third corner at the edge.
inline void OneRings::remove_folded(uint32_t at) {
  Ring& r = rings_[at];
  for (uint32_t i = r.offset; i < r.offset + r.count;) {
    if (edges_[i].next != edges_[i].prev) {
      ++i;
      continue;
    }
    const uint32_t last = r.offset + --r.count;
    edges_[i] = edges_[last];
    corners_[i] = corners_[last];
  }
}

}  // namespace umbel::lod
