// How far a view may move before the answer to "is this error too large?" can change.
//
// A view keeps sums over its steps: how far it has moved, and by how much it has turned (the
// largest change of a normal of its planes) or zoomed (that of the logarithm of its threshold).
// What turns or zooms changes a distance at most by that times how far off the group is, its reach.
// So an answer with a margin holds until moved + reach * turned, or zoomed, has grown by the
// margin. What depends on errors is kept apart from what depends on planes, of which cameras turn
// faster.
#pragma once

#include <cmath>
#include <limits>

#include "umbel/stream.hpp"

namespace umbel::stream {

enum class Reason : uint8_t { kError, kPlanes };

struct Motion {
  double moved = 0, zoomed = 0;
  double planes_moved = 0, turned = 0;
  /// How far it has come for a reason and groups of a reach.
  double clock(Reason reason, double reach) const {
    return reason == Reason::kError ? moved + reach * zoomed : planes_moved + reach * turned;
  }
  /// Adds the way from one view to the next of the same mesh. False if no answer holds any more.
  bool add(const StreamView& from, const StreamView& to);
  bool operator==(const Motion&) const = default;
};

struct Answer {
  static constexpr double kForEver = std::numeric_limits<double>::infinity();
  float ratio = 0;  ///< how many times too large the error is as seen from the view, or 0
  /// By how much either clock may grow.
  double error_margin = kForEver, planes_margin = kForEver;
  int size = 0;  ///< the reach, as a power of the fourth root of two
};

inline double reach_of(int size) { return std::exp2(0.25 * size); }

/// `is_missing`: its ratio will be used, and must be right within some per cent all the time;
/// otherwise within a quarter.
Answer look_at(const GroupRef& group, const StreamView& view, bool is_missing);

}  // namespace umbel::stream
