// Morton codes: the bits of three grid coordinates interleaved, x highest. And the order of boxes
// by the codes of their centres, from which every linear builder starts.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/exec.hpp"
#include "base/math.hpp"

namespace umbel {

/// Spreads the low 10 bits so that two zero bits follow each. `Words` is a word of 32 bits or a
/// vector of such.
template <typename Words>
UMBEL_HOST_DEVICE Words spread_bits_of(Words x) {
  x = (x | x << 16) & 0x030000ffu;
  x = (x | x << 8) & 0x0300f00fu;
  x = (x | x << 4) & 0x030c30c3u;
  return (x | x << 2) & 0x09249249u;
}
UMBEL_HOST_DEVICE inline uint32_t spread_bits(uint32_t x) { return spread_bits_of(x); }

/// Spreads the low 21 bits so that two zero bits follow each.
UMBEL_HOST_DEVICE inline uint64_t spread_bits(uint64_t x) {
  x = (x | x << 32) & 0x001f00000000ffffu;
  x = (x | x << 16) & 0x001f0000ff0000ffu;
  x = (x | x << 8) & 0x100f00f00f00f00fu;
  x = (x | x << 4) & 0x10c30c30c30c30c3u;
  x = (x | x << 2) & 0x1249249249249249u;
  return x;
}

/// A cubic grid of 2^bits cells an axis around points. Works on doubled centres (min + max).
struct MortonGrid {
  Vec3 origin;
  float scale;
  float last;

  /// `centers` is the box around the doubled centres.
  UMBEL_HOST_DEVICE static MortonGrid around(const Aabb& centers, uint32_t bits) {
    const Vec3 extent = centers.max - centers.min;
    const float xy = extent.x > extent.y ? extent.x : extent.y;
    const float longest = xy > extent.z ? xy : extent.z;
    const float cells = static_cast<float>(uint32_t(1) << bits);
    return {centers.min, longest > 0 ? cells / longest : 0.0f, cells - 1};
  }
  UMBEL_HOST_DEVICE uint32_t cell(float doubled, float low) const {
    const float x = (doubled - low) * scale;
    return static_cast<uint32_t>(static_cast<int32_t>(x < last ? x : last));
  }
  template <typename Key>
  UMBEL_HOST_DEVICE Key code(const Aabb& box) const {
    const Key x = cell(box.min.x + box.max.x, origin.x);
    const Key y = cell(box.min.y + box.max.y, origin.y);
    const Key z = cell(box.min.z + box.max.z, origin.z);
    return spread_bits(x) << 2 | spread_bits(y) << 1 | spread_bits(z);
  }
};

/// Primitives in the order of their codes; equal codes in the order of the primitives.
template <typename Exec, typename Key>
struct MortonOrder {
  typename Exec::template Buffer<Key> codes;
  typename Exec::template Buffer<uint32_t> primitives;
};

/// Codes of `bits` an axis: at most 10 for 32-bit keys, 21 for 64-bit ones. n > 0.
template <typename Key, typename Exec>
MortonOrder<Exec, Key> morton_order(Exec& exec, const Aabb* boxes, size_t n, uint32_t bits) {
  MortonOrder<Exec, Key> order{exec.template allocate<Key>(n), exec.template allocate<uint32_t>(n)};
  auto centers = exec.template allocate<Aabb>(1);
  exec.reduce(
      n, Aabb{},
      [=] UMBEL_DEVICE_LAMBDA(size_t i) {
        const Vec3 center = boxes[i].min + boxes[i].max;
        return Aabb{center, center};
      },
      [] UMBEL_DEVICE_LAMBDA(Aabb a, const Aabb& b) {
        extend(a, b);
        return a;
      },
      centers.data());
  exec.for_each(n, [=, around = centers.data(), codes = order.codes.data(),
                    primitives = order.primitives.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
    codes[i] = MortonGrid::around(*around, bits).template code<Key>(boxes[i]);
    primitives[i] = static_cast<uint32_t>(i);
  });
  exec.radix_sort_pairs(n, order.codes.data(), order.primitives.data(), 0u, 3 * bits);
  return order;
}

}  // namespace umbel
