// Whether a collapse keeps the surface a surface: the link condition (Dey, Edelsbrunner, Guha &
// Nekhayev 1999). It also lists the neighbours whose one-rings the collapse changes.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "lod/simplify/collapse/collapse_mesh.hpp"

namespace umbel::lod {

class LinkCondition {
 public:
  explicit LinkCondition(const CollapseMesh& mesh) : mesh_(mesh) {}

  /// Whenever the mesh has been loaded.
  void reset();

  /// Marks the neighbours of p, for `holds`.
  void mark(uint32_t p);
  /// Whether p, which was marked last, may move onto its neighbour. New edges between locked
  /// positions must be legal too.
  bool holds(uint32_t p, uint32_t target);
  /// Whether it failed, since `forget_loop`, because of neighbours that both ends share without a
  /// triangle between.
  bool has_loop() const { return has_loop_; }
  void forget_loop() { has_loop_ = false; }

  /// Lists the neighbours of p, without the target. Of a manifold position, after `holds`.
  void list(uint32_t p, uint32_t target);
  /// Of any position.
  void list_any(uint32_t p, uint32_t target);
  /// Those that were listed last, the third corners at the edge first.
  std::span<const uint32_t> neighbours() const { return neighbours_; }
  size_t opposites() const { return opposites_; }  ///< how many third corners there are

 private:
  using LinkEdge = CollapseMesh::LinkEdge;

  bool holds_manifold(uint32_t p, uint32_t target);
  bool holds_non_manifold(uint32_t p, uint32_t target);
  bool keeps_locked_edges(uint32_t target) const;
  void find_opposites(uint32_t p, uint32_t target);

  const CollapseMesh& mesh_;
  std::vector<uint32_t> marks_;  // of positions
  uint32_t stamp_ = 0;
  std::vector<uint32_t> room_;  // of neighbours_
  std::span<const uint32_t> neighbours_;
  size_t opposites_ = 0;
  std::pair<uint32_t, uint32_t> opposite_{kNone, kNone};  // of a manifold position, the same if one
  bool has_loop_ = false;
};

inline void LinkCondition::mark(uint32_t p) {
  const uint32_t stamp = ++stamp_;
  uint32_t* const marks = marks_.data();
  for (const LinkEdge& e : mesh_.link(p)) marks[e.next] = stamp;
  if (mesh_.kind(p) != CollapseMesh::Kind::kInterior)
    for (const LinkEdge& e : mesh_.link(p)) marks[e.prev] = stamp;
}

// A manifold position has one or two third corners at an edge.
inline void LinkCondition::find_opposites(uint32_t p, uint32_t target) {
  uint32_t found[3] = {kNone, kNone, kNone};  // the last for what is not at the edge
  size_t count = 0;
  for (const LinkEdge& e : mesh_.link(p)) {
    found[count] = e.next == target ? e.prev : e.next;
    count += e.next == target || e.prev == target;
  }
  opposites_ = count;
  opposite_ = {found[0], found[count == 2]};
}

}  // namespace umbel::lod
