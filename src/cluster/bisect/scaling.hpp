// Powers of two by which boxes are scaled before a build, and the padding of boxes without area.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/simd/box4.hpp"

namespace umbel::cluster {

/// 1 for usual boxes. Others are scaled so that areas stay within the range of floats: extents
/// above 2^-30 and below `max_extent`, coordinates below 2^max_exponent. A power of two changes no
/// comparison.
inline float scale_for(const Box4& bounds, float max_extent, int max_exponent) {
  float extent = 0, magnitude = 0;
  for (int k = 0; k < 3; ++k) {
    // Halved before the difference, so that it does not overflow.
    extent = std::max(extent, bounds.negated_high[k] * -0.5f - bounds.low[k] * 0.5f);
    magnitude = std::max({magnitude, std::abs(bounds.low[k]), std::abs(bounds.negated_high[k])});
  }
  if (extent == 0.0f ||
      (extent > 0x1p-30f && extent < max_extent && magnitude < std::ldexp(1.0f, max_exponent)))
    return 1.0f;
  const int most = max_exponent - std::ilogb(magnitude);
  return std::ldexp(1.0f, std::clamp(std::min(-std::ilogb(extent), most), -126, 127));
}

/// What the sides of boxes grow by within a node with these bounds, so that flat boxes have an
/// area.
inline Float4 pad_for(const Box4& bounds) {
  const float extent = bounds.longest();
  return splat(extent > 0.0f ? std::ldexp(1.0f, std::max(std::ilogb(extent) - 20, -60)) : 1.0f);
}

}  // namespace umbel::cluster
