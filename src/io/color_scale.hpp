// Colours of vertices as files write them: as fractions, or as bytes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace umbel::io {

/// In place of a vertex's colour or alpha that its file does not give.
inline constexpr float kNoColor = std::numeric_limits<float>::lowest();

/// What colours and alphas of a file are divided by.
struct ColorScale {
  float color = 1.0f, alpha = 1.0f;
};

/// A number of a colour as a fraction; what is not given is white and opaque.
inline float fraction_of(float written, float scale) {
  return written == kNoColor ? 1.0f : written / scale;
}

/// Finds a file's scale; it is shown all colours, 4 numbers each.
class ColorScaleFinder {
 public:
  void add(const std::vector<float>& colors) {
    for (size_t k = 0; k < colors.size(); ++k) {
      float& largest = k % 4 == 3 ? largest_alpha_ : largest_color_;
      largest = std::max(largest, colors[k]);
    }
  }
  ColorScale scale() const { return {of(largest_color_), of(largest_alpha_)}; }

 private:
  /// With a larger number, all are bytes (MOST_BRIGHT in python/umbel/io/colors.py).
  static constexpr float kMostBright = 2.0f;
  static float of(float largest) { return largest > kMostBright ? 255.0f : 1.0f; }

  float largest_color_ = 0, largest_alpha_ = 0;
};

}  // namespace umbel::io
