#include "asset/file/box_steps.hpp"

#include <algorithm>
#include <cmath>

namespace umbel::asset {
namespace {

constexpr uint32_t kSteps = 65535;

/// The coordinate of step `i`: exact at both ends, and monotone.
float coordinate(float low, float high, uint32_t i) {
  if (i == 0) return low;
  if (i == kSteps) return high;
  const double t = double(i) / kSteps;
  return static_cast<float>(double{low} + (double{high} - double{low}) * t);
}

uint32_t guess(float low, float high, float value) {
  const double t = (double{value} - double{low}) / (double{high} - double{low});
  return t > 0 ? static_cast<uint32_t>(std::min(t, 1.0) * kSteps) : 0;
}

uint16_t at_most(float low, float high, float value) {
  uint32_t i = guess(low, high, value);
  while (i > 0 && coordinate(low, high, i) > value) --i;
  return static_cast<uint16_t>(i);
}

uint16_t at_least(float low, float high, float value) {
  uint32_t i = guess(low, high, value);
  while (i < kSteps && coordinate(low, high, i) < value) ++i;
  return static_cast<uint16_t>(i);
}

}  // namespace

std::array<uint16_t, 6> box_steps(const Aabb& box, const Aabb& bounds) {
  const Vec3 low = bounds.min, high = bounds.max;
  return {at_most(low.x, high.x, box.min.x),  at_most(low.y, high.y, box.min.y),
          at_most(low.z, high.z, box.min.z),  at_least(low.x, high.x, box.max.x),
          at_least(low.y, high.y, box.max.y), at_least(low.z, high.z, box.max.z)};
}

Aabb box_of_steps(const std::array<uint16_t, 6>& steps, const Aabb& bounds) {
  const Vec3 low = bounds.min, high = bounds.max;
  return {{coordinate(low.x, high.x, steps[0]), coordinate(low.y, high.y, steps[1]),
           coordinate(low.z, high.z, steps[2])},
          {coordinate(low.x, high.x, steps[3]), coordinate(low.y, high.y, steps[4]),
           coordinate(low.z, high.z, steps[5])}};
}

}  // namespace umbel::asset
