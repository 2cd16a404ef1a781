// Counts as colours, on a scale that several pictures share: black for none, then blue, cyan,
// green, yellow, red, to white for the most. As `umbel render --heatmap` has them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace sample {

/// Red, green, blue, alpha of each.
inline std::vector<uint8_t> heat_colors(std::span<const uint32_t> counts, uint32_t most) {
  constexpr double kColors[7][3] = {{0, 0, 0},      {30, 50, 200}, {0, 190, 220},  {60, 200, 60},
                                    {250, 220, 40}, {220, 40, 30}, {255, 255, 255}};
  std::vector<uint8_t> out;
  for (const uint32_t count : counts) {
    const double at = 6.0 * std::min(count, most) / std::max(most, 1u);
    const auto step = static_cast<size_t>(std::min(at, 5.0));
    for (size_t k = 0; k < 3; ++k) {
      const double low = kColors[step][k], high = kColors[step + 1][k];
      const double value = low + (high - low) * (at - static_cast<double>(step));
      out.push_back(static_cast<uint8_t>(std::lround(value)));
    }
    out.push_back(255);
  }
  return out;
}

}  // namespace sample
