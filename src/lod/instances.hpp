// What an instance's transform does to a view.
#pragma once

#include <span>
#include <vector>

#include "lod/cull.hpp"

namespace umbel::lod {

/// The least and the largest factor by which a transform changes lengths. Throws kInvalidArgument
/// where it is not invertible.
struct Stretch {
  double least, most;
};
Stretch stretch(const Transform& transform);

/// An error or a threshold of a view in an instance's space, never infinite.
inline float scaled(float value, double factor) {
  return static_cast<float>(std::min<double>(value * factor, std::numeric_limits<float>::max()));
}

std::vector<Plane> to_object(std::span<const Plane> planes, const Transform& transform);

}  // namespace umbel::lod
