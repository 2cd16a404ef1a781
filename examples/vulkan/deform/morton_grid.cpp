#include "deform/morton_grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace sample {

namespace {

constexpr double kLarge = 0.35;     // a side longer than this share of the longest axis is large
constexpr uint32_t kMostBits = 21;  // an axis: floats have little more to tell

using Sides = std::array<double, 3>;
using Axes = std::array<uint32_t, 3>;

void sort_falling(const Sides& values, Axes& axes) {
  std::stable_sort(axes.begin(), axes.end(),
                   [&](uint32_t a, uint32_t b) { return values[a] > values[b]; });
}

// Gives each bit to the axis with the longest cells; of equal ones to the first of `axes`.
Axes share_out(Sides sides, const Axes& axes, uint32_t bits) {
  Axes counts{};
  for (uint32_t bit = 0; bit < bits; ++bit) {
    uint32_t chosen = 3;
    for (const uint32_t k : axes) {
      if (counts[k] < kMostBits && sides[k] > 0 && (chosen == 3 || sides[k] > sides[chosen])) {
        chosen = k;
      }
    }
    if (chosen == 3) break;
    ++counts[chosen];
    sides[chosen] *= 0.5;
  }
  return counts;
}

}  // namespace

GpuGrid grid_around(const umbel::Aabb& centers) {
  const float lows[3] = {centers.min.x, centers.min.y, centers.min.z};
  const float highs[3] = {centers.max.x, centers.max.y, centers.max.z};
  Sides extents;
  for (size_t k = 0; k < 3; ++k) extents[k] = std::max(0.0, double{highs[k]} - double{lows[k]});
  Axes axes{0, 1, 2};
  sort_falling(extents, axes);
  const Axes counts = share_out(extents, axes, kCodeBits - 1);
  GpuGrid grid{};
  grid.longest = axes[0];
  grid.second = axes[1];
  grid.of_all = counts[axes[2]];
  grid.of_two = counts[axes[1]] - grid.of_all;
  grid.has_more = counts[axes[0]] > grid.of_all ? 1 : 0;
  grid.large_bit = kCodeBits - 1;
  // Of bits that go together, that of the longest side is the highest.
  Sides sides;
  for (size_t k = 0; k < 3; ++k) {
    sides[k] = std::ldexp(extents[k], static_cast<int>(grid.of_all) - static_cast<int>(counts[k]));
  }
  Axes turns = axes;
  sort_falling(sides, turns);
  for (uint32_t k = 0; k < 3; ++k) grid.turn[turns[k]] = 2 - k;
  grid.longest_first = sides[grid.second] > sides[grid.longest] ? 0 : 1;
  // A power of two, with which no extent overflows or vanishes.
  int exponent = 0;
  const double most = extents[axes[0]];
  if (most > 0) std::frexp(most, &exponent);
  const int shift = exponent < -126 ? 126 : -exponent;
  grid.prescale = static_cast<float>(std::ldexp(1.0, shift));
  grid.large = static_cast<float>(std::ldexp(most, shift) * kLarge);
  for (size_t k = 0; k < 3; ++k) {
    const double cells = static_cast<double>(1u << counts[k]);
    grid.origin[k] = lows[k] * grid.prescale;
    grid.scale[k] =
        counts[k] > 0 ? static_cast<float>(cells / std::ldexp(extents[k], shift)) : 0.0f;
    grid.last[k] = static_cast<float>(cells - 1);
  }
  return grid;
}

}  // namespace sample
