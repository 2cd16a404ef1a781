// How far a view may move before the answer to "is this error too large?" can change.
//
// A view keeps two sums over its steps: how far it has moved, and by how much it has turned (the
// largest change of a normal of its planes, and of the logarithm of its threshold). What turns
// changes a distance at most by the angle times how far off the group is, its reach. So an answer
// with a margin holds until moved + reach * turned has grown by the margin.
#pragma once

#include "umbel/stream.hpp"

namespace umbel::stream {

struct Motion {
  double moved = 0, turned = 0;
  /// How far it has come for groups of a reach of 2^exponent.
  double clock(int exponent) const;
  /// Adds the way from one view to the next of the same mesh. False if no answer holds any more.
  bool add(const StreamView& from, const StreamView& to);
};

struct Answer {
  float ratio = 0;    ///< how many times too large the error is as seen from the view, or 0
  double margin = 0;  ///< by how much the clock of `exponent` may grow; infinite: for ever
  int exponent = 0;
};

/// `is_missing`: its ratio will be used, and must be right within some per cent all the time;
/// otherwise within a quarter.
Answer look_at(const GroupRef& group, const StreamView& view, bool is_missing);

}  // namespace umbel::stream
