// Keeps new positions apart from all others: two that are equal would be one position, and edges
// between such would be shared by triangles that have nothing to do with each other.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "base/interner.hpp"
#include "base/math.hpp"
#include "lod/dag/source.hpp"
#include "lod/dag/unused_positions.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel::lod {

class NewPositions {
 public:
  /// Moves the new positions of enlarged components away from all others, to the next float or,
  /// with a step, to the next multiple of it. Returns the farthest that one moved. With `unused`,
  /// which has none of the source, they stay within that; nothing where they cannot.
  std::optional<float> set_apart(const Source& source, float step, const UnusedPositions* unused,
                                 AddedVertices& added) {
    if (known_.keys().empty() && !unused) insert_all(source);
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
      int steps = 0;
      while (
          !((!unused || unused->contains(p)) && known_.insert(without_negative_zero(p)).second) &&
          enlarged) {
        if (unused && ++steps > kMostSteps) return {};
        p.x = next(p.x, step, before < 0.5f * kMost);
      }
      farthest = std::max(farthest, std::fabs(p.x - before));
    }
    return farthest;
  }

  bool is_empty() const { return known_.keys().empty(); }

 private:
  static constexpr float kMost = std::numeric_limits<float>::max();
  static constexpr int kMostSteps = 4096;

  // Each position once, though several vertices may have it.
  void insert_all(const Source& source) {
    constexpr size_t kAhead = 16;
    const std::vector<Vec3>& positions = source.mesh.positions;
    known_ = Interner<Vec3, ValueHash>(positions.size());
    for (size_t v = 0; v < positions.size(); ++v) {
      if (v + kAhead < positions.size())
        known_.prefetch(without_negative_zero(positions[v + kAhead]));
      if (source.position_ids[v] == v) known_.insert(without_negative_zero(positions[v]));
    }
  }

  // Where floats are farther apart than the step, which is a power of two, all are multiples of it.
  static float next(float x, float step, bool upwards) {
    return upwards ? std::max(x + step, std::nextafter(x, kMost))
                   : std::min(x - step, std::nextafter(x, -kMost));
  }

  Interner<Vec3, ValueHash> known_;
};

}  // namespace umbel::lod
