// Where a part of the surface may have new positions, though others have positions that it does not
// know.
#pragma once

#include "umbel/types.hpp"

namespace umbel::lod {

class UnusedPositions {
 public:
  virtual ~UnusedPositions() = default;
  /// Whether no part has, ever had, or will get the position, but for what this one makes itself.
  /// Safe from many threads.
  virtual bool contains(const Vec3& position) const = 0;
};

}  // namespace umbel::lod
