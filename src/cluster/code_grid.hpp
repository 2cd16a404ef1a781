// Morton codes that adapt to the scene's shape (Vinkler, Bittner & Havran, "Extended Morton Codes
// for High Performance Bounding Volume Hierarchy Construction", 2017): cells are near to cubes, so
// the longest axis has most bits, and the highest ones; a flat scene wastes none on its thin axis.
#pragma once

#include <cmath>
#include <cstdint>

#include "base/math.hpp"
#include "base/morton.hpp"

namespace umbel::cluster {

/// Spreads the low 16 bits so that one zero bit follows each.
UMBEL_HOST_DEVICE inline uint32_t spread_pairs(uint32_t x) {
  x = (x | x << 8) & 0x00ff00ffu;
  x = (x | x << 4) & 0x0f0f0f0fu;
  x = (x | x << 2) & 0x33333333u;
  return (x | x << 1) & 0x55555555u;
}

/// The same for the low 32 bits.
UMBEL_HOST_DEVICE inline uint64_t spread_pairs(uint64_t x) {
  x = (x | x << 16) & 0x0000ffff0000ffffu;
  x = (x | x << 8) & 0x00ff00ff00ff00ffu;
  x = (x | x << 4) & 0x0f0f0f0f0f0f0f0fu;
  x = (x | x << 2) & 0x3333333333333333u;
  return (x | x << 1) & 0x5555555555555555u;
}

/// A grid around points, of cells whose sides differ by less than a factor of two. From the highest
/// bit down, a code has bits of the longest axis alone, then of the two longer axes by turns, then
/// of all three; each bit halves the longest side. Above them all is a bit that sets large
/// triangles apart, so that a wall does not spread the box of what stands before its middle (the
/// size bits of the same paper, but one is as good as more).
struct CodeGrid {
  static constexpr uint32_t kMostBits = 20;  ///< an axis: floats have little more to tell
  /// Longer than this much of the longest axis is large. Measured on eight scenes, of .12 to .5.
  static constexpr double kLarge = 0.35;

  float origin[3];  ///< of the axes by falling extent, in units of 1 / prescale
  float scale[3];   ///< cells such a unit
  float last[3];    ///< cells, less one
  float large;      ///< the sides of large boxes are longer, in such units
  uint8_t large_bit;
  float prescale;   ///< a power of two, with which no extent overflows or vanishes
  uint8_t axes[3];  ///< by falling extent
  uint8_t of_all;   ///< bits that all axes have
  uint8_t of_two;   ///< more bits that the two longer ones have
  uint8_t turn_of_all[3], turn_of_two[2];  ///< places within three, or two bits

  /// `centers` holds the centres of all boxes; codes have at most `bits` bits.
  UMBEL_HOST_DEVICE static CodeGrid around(const Aabb& centers, uint32_t bits) {
    const double extents[3] = {double(centers.max.x) - double(centers.min.x),
                               double(centers.max.y) - double(centers.min.y),
                               double(centers.max.z) - double(centers.min.z)};
    CodeGrid grid{};
    for (uint8_t k = 0; k < 3; ++k) grid.axes[k] = k;
    sort_falling(extents, grid.axes);
    const double sorted[3] = {extents[grid.axes[0]], extents[grid.axes[1]], extents[grid.axes[2]]};
    uint32_t counts[3] = {0, 0, 0};
    share_out(sorted, bits - 1, counts);
    grid.of_all = uint8_t(counts[2]);
    grid.of_two = uint8_t(counts[1] - counts[2]);
    grid.take_turns(sorted, counts);
    int exponent = 0;
    if (sorted[0] > 0 && sorted[0] < 1e300) frexp(sorted[0], &exponent);
    const int shift = exponent < -126 ? 126 : -exponent;
    grid.prescale = float(ldexp(1.0, shift));
    grid.large = float(ldexp(sorted[0], shift) * kLarge);
    grid.large_bit = uint8_t(bits - 1);
    for (int k = 0; k < 3; ++k) {
      const double cells = double(uint32_t(1) << counts[k]);
      grid.origin[k] = pick(centers.min, grid.axes[k]) * grid.prescale;
      grid.scale[k] = counts[k] > 0 ? float(cells / ldexp(sorted[k], shift)) : 0.0f;
      grid.last[k] = float(cells - 1);
    }
    return grid;
  }

  template <typename Key>
  UMBEL_HOST_DEVICE Key code(const Aabb& box) const {
    const Vec3 center = umbel::center(box);
    const Key x = cell(pick(center, axes[0]), 0), y = cell(pick(center, axes[1]), 1),
              z = cell(pick(center, axes[2]), 2);
    const Key mask = (Key(1) << of_all) - 1;
    const Key all = spread_bits(x & mask) << turn_of_all[0] |
                    spread_bits(y & mask) << turn_of_all[1] |
                    spread_bits(z & mask) << turn_of_all[2];
    const Key x_above = x >> of_all, y_above = y >> of_all;
    const Key two_mask = (Key(1) << of_two) - 1;
    const Key two = spread_pairs(x_above & two_mask) << turn_of_two[0] | spread_pairs(y_above)
                                                                             << turn_of_two[1];
    const Key is_large = longest_side(box) * prescale > large ? 1 : 0;
    return is_large << large_bit | all | two << 3 * of_all |
           (x_above >> of_two) << (3 * of_all + 2 * of_two);
  }

 private:
  UMBEL_HOST_DEVICE static float pick(const Vec3& v, uint8_t axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
  }
  UMBEL_HOST_DEVICE static float longest_side(const Aabb& box) {
    const Vec3 sides = box.max - box.min;
    const float xy = sides.x > sides.y ? sides.x : sides.y;
    return xy > sides.z ? xy : sides.z;
  }
  /// Orders three names by their values.
  UMBEL_HOST_DEVICE static void sort_falling(const double* values, uint8_t* names) {
    for (int pass = 0; pass < 2; ++pass)
      for (int k = 0; k < 2; ++k)
        if (values[names[k]] < values[names[k + 1]]) {
          const uint8_t name = names[k];
          names[k] = names[k + 1];
          names[k + 1] = name;
        }
  }
  /// Gives each bit to the axis with the longest cells.
  UMBEL_HOST_DEVICE static void share_out(const double* extents, uint32_t bits, uint32_t* counts) {
    double sides[3] = {extents[0], extents[1], extents[2]};
    for (uint32_t bit = 0; bit < bits; ++bit) {
      int chosen = -1;
      for (int k = 0; k < 3; ++k)
        if (counts[k] < kMostBits && sides[k] > 0 && (chosen < 0 || sides[k] > sides[chosen]))
          chosen = k;
      if (chosen < 0) return;
      ++counts[chosen];
      sides[chosen] *= 0.5;
    }
  }
  /// Of bits that go together, that of the longest side is the highest.
  UMBEL_HOST_DEVICE void take_turns(const double* extents, const uint32_t* counts) {
    uint8_t names[3] = {0, 1, 2};
    double sides[3];
    for (int k = 0; k < 3; ++k) sides[k] = ldexp(extents[k], int(of_all) - int(counts[k]));
    sort_falling(sides, names);
    for (uint8_t k = 0; k < 3; ++k) turn_of_all[names[k]] = uint8_t(2 - k);
    for (int k = 0; k < 2; ++k) sides[k] = ldexp(sides[k], of_two);
    const bool y_first = sides[1] > sides[0];
    turn_of_two[0] = y_first ? 0 : 1;
    turn_of_two[1] = y_first ? 1 : 0;
  }
  /// NaN falls into the last cell.
  UMBEL_HOST_DEVICE uint32_t cell(float center, int k) const {
    const float x = (center * prescale - origin[k]) * scale[k];
    const float below = x < last[k] ? x : last[k];
    return static_cast<uint32_t>(static_cast<int32_t>(below > 0 ? below : 0.0f));
  }
};

}  // namespace umbel::cluster
