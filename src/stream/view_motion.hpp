// How far a view may move before the answer to "is this group's error too large?" can change.
//
// A view's motion sums, over its steps, how far it has moved, by how much it has turned (the
// largest change of a normal of its planes) and zoomed (the change of the logarithm of its
// threshold). A turn or zoom changes a distance by at most that much times the distance of the
// group, its reach. So an evaluation with a margin holds until moved + reach * turned, or zoomed,
// has grown by the margin. Errors and planes have separate margins, since a camera's planes turn
// faster.
#pragma once

#include <cmath>
#include <limits>

#include "umbel/stream.hpp"

namespace umbel::stream {

enum class Reason : uint8_t { kError, kPlanes };

struct ViewMotion {
  double moved = 0, zoomed = 0;
  double planes_moved = 0, turned = 0;
  /// The distance so far that counts for a reason and groups of a reach.
  double travelled(Reason reason, double reach) const {
    return reason == Reason::kError ? moved + reach * zoomed : planes_moved + reach * turned;
  }
  /// Adds the way from one view to the next of the same mesh. False if no evaluation holds any
  /// more.
  bool add(const StreamView& from, const StreamView& to);
  bool operator==(const ViewMotion&) const = default;
};

struct Evaluation {
  static constexpr double kForEver = std::numeric_limits<double>::infinity();
  float ratio = 0;  ///< how many times too large the error is as seen from the view, or 0
  /// By how much ViewMotion::travelled may grow, for either reason.
  double error_margin = kForEver, planes_margin = kForEver;
  int size = 0;  ///< the reach is 2^(size / 4)
};

inline double reach_of(int size) { return std::exp2(0.25 * size); }

/// `is_missing`: the ratio ranks pages, and must be right within some per cent all the time;
/// otherwise within a quarter.
Evaluation evaluate(const GroupRef& group, const StreamView& view, bool is_missing);

}  // namespace umbel::stream
