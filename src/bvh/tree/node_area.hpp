// The surface area of nodes.
#pragma once

namespace umbel::bvh {

/// Half of it, of anything with `min` and `max`. In double: neither the largest nor the smallest
/// boxes overflow or vanish.
template <typename Box>
double half_area(const Box& b) {
  const double x = double(b.max.x) - double(b.min.x), y = double(b.max.y) - double(b.min.y),
               z = double(b.max.z) - double(b.min.z);
  return x * y + y * z + z * x;
}

}  // namespace umbel::bvh
