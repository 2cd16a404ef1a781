// What both searches for splits of references share: bins, chunks of work, and the sweep over bins.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "base/parallel.hpp"
#include "base/simd/short_box.hpp"
#include "bvh/build/split_search.hpp"

namespace umbel::bvh {

inline constexpr uint32_t kSplitChunk = 1u << 14;  ///< references of a unit of work

/// This thread's memory for the references that leave their array; the next call may move it.
Box4* scratch_for(size_t count);

/// add(result, begin, end) over fixed chunks of references, whose results are joined in their
/// order.
template <typename Result, typename Add>
static Result accumulate(uint32_t count, const Add& add) {
  Result all;
  if (count <= kSplitChunk) {
    add(all, 0u, count);
    return all;
  }
  std::vector<Result> parts((count + kSplitChunk - 1) / kSplitChunk);
  parallel_chunks(count, kSplitChunk, [&](size_t begin, size_t end) {
    add(parts[begin / kSplitChunk], static_cast<uint32_t>(begin), static_cast<uint32_t>(end));
  });
  for (const Result& part : parts) all.join(part);
  return all;
}

struct SplitBounds {
  Box4 box = Box4::empty(), centers = Box4::empty();
  void join(const SplitBounds& o) {
    box.extend(o.box);
    centers.extend(o.centers);
  }
};

/// Bin numbers of three axes at once; never out of range, whatever rounding does.
struct BinGrid {
  Float4 origin, scale;
  int32_t last;

  BinGrid(const Box4& box, uint32_t bins) : origin(box.low), last(int32_t(bins) - 1) {
    const Float4 extents = box.extents();
    // Shorter sides have no reciprocal, and are as good as none.
    for (int a = 0; a < 4; ++a)
      scale[a] = a < 3 && extents[a] > 1e-36f ? float(bins) / extents[a] : 0;
  }
  BinGrid(const Split& split, uint32_t bins)
      : origin(split.origin), scale(split.scale), last(int32_t(bins) - 1) {}

  Int4 of(Float4 at) const {
    const Float4 bin = min4((at - origin) * scale, splat(float(last)));
    return __builtin_convertvector(max4(bin, splat(0)), Int4);
  }
  int32_t of(Float4 at, int axis) const {
    const auto bin = static_cast<int32_t>((at[axis] - origin[axis]) * scale[axis]);
    return std::clamp(bin, 0, last);
  }
};

/// References of the three axes.
using AxisCounts = std::array<uint32_t, 4>;

inline Int4 lanes_of(const AxisCounts& counts) {
  Int4 lanes;
  std::memcpy(&lanes, counts.data(), sizeof lanes);
  return lanes;
}

/// One side of a plane on each axis.
struct SplitSides {
  Box4 box[3] = {Box4::empty(), Box4::empty(), Box4::empty()};
  Float4 areas(Float4 pad) const {
    return half_areas(box[0].extents() + pad, box[1].extents() + pad, box[2].extents() + pad);
  }
};

/// The cheapest plane between bins, the axes in the lanes of vectors. References on its left are
/// counted by where they begin, the others by where they end.
template <uint32_t most>
static void sweep_bins(const Box4 (&box)[3][most], const AxisCounts* enter, const AxisCounts* leave,
                       uint32_t bins, Float4 pad, Split& best) {
  const auto extend = [&](SplitSides& side, uint32_t b) {
    for (int a = 0; a < 3; ++a) side.box[a].extend(box[a][b]);
  };
  Float4 right_cost[most];
  SplitSides side;
  Int4 count{};
  // An empty box has an infinite area, which times 0 is NaN, and NaN is below nothing.
  for (uint32_t b = bins - 1; b > 0; --b) {
    extend(side, b);
    count += lanes_of(leave[b]);
    right_cost[b] = side.areas(pad) * __builtin_convertvector(count, Float4);
  }
  side = {};
  count = Int4{};
  Float4 least = splat(std::numeric_limits<float>::infinity());
  Int4 plane{};
  for (uint32_t b = 1; b < bins; ++b) {
    extend(side, b - 1);
    count += lanes_of(enter[b - 1]);
    const Float4 cost = side.areas(pad) * __builtin_convertvector(count, Float4) + right_cost[b];
    const Int4 better = Int4(cost < least);
    least = min4(cost, least);
    const int at = static_cast<int>(b);
    plane = (Int4{at, at, at, at} & better) | (plane & ~better);
  }
  for (int a = 0; a < 3; ++a) {
    if (!(best.scale[a] > 0) || !(least[a] < best.cost)) continue;
    best.cost = least[a];
    best.axis = a;
    best.bin = static_cast<uint32_t>(plane[a]);
  }
  if (best.axis < 0) return;
  best.left_box = best.right_box = Box4::empty();
  for (uint32_t b = 0; b < bins; ++b) {
    const bool is_left = b < best.bin;
    (is_left ? best.left_box : best.right_box).extend(box[best.axis][b]);
    (is_left ? best.left_count : best.right_count) += (is_left ? enter : leave)[b][best.axis];
  }
  best.left_area = best.left_box.half_area(pad);
  best.right_area = best.right_box.half_area(pad);
}

}  // namespace umbel::bvh
