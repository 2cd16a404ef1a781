// The one test that selection is made of: is this error, seen from the view, too large?
//
// It is arithmetic in 32-bit floats in exactly the order below, so that a selection on another
// processor, on a GPU or in a browser can give the same cut. The file must be compiled without
// contraction of a * b + c into one rounding.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/host_device.hpp"
#include "umbel/lod/select.hpp"

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

namespace umbel::lod {

/// sqrt(x^2 + y^2 + z^2) with the sum from left to right. Where that sum would overflow or lose
/// digits to underflow, the same of components scaled by a power of two, which is exact: the
/// relative error is below 2^-21 for every input whose length is a normal float.
UMBEL_HOST_DEVICE inline float vector_length(float x, float y, float z) {
  constexpr float kSmallest = 0x1p-100f;
  constexpr float kUp = 0x1p96f;
  constexpr float kDown = 0x1p-96f;
  const float square = x * x + y * y + z * z;
  if (square >= kSmallest && square <= std::numeric_limits<float>::max()) return std::sqrt(square);
  const float in = square < kSmallest ? kUp : kDown;
  const float out = square < kSmallest ? kDown : kUp;
  x *= in, y *= in, z *= in;
  return std::sqrt(x * x + y * y + z * z) * out;
}

/// Distance from `eye` to the sphere, 0 inside it. Never infinite, so that a threshold of zero
/// times it is zero; the length is limited before the radius is taken off, because a length that
/// overflows at one sphere need not at another within it.
UMBEL_HOST_DEVICE inline float distance_outside(const Sphere& sphere, const Vec3& eye) {
  const float length =
      vector_length(sphere.center.x - eye.x, sphere.center.y - eye.y, sphere.center.z - eye.z);
  return std::max(std::min(length, std::numeric_limits<float>::max()) - sphere.radius, 0.0f);
}

/// By error or camera, for a group or a node of the hierarchy. An infinite error must always be
/// refined.
UMBEL_HOST_DEVICE inline bool must_refine(const Sphere& sphere, float error, const View& view) {
  if (error == std::numeric_limits<float>::infinity()) return true;
  if (view.kind == View::Kind::kError) return error > view.error;
  return error > view.threshold * distance_outside(sphere, view.eye);
}

/// How many times too large an error is for a view; 0 where it is not, 1 by level. What is
/// infinitely too large (the eye is inside the sphere) has the largest value.
UMBEL_HOST_DEVICE inline float times_too_large(const Sphere& sphere, float error,
                                               const View& view) {
  constexpr float kMost = 1e6f;
  if (view.kind == View::Kind::kLevel) return 1;
  if (!must_refine(sphere, error, view)) return 0;
  const float allowed = view.kind == View::Kind::kError
                            ? view.error
                            : view.threshold * distance_outside(sphere, view.eye);
  return std::min(error / std::max(allowed, std::numeric_limits<float>::min()), kMost);
}

/// By any view, for a group: must_refine(group, view) of lod/select.hpp, inlined and on devices.
UMBEL_HOST_DEVICE inline bool must_refine(const Sphere& sphere, float error, uint32_t level,
                                          const View& view) {
  if (view.kind == View::Kind::kLevel)
    return level >= view.level || error == std::numeric_limits<float>::infinity();
  return must_refine(sphere, error, view);
}

}  // namespace umbel::lod
