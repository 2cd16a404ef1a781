// The order in which a batch of points is best queried: along a Morton curve (Morton 1966), so
// that one query finds in the cache what the one before it needed.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "base/math.hpp"
#include "base/morton.hpp"
#include "base/parallel.hpp"
#include "base/radix_sort.hpp"

namespace umbel {

/// Calls body(i, state) for every point, in parallel, neighbours in space after one another. Each
/// run of neighbours has a `state` of its own.
template <typename State, typename Body>
void for_points_in_order(std::span<const Vec3> points, const Body& body) {
  constexpr size_t kRun = 512, kLeastSorted = 4096;
  std::vector<uint64_t> words, spare;
  const uint64_t* order = nullptr;
  if (points.size() >= kLeastSorted && points.size() <= kNone) {
    Aabb bounds;
    for (const Vec3& p : points)
      if (is_finite(p)) extend(bounds, p);
    words.resize(points.size());
    spare.resize(points.size());
    const auto cell = [](float x, float low, float high) {
      // Halved, so that the largest floats have a difference.
      const float share = (x * 0.5f - low * 0.5f) / (high * 0.5f - low * 0.5f);
      return share > 0 ? static_cast<uint32_t>(std::min(share, 1.0f) * 1023.0f) : 0u;
    };
    parallel_chunks(points.size(), size_t{1} << 14, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const Vec3& p = points[i];
        const uint64_t code = spread_bits(cell(p.x, bounds.min.x, bounds.max.x)) |
                              spread_bits(cell(p.y, bounds.min.y, bounds.max.y)) << 1 |
                              spread_bits(cell(p.z, bounds.min.z, bounds.max.z)) << 2;
        words[i] = code << 32 | i;
      }
    });
    order = radix_sort(words.data(), spare.data(), words.size(), 32, 62);
  }
  parallel_chunks(points.size(), kRun, [&](size_t begin, size_t end) {
    State state{};
    for (size_t i = begin; i < end; ++i) body(order ? static_cast<uint32_t>(order[i]) : i, state);
  });
}

}  // namespace umbel
