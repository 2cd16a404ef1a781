// Binning by integers: sums and minimums of integers do not depend on their order, so bins that
// several threads filled give the same tree.
#include "bvh/build/short_bins.hpp"

#include <algorithm>
#include <bit>
#include <memory>

#include "base/parallel.hpp"
#include "base/radix_sort.hpp"

namespace umbel::bvh {
namespace {

// A split between two planes is searched where it may cost less than this part of the cheapest
// plane's cost. One gets trees as good as the full sweep's at three times the search; much less
// than this gives trees that cost 3 % more now and then.
constexpr float kPromising = 0.97f;

void add_one(const ShortBox* box, ShortBox lowest, ShortBox factor, ShortBin* bins) {
  const ShortBox b = *box;
  const UShort8 at = multiply_high(UShort8(difference(center2(b), lowest)), UShort8(factor));
  for (int axis = 0; axis < 3; ++axis) {
    ShortBin& bin = bins[uint16_t(at[axis])];
    bin.box[axis] = join(bin.box[axis], b);
    ++bin.count[axis];
  }
}

}  // namespace

ShortBounds bounds_of(const ShortBox* boxes, uint32_t count) {
  ShortBounds bounds;
  for (uint32_t i = 0; i < count; ++i) {
    bounds.box = join(bounds.box, boxes[i]);
    bounds.centers = join(bounds.centers, center2(boxes[i]));
  }
  return bounds;
}

ShortBinning::ShortBinning(const ShortBounds& bounds, const ShortBoxGrid& grid, uint32_t bins)
    : bounds_(bounds), unit_(grid.unit), pad_(splat(grid.longest * 0x1p-24f)), bins_(bins) {
  for (int axis = 0; axis < 3; ++axis) {
    const int low = bounds.centers[axis], range = -int(bounds.centers[axis + 4]) - low;
    // No more bins than there are steps, so that the factor stays below one.
    const int used = std::min(int(bins), range);
    lowest_[axis] = int16_t(low);
    factor_[axis] = int16_t((used << 16) / (range + 1));
  }
}

void ShortBinning::clear(ShortBin* bins) const {
  for (uint32_t b = 0; b < bins_; ++b) {
    bins[b].box.fill(empty_short_box());
    bins[b].count.fill(0);
  }
}

void ShortBinning::add(const ShortBox* boxes, uint32_t count, ShortBin* bins) const {
  // Neighbours often share a bin, and would wait for each other: two sums take turns.
  const uint32_t half = count / 2;
  for (uint32_t i = 0; i < half; ++i) {
    add_one(boxes + i, lowest_, factor_, bins);
    add_one(boxes + half + i, lowest_, factor_, bins);
  }
  if (count % 2) add_one(boxes + count - 1, lowest_, factor_, bins);
}

void ShortBinning::merge(const ShortBin* from, ShortBin* into) const {
  for (uint32_t b = 0; b < bins_; ++b) {
    for (int axis = 0; axis < 3; ++axis) {
      into[b].box[axis] = join(into[b].box[axis], from[b].box[axis]);
      into[b].count[axis] += from[b].count[axis];
    }
  }
}

float ShortBinning::half_area(ShortBox box) const {
  const Float4 e = steps_of(box) * unit_ + pad_;
  return e[0] * e[1] + e[2] * (e[0] + e[1]);
}

/// The lowest centre, doubled, that is not below bin `bin`.
int ShortBinning::edge(uint32_t bin, int axis) const {
  // Nothing is split along an axis without extent, whose factor is 0.
  const uint32_t factor = std::max<uint32_t>(uint16_t(factor_[axis]), 1);
  return int(lowest_[axis]) + int(((bin << 16) + factor - 1) / factor);
}

ShortSplit ShortBinning::cheapest(const ShortBin* bins, uint32_t count, ShortPlanes& planes) const {
  const auto areas = [&](const std::array<ShortBox, 3>& box) {
    return half_areas(steps_of(box[0]) * unit_ + pad_, steps_of(box[1]) * unit_ + pad_,
                      steps_of(box[2]) * unit_ + pad_);
  };
  std::array<ShortBox, 3> side;
  side.fill(empty_short_box());
  planes.right_area[bins_] = Float4{};
  for (uint32_t b = bins_ - 1; b > 0; --b) {
    for (int axis = 0; axis < 3; ++axis) side[axis] = join(side[axis], bins[b].box[axis]);
    planes.right_area[b] = areas(side);
  }
  // Where nothing is gained, all planes cost the same, up to rounding.
  Float4 best = splat(half_area(bounds_.box) * float(count) * 0.99999f);
  Int4 plane{}, before{};
  planes.left_area[0] = Float4{};
  planes.before[0] = before;
  side.fill(empty_short_box());
  const int all = static_cast<int>(count);
  for (uint32_t b = 1; b < bins_; ++b) {
    const ShortBin& bin = bins[b - 1];
    Int4 counts;
    std::memcpy(&counts, bin.count.data(), sizeof counts);
    before += counts;
    for (int axis = 0; axis < 3; ++axis) side[axis] = join(side[axis], bin.box[axis]);
    const Float4 left = areas(side);
    planes.left_area[b] = left;
    planes.before[b] = before;
    const Float4 cost =
        left * __builtin_convertvector(before, Float4) +
        planes.right_area[b] * __builtin_convertvector(Int4{all, all, all, all} - before, Float4);
    const Int4 better = Int4(cost < best);
    best = min4(cost, best);
    const int at = static_cast<int>(b);
    plane = (Int4{at, at, at, at} & better) | (plane & ~better);
  }
  planes.before[bins_] = Int4{all, all, all, all};
  ShortSplit split;
  split.cost = best[3];
  for (int axis = 0; axis < 3; ++axis)
    if (plane[axis] && (split.axis < 0 || best[axis] < best[split.axis])) split.axis = axis;
  if (split.axis < 0) {
    split.cost = best[0];
    return split;
  }
  const auto b = static_cast<uint32_t>(plane[split.axis]);
  split.cost = best[split.axis];
  split.threshold = edge(b, split.axis);
  split.left_count = static_cast<uint32_t>(planes.before[b][split.axis]);
  split.left_area = planes.left_area[b][split.axis];
  split.right_area = planes.right_area[b][split.axis];
  return split;
}

ShortWindows ShortBinning::windows(const ShortPlanes& planes, uint32_t count,
                                   const ShortSplit& split) const {
  ShortWindows w;
  w.low = w.high = ShortBox{} + int16_t(-32768);
  const float most = split.cost * kPromising;
  const int all = static_cast<int>(count);
  for (uint32_t b = 0; b < bins_; ++b) {
    // Left of a split in this bin lies at least what lies left of the bin, and so on the right.
    const Float4 left = __builtin_convertvector(planes.before[b], Float4);
    const Float4 right =
        __builtin_convertvector(Int4{all, all, all, all} - planes.before[b + 1], Float4);
    const Float4 bound = planes.left_area[b] * left + planes.right_area[b + 1] * right;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(bound[axis] < most) || factor_[axis] == 0 ||
          planes.before[b + 1][axis] - planes.before[b][axis] < 2)
        continue;
      if (w.last_bin[axis] == 0) w.first_bin[axis] = b;
      w.last_bin[axis] = b + 1;
      w.any = true;
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (w.last_bin[axis] == 0) continue;
    w.low[axis] = int16_t(edge(w.first_bin[axis], axis));
    w.high[axis] = int16_t(std::min(edge(w.last_bin[axis], axis), 32767));
  }
  return w;
}

void ShortBinning::collect(const ShortBox* boxes, uint32_t first, uint32_t count,
                           const ShortWindows& windows, ShortItems& items) {
  for (uint32_t i = 0; i < count; ++i) {
    const ShortBox c = center2(boxes[i]);
    const ShortBox inside = ShortBox(windows.high > c) & ~ShortBox(windows.low > c);
#if defined(__SSE2__)
    if ((_mm_movemask_epi8(__m128i(inside)) & 0x3f) == 0) continue;
#endif
    for (int axis = 0; axis < 3; ++axis)
      if (inside[axis])
        items[axis].push_back(uint64_t(uint32_t(int(c[axis]) - int(windows.low[axis]))) << 32 |
                              (first + i));
  }
}

ShortSplit ShortBinning::search(const ShortBox* boxes, const ShortBin* bins, uint32_t count,
                                const ShortPlanes& planes, const ShortWindows& windows,
                                ShortItems& items, ShortSplit split) const {
  constexpr size_t kMany = size_t(1) << 15;
  std::array<ShortSplit, 3> found;
  const size_t all = items[0].size() + items[1].size() + items[2].size();
  parallel_for(3, all < kMany ? 3 : 1, [&](size_t axis) {
    found[axis] = search_axis(int(axis), boxes, bins, count, planes, windows, items[axis], split);
  });
  for (const ShortSplit& best : found)
    if (best.cost < split.cost) split = best;
  return split;
}

ShortSplit ShortBinning::search_axis(int axis, const ShortBox* boxes, const ShortBin* bins,
                                     uint32_t count, const ShortPlanes& planes,
                                     const ShortWindows& windows, std::vector<uint64_t>& items,
                                     ShortSplit split) const {
  const size_t n = items.size();
  if (n < 2) return split;
  const auto spare = std::make_unique_for_overwrite<uint64_t[]>(n);
  const auto right_areas = std::make_unique_for_overwrite<float[]>(n);
  const uint32_t bits = std::bit_width(uint32_t(windows.high[axis] - windows.low[axis]));
  const uint64_t* sorted = radix_sort(items.data(), spare.get(), n, 32, 32 + bits);
  const auto box_at = [&](size_t i) { return boxes[uint32_t(sorted[i])]; };
  ShortBox side = empty_short_box();
  for (uint32_t b = windows.last_bin[axis]; b < bins_; ++b) side = join(side, bins[b].box[axis]);
  for (size_t i = n - 1; i > 0; --i) {
    side = join(side, box_at(i));
    right_areas[i] = half_area(side);
  }
  side = empty_short_box();
  for (uint32_t b = 0; b < windows.first_bin[axis]; ++b) side = join(side, bins[b].box[axis]);
  const auto before = static_cast<uint32_t>(planes.before[windows.first_bin[axis]][axis]);
  for (size_t i = 1; i < n; ++i) {
    side = join(side, box_at(i - 1));
    if (sorted[i - 1] >> 32 == sorted[i] >> 32) continue;
    const uint32_t left = before + uint32_t(i);
    const float area = half_area(side);
    const float cost = area * float(left) + right_areas[i] * float(count - left);
    if (!(cost < split.cost)) continue;
    split.axis = axis;
    split.threshold = int(windows.low[axis]) + int(sorted[i] >> 32);
    split.cost = cost;
    split.left_count = left;
    split.left_area = area;
    split.right_area = right_areas[i];
  }
  return split;
}

uint32_t count_left(const ShortBox* boxes, uint32_t count, const ShortSplit& split) {
  uint32_t left = 0;
  for (uint32_t i = 0; i < count; ++i) left += split.is_left(boxes[i]);
  return left;
}

void partition(const ShortBox* boxes, uint32_t count, const ShortSplit& split, ShortBox* left,
               ShortBox* right) {
  const auto* coordinates = reinterpret_cast<const int16_t*>(boxes) + split.axis;
  for (uint32_t i = 0; i < count; ++i) {
    const bool goes_left = int(coordinates[8 * i]) - int(coordinates[8 * i + 4]) < split.threshold;
    *(goes_left ? left : right) = boxes[i];
    left += goes_left;
    right += !goes_left;
  }
}

}  // namespace umbel::bvh
