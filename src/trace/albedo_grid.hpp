// Tables of numbers that depend on a cosine and a roughness, interpolated bilinearly. Cosines are
// tabled by their roots, because albedos change most at grazing angles.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace umbel::trace {

template <uint32_t kValues>
class AlbedoGrid {
 public:
  using Cell = std::array<float, kValues>;

  /// `integrate(cosine, roughness)` gives a Cell; cosines are above zero.
  template <typename Integrate>
  explicit AlbedoGrid(const Integrate& integrate) {
    for (uint32_t r = 0; r < kRows; ++r) {
      for (uint32_t c = 0; c < kColumns; ++c) {
        const float root = at(c, kColumns);
        cells_[r][c] = integrate(std::max(root * root, 1e-3f), at(r, kRows));
      }
    }
  }

  Cell lookup(float cosine, float roughness) const {
    const float x = std::sqrt(share(cosine)) * (kColumns - 1), y = share(roughness) * (kRows - 1);
    const auto x0 = std::min(static_cast<uint32_t>(x), kColumns - 2);
    const auto y0 = std::min(static_cast<uint32_t>(y), kRows - 2);
    const float tx = x - static_cast<float>(x0), ty = y - static_cast<float>(y0);
    const auto mix = [](const Cell& p, const Cell& q, float t) {
      Cell mixed;
      for (uint32_t k = 0; k < kValues; ++k) mixed[k] = p[k] + (q[k] - p[k]) * t;
      return mixed;
    };
    return mix(mix(cells_[y0][x0], cells_[y0][x0 + 1], tx),
               mix(cells_[y0 + 1][x0], cells_[y0 + 1][x0 + 1], tx), ty);
  }

 private:
  static constexpr uint32_t kColumns = 64, kRows = 32;

  /// Within [0, 1]; of what is no number, 0.
  static float share(float x) { return x > 0 ? std::min(x, 1.0f) : 0.0f; }
  static float at(uint32_t i, uint32_t count) {
    return static_cast<float>(i) / static_cast<float>(count - 1);
  }

  std::array<std::array<Cell, kColumns>, kRows> cells_;
};

}  // namespace umbel::trace
