// Numbers as they stand in sentences.
#pragma once

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <concepts>
#include <cstdio>
#include <string>

namespace umbel {

/// In as few digits as tell it from other numbers of its type; "nan" without a sign.
template <typename Number>
std::string printed(Number value) {
  if constexpr (std::floating_point<Number>) {
    if (std::isnan(value)) return "nan";
    std::array<char, 32> text;
#if defined(__cpp_lib_to_chars)
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
#else
    const int digits = sizeof value == 4 ? 9 : 17;
    std::snprintf(text.data(), text.size(), "%.*g", digits, double{value});
    return text.data();
#endif
  } else {
    return std::to_string(value);
  }
}

/// "(x, y, z)" of the floats that a vector consists of.
template <typename Vector>
std::string printed_vector(const Vector& vector) {
  std::string text;
  for (float f : std::bit_cast<std::array<float, sizeof(Vector) / 4>>(vector))
    text += (text.empty() ? "(" : ", ") + printed(f);
  return text + ")";
}

}  // namespace umbel
