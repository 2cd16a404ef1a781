// Parts of nearly equal size, by medians across the longest side of the box of their points.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "base/math.hpp"

namespace umbel::asset {

namespace detail {

inline void bisect(std::span<uint32_t> items, uint32_t first, uint32_t parts,
                   const std::vector<Vec3>& at, std::vector<Range>& out) {
  if (parts <= 1) {
    out.push_back({first, static_cast<uint32_t>(items.size())});
    return;
  }
  Aabb box;
  for (const uint32_t i : items) extend(box, at[i]);
  const Vec3 size = box.max * 0.5f - box.min * 0.5f;
  const float Vec3::* const axis = size.x >= size.y && size.x >= size.z ? &Vec3::x
                                   : size.y >= size.z                   ? &Vec3::y
                                                                        : &Vec3::z;
  const uint32_t left = parts / 2;
  const auto middle = static_cast<uint32_t>(uint64_t{left} * items.size() / parts);
  std::nth_element(items.begin(), items.begin() + middle, items.end(), [&](uint32_t a, uint32_t b) {
    // A total order, so that the halves are the same everywhere.
    return at[a].*axis != at[b].*axis ? at[a].*axis < at[b].*axis : a < b;
  });
  bisect(items.first(middle), first, left, at, out);
  bisect(items.subspan(middle), first + middle, parts - left, at, out);
}

}  // namespace detail

/// Reorders the items, numbers of points; the ranges of the parts. No part is empty if there are as
/// many items.
inline std::vector<Range> bisect(std::span<uint32_t> items, uint32_t parts,
                                 const std::vector<Vec3>& at) {
  std::vector<Range> out;
  detail::bisect(items, 0, parts, at, out);
  return out;
}

}  // namespace umbel::asset
