// Keeps new positions apart from all others: two that are equal would be one position, and edges
// between such would be shared by triangles that have nothing to do with each other.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/interner.hpp"
#include "base/math.hpp"
#include "lod/dag/source.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel::lod {

class NewPositions {
 public:
  /// Moves the new positions of enlarged components away from all others, to the next float or,
  /// with a step, to the next multiple of it. Returns the farthest that one moved.
  float set_apart(const Source& source, float step, AddedVertices& added) {
    if (known_.keys().empty())
      for (const Vec3& p : source.mesh.positions) known_.insert(without_negative_zero(p));
    const bool enlarged = !added.components.empty();
    float farthest = 0;
    for (size_t v = 0; v < added.position_ids.size(); ++v) {
      Vec3& p = added.mesh.positions[v];
      const uint32_t id = added.position_ids[v];
      if (id != kNone) {
        if (id >= kAddedVertex) p = added.mesh.positions[id - kAddedVertex];
        continue;
      }
      const float before = p.x;
      while (!known_.insert(without_negative_zero(p)).second && enlarged)
        p.x = step > 0 ? p.x + step : std::nextafter(p.x, std::numeric_limits<float>::max());
      farthest = std::max(farthest, p.x - before);
    }
    return farthest;
  }

  bool is_empty() const { return known_.keys().empty(); }

 private:
  Interner<Vec3, ValueHash> known_;
};

}  // namespace umbel::lod
