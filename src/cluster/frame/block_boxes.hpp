// Boxes rounded to a grid of 2^15 cells over a block of triangles: all decisions about a block are
// made on integers, so every executor makes the same ones.
#pragma once

#include <bit>
#include <cstdint>

#include "base/math.hpp"
#include "base/team.hpp"
#include "cluster/frame/frame_mesh.hpp"

#if UMBEL_BOX_VECTORS
#include <emmintrin.h>
#endif

namespace umbel::cluster {

/// A BlockBox in whole words, which the lanes of a team can lower together.
struct WideBox {
  int32_t low[6];

  UMBEL_HOST_DEVICE static WideBox empty() {
    constexpr int32_t e = 32767;
    return {{e, e, e, e, e, e}};
  }
};

/// Minima and, from kHigh on, negated maxima, so that a union is a minimum of all. Where there are
/// vectors of the processor they fill one, whose fourth and last numbers are unused; on a device,
/// where shared memory is short, they are six.
struct alignas(UMBEL_BOX_VECTORS ? 16 : 4) BlockBox {
  static constexpr int16_t kEmpty = 32767;
  static constexpr int kHigh = UMBEL_BOX_VECTORS ? 4 : 3;

  int16_t low[2 * kHigh];

  UMBEL_HOST_DEVICE static BlockBox of(int16_t x, int16_t y, int16_t z, int16_t negated_high_x,
                                       int16_t negated_high_y, int16_t negated_high_z) {
    BlockBox box{};
    box.low[0] = x, box.low[1] = y, box.low[2] = z;
    box.low[kHigh] = negated_high_x;
    box.low[kHigh + 1] = negated_high_y;
    box.low[kHigh + 2] = negated_high_z;
    return box;
  }
  UMBEL_HOST_DEVICE static BlockBox empty() {
    BlockBox box;
    for (int16_t& plane : box.low) plane = kEmpty;
    return box;
  }
  UMBEL_HOST_DEVICE uint32_t extent(int axis) const {
    return uint32_t(-int32_t(low[axis + kHigh]) - int32_t(low[axis]));
  }
  /// The sum of both planes: twice the centre. Below 2^16.
  UMBEL_HOST_DEVICE uint32_t middle(int axis) const {
    return uint32_t(int32_t(low[axis]) - int32_t(low[axis + kHigh]));
  }
  /// Moves the planes to between those of `bounds`, and the upper ones not below the lower ones.
  /// Only what is not finite lies outside or has its planes swapped.
  UMBEL_HOST_DEVICE void keep_within(const BlockBox& bounds) {
    for (int k = 0; k < 3; ++k) {
      const int16_t last = int16_t(-bounds.low[k + kHigh]), upper = int16_t(-low[k + kHigh]);
      low[k] = low[k] < bounds.low[k] ? bounds.low[k] : low[k] > last ? last : low[k];
      low[k + kHigh] = int16_t(-(upper < low[k] ? low[k] : upper > last ? last : upper));
    }
  }
  UMBEL_HOST_DEVICE void join(const BlockBox& o) {
#if UMBEL_BOX_VECTORS
    store(_mm_min_epi16(load(), o.load()));
#else
    for (int k = 0; k < 2 * kHigh; ++k) low[k] = o.low[k] < low[k] ? o.low[k] : low[k];
#endif
  }
  UMBEL_HOST_DEVICE void join(const WideBox& o) {
    for (int k = 0; k < 6; ++k) {
      int16_t& mine = low[plane(k)];
      mine = o.low[k] < mine ? int16_t(o.low[k]) : mine;
    }
  }
  /// Where the planes of a WideBox are here.
  UMBEL_HOST_DEVICE static int plane(int k) { return k < 3 ? k : k - 3 + kHigh; }
#if UMBEL_BOX_VECTORS
  __m128i load() const { return _mm_load_si128(reinterpret_cast<const __m128i*>(low)); }
  void store(__m128i v) { _mm_store_si128(reinterpret_cast<__m128i*>(low), v); }
#endif
};

/// Half the surface area, of sides that are a cell longer: what is flat has an area too, of its
/// length. Below 2^32.
UMBEL_HOST_DEVICE inline uint64_t padded_area(const BlockBox& box) {
  const uint64_t x = box.extent(0) + 1, y = box.extent(1) + 1, z = box.extent(2) + 1;
  return x * y + z * (x + y);
}

/// Adds an item's box to what lanes of a team share.
template <typename Team>
UMBEL_HOST_DEVICE void join_shared(const Team&, BlockBox& into, const BlockBox& box) {
  into.join(box);
}
template <typename Team>
UMBEL_HOST_DEVICE void join_shared(const Team& team, WideBox& into, const BlockBox& box) {
  for (int k = 0; k < 6; ++k) team.lower(&into.low[k], int32_t(box.low[BlockBox::plane(k)]));
}

/// Rounds boxes to the grid over the bounds of a block.
struct BlockGrid {
  Vec3 origin;
  float scale;

  UMBEL_HOST_DEVICE static BlockGrid over(const Aabb& bounds) {
    const double x = double(bounds.max.x) - double(bounds.min.x),
                 y = double(bounds.max.y) - double(bounds.min.y),
                 z = double(bounds.max.z) - double(bounds.min.z);
    const double xy = x > y ? x : y, longest = xy > z ? xy : z;
    const double scale = longest > 0 ? 32760.0 / longest : 0.0;
    return {bounds.min, float(scale < 3e38 ? scale : 3e38)};
  }
  /// All of it.
  UMBEL_HOST_DEVICE static BlockBox whole() {
    constexpr auto last = int16_t(kLast);
    return BlockBox::of(0, 0, 0, -last, -last, -last);
  }
  UMBEL_HOST_DEVICE int16_t cell(float p, float from) const {
    const float x = (p * 0.5f - from * 0.5f) * scale * 2.0f;
    const float below = x < kLast ? x : kLast;
    return static_cast<int16_t>(below > 0 ? below : 0.0f);
  }
  UMBEL_HOST_DEVICE BlockBox round(const Aabb& box) const {
    return BlockBox::of(cell(box.min.x, origin.x), cell(box.min.y, origin.y),
                        cell(box.min.z, origin.z), int16_t(-cell(box.max.x, origin.x)),
                        int16_t(-cell(box.max.y, origin.y)), int16_t(-cell(box.max.z, origin.z)));
  }
  UMBEL_HOST_DEVICE BlockBox round(const FrameMesh& mesh, uint32_t triangle) const {
#if UMBEL_BOX_VECTORS
    const Box4 box = mesh.record(triangle);
    BlockBox result;
    result.store(_mm_packs_epi32(cells(box.low),
                                 _mm_sub_epi32(_mm_setzero_si128(), cells(-box.negated_high))));
    return result;
#else
    return round(mesh.box(triangle));
#endif
  }

 private:
  static constexpr float kLast = 32766.0f;

#if UMBEL_BOX_VECTORS
  __m128i cells(Float4 p) const {
    const Float4 from{origin.x, origin.y, origin.z, 0};
    const Float4 x = (p * splat(0.5f) - from * splat(0.5f)) * splat(scale) * splat(2.0f);
    const Float4 inside = max4(min4(x, splat(kLast)), splat(0.0f));
    return _mm_cvttps_epi32(std::bit_cast<__m128>(inside * Float4{1, 1, 1, 0}));
  }
#endif
};

}  // namespace umbel::cluster
