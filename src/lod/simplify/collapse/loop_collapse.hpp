// Loops of edges around a tube or a neck that bound no triangle, which the link condition protects.
// They may collapse to a point: a handle closes, or a bulge goes, once that costs no more than
// other collapses do. No edge gets more than two triangles, but where the surface comes to touch
// itself a position has several fans.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/simplify/collapse/collapse_costs.hpp"
#include "lod/simplify/collapse/collapse_rules.hpp"

namespace umbel::lod {

class LoopCollapse {
 public:
  LoopCollapse(const CollapseMesh& mesh, const CollapseRules& rules, CollapseCosts& costs,
               WedgeMap& wedges)
      : mesh_(mesh), rules_(rules), costs_(costs), wedges_(wedges) {}

  /// Whenever the mesh has been loaded.
  void reset();

  /// Finds what has to move to the target together with p, so that no edge has more than two
  /// triangles that the source does not allow. After the link condition failed with a loop.
  bool find(uint32_t p, uint32_t target);
  /// The loop that was found: the target, then what moves there.
  std::span<const uint32_t> positions() const { return positions_; }
  /// Sets the wedge map to what the vertices at the i-th position become.
  void map_wedges(size_t i);
  /// Of collapsing the loop, shared out among the collapses whose place it takes: each takes two
  /// triangles away.
  float rank();

 private:
  using LinkEdge = CollapseMesh::LinkEdge;
  struct Neighbour {
    uint32_t position, from, triangles;  // triangles: those that stay
    bool several, at_target;             // of the loop's positions
  };

  bool add(uint32_t p);
  bool contains(uint32_t p) const;
  bool complete();
  void count_around(uint32_t from);
  bool keep_wedges(uint32_t p);

  const CollapseMesh& mesh_;
  const CollapseRules& rules_;
  CollapseCosts& costs_;
  WedgeMap& wedges_;
  std::vector<uint32_t> positions_;
  std::vector<Neighbour> around_;
  std::vector<uint32_t> marks_, slots_;  // of positions: stamp, index into around_
  uint32_t stamp_ = 0;
  std::vector<WedgeMap::Move> moves_;  // of each position those up to its end
  std::vector<size_t> ends_;
};

}  // namespace umbel::lod
