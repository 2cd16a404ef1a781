// The error or threshold from which on a group need not be refined: what budgets are decided by.
#pragma once

#include <algorithm>
#include <bit>
#include <limits>

#include "base/math.hpp"
#include "lod/select/instances.hpp"

namespace umbel::lod {

/// The smallest float >= 0 for which `holds`, which never turns from yes to no; infinite where
/// there is none. Non-negative floats are in the order of their bits.
template <typename Holds>
float first_that(float guess, const Holds& holds) {
  uint32_t low = 0,
           high = std::bit_cast<uint32_t>(
               std::numeric_limits<float>::infinity());  // holds(high) is taken for granted
  const uint32_t bits =
      std::bit_cast<uint32_t>(std::clamp(guess, 0.0f, std::numeric_limits<float>::infinity()));
  // Rounding is seldom off by more than this.
  const uint32_t under = bits > 4 ? bits - 4 : 0, over = std::min(bits + 4, high);
  if (holds(std::bit_cast<float>(over)))
    high = over;
  else
    low = over + 1;
  if (under < high && !holds(std::bit_cast<float>(under))) low = std::max(low, under + 1);
  while (low < high) {
    const uint32_t middle = low + (high - low) / 2;
    if (holds(std::bit_cast<float>(middle)))
      high = middle;
    else
      low = middle + 1;
  }
  return std::bit_cast<float>(high);
}

/// The least error or threshold of the scene at which a group need not be refined, seen with the
/// view of its own space, whose error or threshold is `factor` times the scene's.
inline float turning_point(const Sphere& sphere, float error, View view, double factor) {
  if (error == kInfinity) return kInfinity;
  const bool by_error = view.kind == View::Kind::kError;
  const float distance = by_error ? 1.0f : distance_outside(sphere, view.eye);
  if (error > 0 && distance == 0) return kInfinity;
  const double guess = error == 0 ? 0.0 : error / (distance * factor);
  return first_that(static_cast<float>(guess), [&](float value) {
    if (value == kInfinity) return true;
    (by_error ? view.error : view.threshold) = scaled(value, factor);
    return !must_refine(sphere, error, view);
  });
}

}  // namespace umbel::lod
