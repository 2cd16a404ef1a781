// The mesh that edges are collapsed in.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "base/math.hpp"
#include "lod/simplify/collapse/collapse_input.hpp"
#include "lod/simplify/collapse/one_rings.hpp"

namespace umbel::lod {

// Of corners: 3 t + k is the k-th of triangle t.
inline uint32_t next_corner(uint32_t c) { return c % 3 == 2 ? c - 2 : c + 1; }
inline uint32_t previous_corner(uint32_t c) { return c % 3 == 0 ? c + 2 : c - 1; }

/// Triangles of vertices, and the one-ring of each position.
class CollapseMesh {
 public:
  using LinkEdge = OneRings::LinkEdge;
  /// Of a position. Interior: its triangles form one closed fan. Border: one open fan.
  enum class Kind : uint8_t { kFixed, kInterior, kBorder, kNonManifold };

  void load(const CollapseInput& input);

  const CollapseInput& input() const { return input_; }
  size_t position_count() const { return points_.size(); }
  size_t triangle_count() const { return live_; }  ///< that are left
  float extent() const { return extent_; }         ///< the longest side of its box
  float area_unit() const { return area_unit_; }   ///< scales areas of any extent alike
  bool has_wedges() const { return has_wedges_; }  ///< several vertices at some position
  bool has_wedges(uint32_t p) const {
    return has_wedges_ && wedge_offsets_[p + 1] - wedge_offsets_[p] > 1;
  }
  /// The vertices at a position, those that no triangle has any more too. Where there are wedges.
  std::span<const uint32_t> wedges(uint32_t p) const {
    return std::span(wedges_).subspan(wedge_offsets_[p], wedge_offsets_[p + 1] - wedge_offsets_[p]);
  }
  /// Whether any triangle has the vertex. Where there are wedges.
  bool is_used(uint32_t vertex) const { return uses_[vertex] > 0; }

  Kind kind(uint32_t p) const { return kinds_[p]; }
  bool is_fixed(uint32_t p) const { return kinds_[p] == Kind::kFixed; }
  /// Whether p may move without the link condition, but within its non-manifold component.
  bool moves_non_manifold(uint32_t p) const {
    return input_.non_manifold_moves || kinds_[p] == Kind::kNonManifold;
  }
  Vec3 point(uint32_t p) const { return {points_[p].x, points_[p].y, points_[p].z}; }
  const float* coordinates(uint32_t p) const { return &points_[p].x; }  ///< 4, the last one 0

  const OneRings& rings() const { return rings_; }
  std::span<const LinkEdge> link(uint32_t p) const { return rings_.link(p); }
  uint32_t corner(uint32_t p, size_t i) const { return rings_.corner(p, i); }
  uint32_t vertex(uint32_t c) const { return triangles_.data()->data()[c]; }
  /// Of the t-th triangle.
  Triangle positions_of(size_t t) const { return positions_of(triangles_[t]); }
  Triangle positions_of(const Triangle& t) const {
    if (!has_wedges_) return t;
    return {input_.position_of[t[0]], input_.position_of[t[1]], input_.position_of[t[2]]};
  }
  bool is_removed(size_t t) const { return removed_[t] != 0; }

  SeamRule rule(uint32_t p) const {
    return input_.rules.empty() ? SeamRule::kAllow : input_.rules[p];
  }
  bool same_material(uint32_t a, uint32_t b) const {
    return input_.materials.empty() || input_.materials[a] == input_.materials[b];
  }

  /// Calls visit(corner at p, target, whether the target comes after p there) for the neighbours
  /// that p may move to: all from the interior, along the border from there.
  template <typename Visit>
  void for_each_target(uint32_t p, const Visit& visit) const;

  /// Gives p's triangles to the target, except for those at the edge; see OneRings::collapse. A
  /// vertex v of p becomes new_vertex(v).
  template <typename NewVertex>
  void collapse(uint32_t p, uint32_t target, std::span<const uint32_t> neighbours, size_t opposites,
                const NewVertex& new_vertex);
  void find_kind(uint32_t p) { kinds_[p] = kind_of(p); }
  /// Removes triangle t with all the triangles of its component, which follow.
  void remove_triangle(size_t t);
  /// Those that are left, in their order.
  void copy_triangles(std::vector<Triangle>& out) const;

 private:
  struct alignas(16) Point {
    float x, y, z, unused;
  };

  void load_points();
  void list_wedges();
  void forget_uses(size_t t) {
    for (uint32_t v : triangles_[t]) --uses_[v];
  }
  Kind kind_of(uint32_t p);
  void mark_sides(std::span<const LinkEdge> edges) const {
    for (const LinkEdge& e : edges) sides_[e.next] |= kNext, sides_[e.prev] |= kPrev;
  }
  void forget_sides(std::span<const LinkEdge> edges) const {
    for (const LinkEdge& e : edges) sides_[e.next] = sides_[e.prev] = 0;
  }

  CollapseInput input_;
  bool has_wedges_ = false;
  float extent_ = 0.0f, area_unit_ = 1.0f;
  size_t live_ = 0;                  // triangles
  std::vector<Point> points_;        // of positions
  std::vector<Triangle> triangles_;  // of vertices
  std::vector<uint8_t> removed_;     // of triangles
  OneRings rings_;
  std::vector<Kind> kinds_;                       // of positions
  std::vector<uint32_t> wedge_offsets_, wedges_;  // of positions: their vertices
  std::vector<uint32_t> uses_;                    // of vertices: triangles
  std::vector<uint32_t> marks_, slots_;           // of positions, while a kind is found
  uint32_t stamp_ = 0;
  static constexpr uint8_t kNext = 1, kPrev = 2;
  mutable std::vector<uint8_t> sides_;  // of positions: of a link's edges; 0 at rest
};

template <typename Visit>
void CollapseMesh::for_each_target(uint32_t p, const Visit& visit) const {
  const auto edges = link(p);
  // Where a polygon was cut into a fan of triangles, their common corner has very many.
  constexpr size_t kFew = 32;
  const bool is_marked = edges.size() > kFew && kinds_[p] != Kind::kInterior;
  if (is_marked) mark_sides(edges);
  const auto is_in = [&](uint32_t x, uint32_t LinkEdge::* side) {
    if (is_marked) return (sides_[x] & (side == &LinkEdge::next ? kNext : kPrev)) != 0;
    return std::any_of(edges.begin(), edges.end(), [&](const LinkEdge& e) { return e.*side == x; });
  };
  for (size_t i = 0; i < edges.size(); ++i) {
    const auto [n, q] = edges[i];
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
  if (is_marked) forget_sides(edges);
}

template <typename NewVertex>
void CollapseMesh::collapse(uint32_t p, uint32_t target, std::span<const uint32_t> neighbours,
                            size_t opposites, const NewVertex& new_vertex) {
  uint32_t* const vertices = triangles_.data()->data();
  rings_.collapse(
      p, target, neighbours, opposites,
      [&](uint32_t c) {
        removed_[c / 3] = 1;
        --live_;
        if (has_wedges_) forget_uses(c / 3);
      },
      [&](uint32_t c) {
        const uint32_t to = new_vertex(vertices[c]);
        if (has_wedges_) --uses_[vertices[c]], ++uses_[to];
        vertices[c] = to;
      });
}

}  // namespace umbel::lod
