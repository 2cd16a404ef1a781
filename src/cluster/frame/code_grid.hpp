// Morton codes that adapt to the scene's shape (Vinkler, Bittner & Havran, "Extended Morton Codes
// for High Performance Bounding Volume Hierarchy Construction", 2017): cells are nearly cubes, so
// the longest axis has most bits, and the highest ones; a flat scene wastes none on its thin axis.
#pragma once

#include <cmath>
#include <cstdint>

#include "base/math.hpp"
#include "base/morton.hpp"
#include "cluster/frame/frame_mesh.hpp"

namespace umbel::cluster {

/// Spreads the low 16 bits so that one zero bit follows each. `Words` as for spread_bits_of.
template <typename Words>
UMBEL_HOST_DEVICE Words spread_pairs_of(Words x) {
  x = (x | x << 8) & 0x00ff00ffu;
  x = (x | x << 4) & 0x0f0f0f0fu;
  x = (x | x << 2) & 0x33333333u;
  return (x | x << 1) & 0x55555555u;
}
UMBEL_HOST_DEVICE inline uint32_t spread_pairs(uint32_t x) { return spread_pairs_of(x); }

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
  static constexpr uint32_t kMostBits = 21;  ///< an axis: floats have little more to tell
  /// A side that is longer than this share of the longest axis is large.
  static constexpr double kLarge = 0.35;

  // By axis; the fourth is unused.
  alignas(16) float origin[4];  ///< in units of 1 / prescale
  alignas(16) float scale[4];   ///< cells such a unit
  alignas(16) float last[4];    ///< cells, less one
  float prescale;               ///< a power of two, with which no extent overflows or vanishes
  float large;                  ///< the sides of large boxes are longer, in such units
  uint32_t turn[3];             ///< positions within the three bits that all axes have
  uint32_t longest, second;     ///< axes
  uint32_t of_all;              ///< bits that all axes have
  uint32_t of_two;              ///< more bits that the two longer ones have
  uint32_t longest_first;       ///< of those two: 1 or 0
  uint32_t large_bit;
  uint32_t has_more;  ///< whether the longest axis has more bits than all have: 1 or 0

  /// `centers` holds the centres of all boxes; codes have at most `bits` bits.
  UMBEL_HOST_DEVICE static CodeGrid around(const Aabb& centers, uint32_t bits) {
    const double extents[3] = {extent(centers.min.x, centers.max.x),
                               extent(centers.min.y, centers.max.y),
                               extent(centers.min.z, centers.max.z)};
    CodeGrid grid{};
    uint32_t axes[3] = {0, 1, 2};
    sort_falling(extents, axes);
    uint32_t counts[3] = {0, 0, 0};
    share_out(extents, axes, bits - 1, counts);
    grid.longest = axes[0];
    grid.second = axes[1];
    grid.of_all = counts[axes[2]];
    grid.of_two = counts[axes[1]] - grid.of_all;
    grid.has_more = counts[axes[0]] > grid.of_all ? 1 : 0;
    grid.take_turns(extents, counts);
    int exponent = 0;
    const double most = extents[axes[0]];
    if (most > 0 && most < 1e300) frexp(most, &exponent);
    const int shift = exponent < -126 ? 126 : -exponent;
    grid.prescale = float(ldexp(1.0, shift));
    grid.large = float(ldexp(most, shift) * kLarge);
    grid.large_bit = bits - 1;
    const float lows[3] = {centers.min.x, centers.min.y, centers.min.z};
    for (int k = 0; k < 3; ++k) {
      const double cells = double(uint32_t(1) << counts[k]);
      grid.origin[k] = lows[k] * grid.prescale;
      grid.scale[k] = counts[k] > 0 ? float(cells / ldexp(extents[k], shift)) : 0.0f;
      grid.last[k] = float(cells - 1);
    }
    return grid;
  }

  template <typename Key>
  UMBEL_HOST_DEVICE Key code(const Aabb& box) const {
    const Vec3 c = center(box), sides = box.max - box.min;
    const bool is_large =
        sides.x * prescale > large || sides.y * prescale > large || sides.z * prescale > large;
    return joined<Key>(cell(c.x, 0), cell(c.y, 1), cell(c.z, 2), is_large);
  }
#if UMBEL_BOX_VECTORS
  /// The same.
  template <typename Key>
  Key code(const Box4& box) const {
    const Float4 center = box.low * splat(0.5f) - box.negated_high * splat(0.5f);
    const Float4 x = (center * splat(prescale) - of(origin)) * of(scale);
    const Float4 below = min4(x, of(last));
    const Int4 cells = __builtin_convertvector(max4(below, splat(0.0f)), Int4);
    const Int4 longer = -(box.low + box.negated_high) * splat(prescale) > splat(large);
    const bool is_large = (longer[0] | longer[1] | longer[2]) != 0;
    if constexpr (sizeof(Key) > sizeof(uint32_t))
      return joined<Key>(uint32_t(cells[0]), uint32_t(cells[1]), uint32_t(cells[2]), is_large);
    else
      return joined(cells, is_large);
  }
#endif

 private:
#if UMBEL_BOX_VECTORS
  static Float4 of(const float* values) { return *reinterpret_cast<const Float4*>(values); }

  /// The bits of all axes are spread at once.
  uint32_t joined(Int4 cells, bool is_large) const {
    typedef uint32_t Words __attribute__((vector_size(16)));
    const auto words = std::bit_cast<Words>(cells);
    const Words all = spread_bits_of(words & ((1u << of_all) - 1));
    const uint32_t code =
        uint32_t(is_large) << large_bit | all[0] << turn[0] | all[1] << turn[1] | all[2] << turn[2];
    if (!has_more) return code;
    const Words above = words >> of_all;
    const Words pairs = spread_pairs_of(above & ((1u << of_two) - 1));
    const uint32_t two = pairs[longest] << longest_first | pairs[second] << (1 - longest_first);
    return code | two << 3 * of_all | (above[longest] >> of_two) << (3 * of_all + 2 * of_two);
  }
#endif
  template <typename Key>
  UMBEL_HOST_DEVICE Key joined(uint32_t x, uint32_t y, uint32_t z, bool is_large) const {
    const Key mask = (Key(1) << of_all) - 1;
    const Key all = spread_bits(Key(x) & mask) << turn[0] | spread_bits(Key(y) & mask) << turn[1] |
                    spread_bits(Key(z) & mask) << turn[2];
    const Key head = Key(is_large ? 1 : 0) << large_bit;
    if (!has_more) return head | all;
    const Key a = Key(longest == 0 ? x : longest == 1 ? y : z) >> of_all;
    const Key b = Key(second == 0 ? x : second == 1 ? y : z) >> of_all;
    const Key of_pair = (Key(1) << of_two) - 1;
    const Key two = spread_pairs(a & of_pair) << longest_first | spread_pairs(b)
                                                                     << (1 - longest_first);
    return head | all | two << 3 * of_all | (a >> of_two) << (3 * of_all + 2 * of_two);
  }
  /// None where it is NaN, which has no order, or the box is empty.
  UMBEL_HOST_DEVICE static double extent(float low, float high) {
    const double extent = double(high) - double(low);
    return extent > 0 ? extent : 0.0;
  }
  /// Orders three names by their values.
  UMBEL_HOST_DEVICE static void sort_falling(const double* values, uint32_t* names) {
    for (int pass = 0; pass < 2; ++pass)
      for (int k = 0; k < 2; ++k)
        if (values[names[k]] < values[names[k + 1]]) {
          const uint32_t name = names[k];
          names[k] = names[k + 1];
          names[k + 1] = name;
        }
  }
  /// Gives each bit to the axis with the longest cells; of equal ones to the first of `axes`.
  UMBEL_HOST_DEVICE static void share_out(const double* extents, const uint32_t* axes,
                                          uint32_t bits, uint32_t* counts) {
    double sides[3] = {extents[0], extents[1], extents[2]};
    for (uint32_t bit = 0; bit < bits; ++bit) {
      int chosen = -1;
      for (int i = 0; i < 3; ++i) {
        const auto k = int(axes[i]);
        if (counts[k] < kMostBits && sides[k] > 0 && (chosen < 0 || sides[k] > sides[chosen]))
          chosen = k;
      }
      if (chosen < 0) return;
      ++counts[chosen];
      sides[chosen] *= 0.5;
    }
  }
  /// Of bits that go together, that of the longest side is the highest.
  UMBEL_HOST_DEVICE void take_turns(const double* extents, const uint32_t* counts) {
    uint32_t axes[3] = {longest, second, 3 - longest - second};
    double sides[3];
    for (int k = 0; k < 3; ++k) sides[k] = ldexp(extents[k], int(of_all) - int(counts[k]));
    sort_falling(sides, axes);
    for (uint32_t k = 0; k < 3; ++k) turn[axes[k]] = 2 - k;
    longest_first = sides[second] > sides[longest] ? 0 : 1;
  }
  /// NaN falls into the last cell.
  UMBEL_HOST_DEVICE uint32_t cell(float center, int k) const {
    const float x = (center * prescale - origin[k]) * scale[k];
    const float below = x < last[k] ? x : last[k];
    return static_cast<uint32_t>(static_cast<int32_t>(below > 0 ? below : 0.0f));
  }
};

}  // namespace umbel::cluster
