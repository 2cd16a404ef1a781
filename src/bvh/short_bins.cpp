// Binning by integers: sums and minimums of integers do not depend on their order, so bins that
// several threads filled give the same tree.
#include "bvh/short_bins.hpp"

namespace umbel::bvh {
namespace {

void add_one(const ShortBox* box, ShortBox lowest, ShortBox factor, ShortBin* bins) {
  const ShortBox b = *box;
  const ShortBox at = multiply_high(center2(b) - lowest, factor);
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

ShortBinning::ShortBinning(const ShortBounds& bounds, const Frame& frame, uint32_t bins)
    : bounds_(bounds), unit_(frame.unit), pad_(splat(frame.longest * 0x1p-24f)), bins_(bins) {
  for (int axis = 0; axis < 3; ++axis) {
    const int low = bounds.centers[axis], range = -int(bounds.centers[axis + 4]) - low;
    // No more bins than there are places, so that the factor stays below one.
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
  // Neighbours often share a bin, and would wait for each other: two places take turns.
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

ShortCut ShortBinning::cheapest(const ShortBin* bins, uint32_t count) const {
  const auto areas = [&](const std::array<ShortBox, 3>& box) {
    return half_areas(steps_of(box[0]) * unit_ + pad_, steps_of(box[1]) * unit_ + pad_,
                      steps_of(box[2]) * unit_ + pad_);
  };
  std::array<Float4, kMaxBins> right_areas;
  std::array<ShortBox, 3> side = bins[bins_ - 1].box;
  for (uint32_t b = bins_ - 1;; --b) {
    right_areas[b] = areas(side);
    if (b == 1) break;
    for (int axis = 0; axis < 3; ++axis) side[axis] = join(side[axis], bins[b - 1].box[axis]);
  }
  // Where nothing is gained, all planes cost the same but for rounding.
  const Float4 e = steps_of(bounds_.box) * unit_ + pad_;
  Float4 best = splat((e[0] * e[1] + e[2] * (e[0] + e[1])) * float(count) * 0.99999f);
  Float4 best_left{};
  Int4 place{}, before{};
  side.fill(empty_short_box());
  const int all = static_cast<int>(count);
  for (uint32_t b = 1; b < bins_; ++b) {
    const ShortBin& bin = bins[b - 1];
    Int4 counts;
    std::memcpy(&counts, bin.count.data(), sizeof counts);
    before += counts;
    for (int axis = 0; axis < 3; ++axis) side[axis] = join(side[axis], bin.box[axis]);
    const Float4 left = areas(side);
    const Float4 cost =
        left * __builtin_convertvector(before, Float4) +
        right_areas[b] * __builtin_convertvector(Int4{all, all, all, all} - before, Float4);
    const Int4 better = Int4(cost < best);
    best_left = Float4((Int4(left) & better) | (Int4(best_left) & ~better));
    best = min4(cost, best);
    const int at = static_cast<int>(b);
    place = (Int4{at, at, at, at} & better) | (place & ~better);
  }
  ShortCut cut;
  for (int axis = 0; axis < 3; ++axis)
    if (place[axis] && (cut.axis < 0 || best[axis] < best[cut.axis])) cut.axis = axis;
  if (cut.axis < 0) return cut;
  cut.bin = static_cast<uint32_t>(place[cut.axis]);
  const uint32_t factor = uint16_t(factor_[cut.axis]);
  cut.threshold = int(lowest_[cut.axis]) + int(((cut.bin << 16) + factor - 1) / factor);
  cut.left_count = left_count(bins, cut);
  cut.left_area = best_left[cut.axis];
  cut.right_area = right_areas[cut.bin][cut.axis];
  return cut;
}

uint32_t ShortBinning::left_count(const ShortBin* bins, const ShortCut& cut) {
  uint32_t count = 0;
  for (uint32_t b = 0; b < cut.bin; ++b) count += bins[b].count[cut.axis];
  return count;
}

void partition(const ShortBox* boxes, uint32_t count, const ShortCut& cut, ShortBox* left,
               ShortBox* right) {
  const auto* coordinates = reinterpret_cast<const int16_t*>(boxes) + cut.axis;
  for (uint32_t i = 0; i < count; ++i) {
    const bool goes_left = int(coordinates[8 * i]) - int(coordinates[8 * i + 4]) < cut.threshold;
    *(goes_left ? left : right) = boxes[i];
    left += goes_left;
    right += !goes_left;
  }
}

}  // namespace umbel::bvh
