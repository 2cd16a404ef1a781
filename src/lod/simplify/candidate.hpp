// What simplification of a group gives: by one method, and in the end.
#pragma once

#include <cstdint>
#include <vector>

#include "lod/dag/locked_edges.hpp"
#include "lod/dag/source.hpp"
#include "lod/dag/sub_mesh.hpp"
#include "lod/dag/topology.hpp"
#include "lod/dag/unused_positions.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// What one method makes of a group.
struct Candidate {
  std::vector<Triangle> triangles;       ///< of the group's vertices
  float error = 0, attribute_error = 0;  ///< in object space
  float removed_radius = 0;              ///< of the largest component that the collapse removed
  SimplifyMethod method = SimplifyMethod::kRegular;
  std::vector<PositionPair> locked_edges;  ///< new edges between two locked positions of the group
  bool valid = false;                      ///< it can take the group's place in every cut
  /// Any topology will do: the whole group gets new positions (move_vertices.hpp).
  bool renews_positions = false;
  AddedVertices added;
  /// New attributes of the group's vertices, as many values each as the group has attributes.
  std::vector<uint32_t> refitted;
  std::vector<float> refitted_values;
};

/// What a simplification may do beyond the usual.
struct Allowance {
  float ratio = 0.5f;                       ///< of the triangles that should be left
  bool locked_edges = true;                 ///< new edges between locked vertices
  bool by_caller = true;                    ///< the caller's own simplification is asked
  bool last_resort = false;                 ///< SimplifyMethod::kSloppy
  bool new_positions = true;                ///< positions that the group does not have, anywhere
  const UnusedPositions* unused = nullptr;  ///< without them: components may move to these
  const LockedEdgeSet* taken = nullptr;     ///< edges that others have; the caller checks the rest
};

/// What a group becomes.
struct Simplified {
  bool done = false;  ///< false: too little could be removed; only the limiting factor is set
  SubMesh mesh;       ///< vertices are those of the source, or kAddedVertex and more
  AddedVertices added;
  float error = 0;            ///< how far this step moved the surface, in object space
  float attribute_error = 0;  ///< how much worse it made attributes, as a length
  float removed_radius = 0;   ///< half the diagonal of the largest component that it removed
  SimplifyMethod method = SimplifyMethod::kRegular;
  LimitingFactor limiting_factor = LimitingFactor::kNone;
  std::vector<PositionPair> locked_edges;  ///< new edges between two locked vertices
};

}  // namespace umbel::lod
