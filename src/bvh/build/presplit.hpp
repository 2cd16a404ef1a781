// Early splitting for any executor (Karras & Aila, "Fast Parallel Construction of High-Quality
// Bounding Volume Hierarchies", 2013, section 4.5): before the tree is built, triangles are given
// several boxes that together hold them. Those whose boxes are mostly empty and cross planes that
// the tree is likely to split at get the most; planes are the midpoints of a grid's cells.
//
// How many each gets follows from integers alone, so that all executors agree, and the sum is
// exactly what was asked for, so that all sizes are known beforehand.
#pragma once

#include <bit>
#include <cstdint>

#include "base/bit_count.hpp"
#include "base/exec.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// The most splits of a triangle; more only if there would be too few otherwise.
inline constexpr uint32_t kMostSplits = 63;

/// A grid of 2^20 cells an axis around the scene.
struct SplitGrid {
  static constexpr uint32_t kBits = 20;

  Vec3 origin;
  float scale;

  UMBEL_HOST_DEVICE static SplitGrid around(const Aabb& scene) {
    const Vec3 extent = scene.max - scene.min;
    const float xy = extent.x > extent.y ? extent.x : extent.y;
    const float longest = xy > extent.z ? xy : extent.z;
    return {scene.min, longest > 0 ? static_cast<float>(1u << kBits) / longest : 0};
  }
  UMBEL_HOST_DEVICE uint32_t cell(float x, float low) const {
    const float at = (x - low) * scale;
    constexpr float kLast = static_cast<float>((1u << kBits) - 1);
    // What is not finite may lie outside of the scene, as a box of nothing at 0.
    const float first = at > 0 ? at : 0;
    return static_cast<uint32_t>(at < kLast ? first : kLast);
  }

  /// The most important plane that a box crosses: `level` 0 halves the scene.
  struct Plane {
    uint32_t axis = 0, level = kBits;
    float at = 0;
  };
  UMBEL_HOST_DEVICE Plane plane_through(const Aabb& box) const {
    Plane best;
    const float lows[3] = {box.min.x, box.min.y, box.min.z},
                highs[3] = {box.max.x, box.max.y, box.max.z},
                origins[3] = {origin.x, origin.y, origin.z};
    float longest = -1;
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const uint32_t low = cell(lows[axis], origins[axis]), high = cell(highs[axis], origins[axis]);
      const float length = highs[axis] - lows[axis];
      if (low == high) continue;
      const uint32_t bit = highest_bit(low ^ high);
      const uint32_t level = kBits - 1 - bit;
      if (level > best.level || (level == best.level && !(length > longest))) continue;
      const float at = origins[axis] + static_cast<float>(high >> bit << bit) / scale;
      if (!(at > lows[axis] && at < highs[axis])) continue;
      best = {axis, level, at};
      longest = length;
    }
    return best;
  }
};

/// The same bits everywhere, which the function of the C library does not promise. Of at most
/// 2^120: the cube of a guess has to be a float.
UMBEL_HOST_DEVICE inline float cube_root(float x) {
  if (!(x > 0)) return 0;
  x = x < 0x1p120f ? x : 0x1p120f;
  float root = std::bit_cast<float>(std::bit_cast<uint32_t>(x) / 3 + 709921077u);
  for (int i = 0; i < 3; ++i) root = root - (root * root * root - x) / (3 * root * root);
  return root;
}

/// How much a triangle gains by splits.
UMBEL_HOST_DEVICE inline float split_priority(const SplitGrid& grid, const Vec3& a, const Vec3& b,
                                              const Vec3& c) {
  const Aabb box = box_of_finite(a, b, c);
  if (is_empty(box)) return 0;
  const SplitGrid::Plane plane = grid.plane_through(box);
  const Vec3 normal = cross(b - a, c - a);
  // Of the box that many small ones would come to.
  const float ideal = (std::fabs(normal.x) + std::fabs(normal.y) + std::fabs(normal.z)) * 0.5f;
  const float importance = std::bit_cast<float>((127 - plane.level) << 23);
  return cube_root(importance * (area_of(box) - ideal));
}

/// Splits a triangle.
struct TriangleParts {
  Vec3 corners[3];
  SplitGrid grid;

  UMBEL_HOST_DEVICE static float along(const Vec3& v, uint32_t axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
  }
  UMBEL_HOST_DEVICE static float& along(Vec3& v, uint32_t axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
  }

  /// What lies before and behind a plane that crosses a box, which holds a part of the triangle.
  UMBEL_HOST_DEVICE void split(const Aabb& box, uint32_t axis, float at, Aabb& before,
                               Aabb& behind) const {
    before = behind = Aabb{};
    for (int k = 0; k < 3; ++k) {
      const Vec3 &a = corners[k], &b = corners[k == 2 ? 0 : k + 1];
      const float from = along(a, axis), to = along(b, axis);
      if (from <= at) extend(before, a);
      if (from >= at) extend(behind, a);
      if (!((from < at && at < to) || (to < at && at < from))) continue;
      // Where the edge crosses, enlarged by what the arithmetic may be off.
      const Vec3 edge = b - a, p = a + edge * ((at - from) / (to - from));
      const auto off = [&](float e, float x) {
        return std::fabs(e) * (6 * 0x1p-24f) + std::fabs(x) * 0x1p-23f;
      };
      const Vec3 error{off(edge.x, p.x), off(edge.y, p.y), off(edge.z, p.z)};
      for (Aabb* side : {&before, &behind}) {
        extend(*side, p - error);
        extend(*side, p + error);
      }
    }
    Aabb low = box, high = box;
    along(low.max, axis) = at;
    along(high.min, axis) = at;
    before = within(before, low);
    behind = within(behind, high);
  }
  /// Where the two do not meet, which rounding alone could do, all of `limit`.
  UMBEL_HOST_DEVICE static Aabb within(const Aabb& box, const Aabb& limit) {
    const Aabb both{max(box.min, limit.min), min(box.max, limit.max)};
    return is_empty(both) ? limit : both;
  }

  /// Writes `count` boxes that together hold the triangle.
  UMBEL_HOST_DEVICE void write(uint32_t count, Aabb* boxes) const {
    struct Part {
      Aabb box;
      uint32_t count;
    };
    Aabb whole = box_of_finite(corners[0], corners[1], corners[2]);
    if (is_empty(whole)) whole = {{0, 0, 0}, {0, 0, 0}};
    Part open[34];  // the larger part waits, so each has at most half of the one below
    uint32_t size = 0;
    open[size++] = {whole, count};
    while (size > 0) {
      const Part part = open[--size];
      if (part.count == 1) {
        *boxes++ = part.box;
        continue;
      }
      SplitGrid::Plane plane = grid.plane_through(part.box);
      const Vec3 extent = part.box.max - part.box.min;
      if (plane.level == SplitGrid::kBits) {
        plane.axis = extent.x >= extent.y && extent.x >= extent.z ? 0
                     : extent.y >= extent.z                       ? 1
                                                                  : 2;
        plane.at = along(part.box.min, plane.axis) * 0.5f + along(part.box.max, plane.axis) * 0.5f;
      }
      Aabb before, behind;
      split(part.box, plane.axis, plane.at, before, behind);
      const float a = length_of(before), b = length_of(behind),
                  share = a + b > 0 ? a / (a + b) : 0.5f;
      auto first = static_cast<uint32_t>(static_cast<float>(part.count) * share);
      first = first < 1 ? 1 : first < part.count ? first : part.count - 1;
      const Part parts[2] = {{before, first}, {behind, part.count - first}};
      const bool first_waits = parts[0].count > parts[1].count;
      open[size++] = parts[first_waits ? 0 : 1];
      open[size++] = parts[first_waits ? 1 : 0];
    }
  }
  /// Half the longest side, which no floats are too far apart for.
  UMBEL_HOST_DEVICE static float length_of(const Aabb& b) {
    const Vec3 e = b.max * 0.5f - b.min * 0.5f;
    return e.x > e.y ? (e.x > e.z ? e.x : e.z) : (e.y > e.z ? e.y : e.z);
  }
};

/// Splits of a triangle of priority p are p * factor / 2^32, rounded down, where the largest p
/// counts as 2^20.
struct SplitCounts {
  const float* priorities;
  const float* largest;

  UMBEL_HOST_DEVICE uint64_t operator()(size_t i, uint64_t factor) const {
    const float share = *largest > 0 ? priorities[i] / *largest : 0;
    const uint64_t splits =
        static_cast<uint64_t>(static_cast<uint32_t>(share * 0x1p20f)) * factor >> 32;
    return splits < kMostSplits ? splits : kMostSplits;
  }
};

/// The largest factor of so many splits, found a digit at a time, from the highest down: a pass
/// over the triangles sums up the splits of all values that the digit may have.
struct SplitFactor {
  static constexpr uint32_t kDigitBits = 4, kDigits = 6, kLastBit = 32 - kDigits * kDigitBits;
  static constexpr uint32_t kValues = (1u << kDigitBits) - 1;  ///< other than 0

  /// Splits for each value of a digit, 1 first. More than fit count as the most that do.
  struct Sums {
    uint32_t of[kValues];
  };
  struct Add {
    UMBEL_HOST_DEVICE Sums operator()(const Sums& a, const Sums& b) const {
      Sums sums;
      for (uint32_t v = 0; v < kValues; ++v) {
        const uint32_t sum = a.of[v] + b.of[v];
        sums.of[v] = sum < a.of[v] ? 0xffffffffu : sum;
      }
      return sums;
    }
  };

  SplitCounts splits_of;
  uint32_t extra;
  Sums* sums;         ///< of each digit
  uint64_t* factors;  ///< by the digits before each; and by all of them

  /// With one digit more than `factors` has.
  UMBEL_HOST_DEVICE uint64_t after(uint32_t digit) const {
    uint32_t value = 0;  // sums do not fall
    for (uint32_t step = 1u << (kDigitBits - 1); step > 0; step /= 2)
      if (sums[digit].of[value + step - 1] <= extra) value += step;
    return factors[digit] + (uint64_t{value} << (32 - kDigitBits * (digit + 1)));
  }
  /// The splits of a triangle for each value of a digit.
  UMBEL_HOST_DEVICE Sums operator()(size_t i, uint32_t digit) const {
    const uint64_t factor = digit == 0 ? 0 : after(digit - 1);
    if (i == 0) factors[digit] = factor;
    Sums splits;
    for (uint32_t v = 0; v < kValues; ++v)
      splits.of[v] = static_cast<uint32_t>(
          splits_of(i, factor + (uint64_t{v + 1} << (32 - kDigitBits * (digit + 1)))));
    return splits;
  }
};

/// Boxes of parts of triangles, and the triangles that they belong to: `extra` more than there are
/// triangles. corners(i) gives a triangle's three corners. n > 0. Long, as it is one kernel after
/// the other, all of which use the same arrays.
template <typename Exec, typename Corners>
void presplit(Exec& exec, const Corners& corners, uint32_t n, uint32_t extra, Aabb* boxes,
              uint32_t* triangles) {
  auto scene = exec.template allocate<Aabb>(1);
  auto largest = exec.template allocate<float>(1);
  auto priorities = exec.template allocate<float>(n);
  const auto unite = [] UMBEL_DEVICE_LAMBDA(Aabb a, const Aabb& b) {
    extend(a, b);
    return a;
  };
  exec.reduce(
      n, Aabb{},
      [=] UMBEL_DEVICE_LAMBDA(size_t i) {
        const auto c = corners(static_cast<uint32_t>(i));
        return box_of_finite(c.a, c.b, c.c);
      },
      unite, scene.data());
  exec.reduce(
      n, 0.0f,
      [=, scene = scene.data(), priorities = priorities.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
        const auto c = corners(static_cast<uint32_t>(i));
        const float priority = split_priority(SplitGrid::around(*scene), c.a, c.b, c.c);
        priorities[i] = priority;
        return priority;
      },
      [] UMBEL_DEVICE_LAMBDA(float a, float b) { return a > b ? a : b; }, largest.data());
  auto sums = exec.template allocate<SplitFactor::Sums>(SplitFactor::kDigits);
  auto factors = exec.template allocate<uint64_t>(SplitFactor::kDigits);
  const SplitCounts splits_of{priorities.data(), largest.data()};
  const SplitFactor search{splits_of, extra, sums.data(), factors.data()};
  for (uint32_t digit = 0; digit < SplitFactor::kDigits; ++digit)
    exec.reduce(
        n, SplitFactor::Sums{}, [=] UMBEL_DEVICE_LAMBDA(size_t i) { return search(i, digit); },
        SplitFactor::Add{}, sums.data() + digit);
  // What is left goes to those that are next, in their order; and if that is not enough, to all.
  // Both the next ones and all splits are counted, these in the upper half.
  auto counts = exec.template allocate<uint64_t>(n + size_t{1});
  auto offsets = exec.template allocate<uint32_t>(n + size_t{1});
  exec.exclusive_scan(
      n,
      [=] UMBEL_DEVICE_LAMBDA(size_t i) -> uint64_t {
        const uint64_t factor = search.after(SplitFactor::kDigits - 1);
        const uint64_t splits = splits_of(i, factor);
        const bool is_next = splits_of(i, factor + (uint64_t{1} << SplitFactor::kLastBit)) > splits;
        return splits << 32 | (is_next ? 1 : 0);
      },
      counts.data());
  exec.exclusive_scan(
      n,
      [=, counts = counts.data()] UMBEL_DEVICE_LAMBDA(size_t i) -> uint32_t {
        const auto rest = extra - static_cast<uint32_t>(counts[n] >> 32),
                   all_next = static_cast<uint32_t>(counts[n]);
        const uint32_t given = rest < all_next ? rest : all_next, more = rest - given;
        const uint64_t own = counts[i + 1] - counts[i];
        const bool is_next =
            static_cast<uint32_t>(own) != 0 && static_cast<uint32_t>(counts[i]) < given;
        return 1 + static_cast<uint32_t>(own >> 32) + (is_next ? 1 : 0) + more / n +
               (i < more % n ? 1 : 0);
      },
      offsets.data());
  exec.for_each(n,
                [=, scene = scene.data(), offsets = offsets.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
                  const auto c = corners(static_cast<uint32_t>(i));
                  const TriangleParts parts{{c.a, c.b, c.c}, SplitGrid::around(*scene)};
                  parts.write(offsets[i + 1] - offsets[i], boxes + offsets[i]);
                  for (uint32_t k = offsets[i]; k < offsets[i + 1]; ++k)
                    triangles[k] = static_cast<uint32_t>(i);
                });
}

}  // namespace umbel::bvh
