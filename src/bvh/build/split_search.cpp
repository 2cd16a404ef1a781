// Object splits: by centroids, in bins, or of a few references by a full sweep.
#include "bvh/build/split_search.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "base/cpu_buffer.hpp"
#include "bvh/build/clip_triangle.hpp"
#include "bvh/build/split_bins.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kPartitionBins = 64;
constexpr uint32_t kMostSwept = 16;

template <uint32_t bins>
struct PartitionBins {
  Box4 box[3][bins];
  AxisCounts count[bins] = {};

  PartitionBins() {
    for (auto& axis : box) std::fill(axis, axis + bins, Box4::empty());
  }
  void join(const PartitionBins& o) {
    for (uint32_t b = 0; b < bins; ++b) {
      for (int a = 0; a < 3; ++a) {
        box[a][b].extend(o.box[a][b]);
        count[b][a] += o.count[b][a];
      }
    }
  }
};

template <uint32_t bins>
Split partition_by_bins(const Box4* references, uint32_t count, const NodeBounds& bounds) {
  using Bins = PartitionBins<bins>;
  const BinGrid grid(bounds.centers, bins);
  const Bins all = accumulate<Bins>(count, [&](Bins& part, uint32_t begin, uint32_t end) {
    for (uint32_t i = begin; i < end; ++i) {
      const Box4 box = references[i];
      const Int4 bin = grid.of(box.center2());
      for (int a = 0; a < 3; ++a) {
        part.box[a][bin[a]].extend(box);
        ++part.count[bin[a]][a];
      }
    }
  });
  Split best;
  best.origin = grid.origin;
  best.scale = grid.scale;
  sweep_bins(all.box, all.count, all.count, bins, bounds.pad, best);
  return best;
}

using Orders = std::array<std::array<uint8_t, kMostSwept>, 3>;

/// A few references by their centres along each axis: the rank of a centre is the number of smaller
/// ones, few enough to count them all. Of equal ones the earlier comes first.
Orders orders_of(const Box4* references, uint32_t count) {
  alignas(16) std::array<std::array<float, kMostSwept>, 3> centers{};
  for (uint32_t i = 0; i < count; ++i) {
    const Float4 center = references[i].center2();
    for (int axis = 0; axis < 3; ++axis) centers[axis][i] = center[axis];
  }
  const uint32_t vectors = (count + 3) / 4;
  Orders orders;
  for (int axis = 0; axis < 3; ++axis) {
    const std::array<float, kMostSwept>& center = centers[axis];
    alignas(16) std::array<int32_t, kMostSwept> smaller;
    for (uint32_t v = 0; v < vectors; ++v) {
      const Float4 own = load4(&center[4 * size_t(v)]);
      Int4 counts{};
      for (uint32_t k = 0; k < count; ++k) counts -= Int4(own > splat(center[k]));
      std::memcpy(&smaller[4 * size_t(v)], &counts, sizeof counts);
    }
    uint32_t taken = 0;
    for (uint32_t i = 0; i < count; ++i) {
      auto rank = static_cast<uint32_t>(smaller[i]);
      while (taken >> rank & 1u) ++rank;
      taken |= 1u << rank;
      orders[axis][rank] = static_cast<uint8_t>(i);
    }
  }
  return orders;
}

/// All partitions of a few references by their centres, on the three axes in the lanes of vectors.
Split partition_by_sweep(const Box4* references, uint32_t count, Float4 pad) {
  const Orders orders = orders_of(references, count);
  const auto extend = [&](SplitSides& side, uint32_t i) {
    for (int axis = 0; axis < 3; ++axis) side.box[axis].extend(references[orders[axis][i]]);
  };
  std::array<Float4, kMostSwept> right_areas;
  SplitSides side;
  for (uint32_t i = count - 1; i > 0; --i) {
    extend(side, i);
    right_areas[i] = side.areas(pad);
  }
  side = {};
  Float4 least = splat(std::numeric_limits<float>::infinity());
  Int4 position{};
  for (uint32_t i = 1; i < count; ++i) {
    extend(side, i - 1);
    const Float4 cost =
        side.areas(pad) * splat(float(i)) + right_areas[i] * splat(float(count - i));
    const Int4 better = Int4(cost < least);
    least = min4(cost, least);
    const int at = static_cast<int>(i);
    position = (Int4{at, at, at, at} & better) | (position & ~better);
  }
  Split best;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(least[axis] < best.cost)) continue;
    best.cost = least[axis];
    best.axis = axis;
  }
  if (best.axis < 0) return best;
  for (int i = 0; i < position[best.axis]; ++i) best.mask |= 1u << orders[best.axis][i];
  best.left_box = best.right_box = Box4::empty();
  for (uint32_t i = 0; i < count; ++i)
    (best.mask >> i & 1 ? best.left_box : best.right_box).extend(references[i]);
  return best;
}

uint32_t bins_for(uint32_t count) { return count < 256 ? 16 : kPartitionBins; }

}  // namespace

Box4* scratch_for(size_t count) {
  thread_local CpuBuffer<Box4> scratch;
  if (scratch.size() < count) scratch = CpuBuffer<Box4>(count);
  return scratch.data();
}

NodeBounds bounds_of(const Box4* references, uint32_t count) {
  const SplitBounds all =
      accumulate<SplitBounds>(count, [&](SplitBounds& part, uint32_t begin, uint32_t end) {
        for (uint32_t i = begin; i < end; ++i) {
          const Float4 center = references[i].center2();
          part.box.extend(references[i]);
          part.centers.extend({center, -center});
        }
      });
  return {all.box, all.centers, all.box.pad()};
}

Split best_partition(const Box4* references, uint32_t count, const NodeBounds& bounds) {
  Split best = count <= kMostSwept ? partition_by_sweep(references, count, bounds.pad)
               : bins_for(count) == 16
                   ? partition_by_bins<16>(references, count, bounds)
                   : partition_by_bins<kPartitionBins>(references, count, bounds);
  if (best.axis < 0) return best;
  const Box4 both = intersection(best.left_box, best.right_box);
  best.overlap = is_empty(both) ? 0 : both.half_area(bounds.pad);
  return best;
}

/// Keeps the references for which is_left(i) is 1, and moves the others to `right`.
template <typename IsLeft>
Halves halves_by(Box4* references, uint32_t count, Box4* right, const IsLeft& is_left) {
  uint32_t left_count = 0, right_count = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t left = is_left(i);
    const Box4 reference = references[i];
    references[left_count] = reference;
    right[right_count] = reference;
    left_count += left;
    right_count += 1 - left;
  }
  return {left_count, right_count, right};
}

Halves partition_references(Box4* references, uint32_t count, const Split& split) {
  Box4* right = scratch_for(count);
  if (split.axis < 0) {
    const uint32_t half = count / 2;
    std::copy(references + half, references + count, right);
    return {half, count - half, right};
  }
  if (split.mask != 0)
    return halves_by(references, count, right, [&](uint32_t i) { return split.mask >> i & 1u; });
  const float origin = split.origin[split.axis], scale = split.scale[split.axis];
  const float* const low = reinterpret_cast<const float*>(references) + split.axis;
  return halves_by(references, count, right, [&](uint32_t i) {
    const float center = low[8 * size_t(i)] - low[8 * size_t(i) + 4];
    return uint32_t(int32_t((center - origin) * scale) < int32_t(split.bin));
  });
}

const Box4* copy_to_scratch(const Box4* references, uint32_t count) {
  Box4* scratch = scratch_for(count);
  std::copy(references, references + count, scratch);
  return scratch;
}

}  // namespace umbel::bvh
