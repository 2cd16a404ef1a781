// Verification of what groups were simplified to: that it has the group's border.
#pragma once

#include "lod/verify/verify_geometry.hpp"

namespace umbel::lod {

/// A group's clusters and those that were made from it, as indices in a topology.
struct GroupForms {
  std::span<const uint32_t> own, simplified;
};

/// How often the two forms of a group run along one edge.
struct EdgeUse {
  uint32_t edge;
  uint32_t own = 0, simplified = 0;
  int64_t net = 0;  ///< forward minus backward, own minus simplified
};

/// Edges at which a group's two forms differ in their borders, or that more than two triangles of
/// a form share; how many, and the first.
struct BorderResult {
  uint64_t cracks = 0, overlaps = 0;
  std::vector<EdgeUse> first_cracks, first_overlaps;
};

BorderResult compare_forms(const Topology& topology, const GroupForms& forms, bool is_root);
void name_border(const Topology& topology, uint32_t g, const Group& group,
                 const BorderResult& result, Findings& findings);

/// The group that a position was last seen in.
class PositionMarks {
 public:
  explicit PositionMarks(size_t positions) : last_(positions, kNone) {}
  void set(uint32_t position, uint32_t group) { last_[position] = group; }
  bool is(uint32_t position, uint32_t group) const { return last_[position] == group; }

 private:
  std::vector<uint32_t> last_;
};

/// Simplification only drops vertices, but for a decimation of somebody's own: its new vertices
/// are within the group's sphere. `numbers` are those of the simplified clusters in the tables.
void verify_new_positions(const Topology& topology, uint32_t g, const Sphere& sphere,
                          const GroupForms& forms, std::span<const uint32_t> numbers,
                          PositionMarks& marks, Findings& findings);

void verify_borders(const Tables& tables, const Topology& topology, Findings& findings);

}  // namespace umbel::lod
