// Bins over the centres of rounded boxes, and the cheapest of the planes between them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/simd/short_box.hpp"

namespace umbel::bvh {

inline constexpr uint32_t kMaxBins = 256;

/// What lies in the b-th bin of each axis.
struct alignas(64) ShortBin {
  std::array<ShortBox, 3> box;
  std::array<uint32_t, 4> count;
};

/// The union of some boxes, and of twice their centres with their negatives.
struct ShortBounds {
  ShortBox box = empty_short_box();
  ShortBox centers = empty_short_box();

  void extend(const ShortBounds& o) {
    box = join(box, o.box);
    centers = join(centers, o.centers);
  }
};

ShortBounds bounds_of(const ShortBox* boxes, uint32_t count);

/// A plane: boxes with twice the centre below `threshold` on `axis` are on the left. No plane is
/// better than none where `axis` is negative.
struct ShortSplit {
  int axis = -1;
  int threshold = 0;
  float cost = 0;  ///< half areas times counts
  uint32_t left_count = 0;
  float left_area = 0, right_area = 0;

  bool is_left(const ShortBox& b) const { return int(b[axis]) - int(b[axis + 4]) < threshold; }
};

/// For each plane b, the one below bin b: half areas on both sides, boxes on the left.
struct ShortPlanes {
  std::array<Float4, kMaxBins + 1> left_area, right_area;
  std::array<Int4, kMaxBins + 1> before;
};

/// Bins of each axis between whose planes there may be a better split, and their centres, doubled.
struct ShortWindows {
  std::array<uint32_t, 3> first_bin{}, last_bin{};
  ShortBox low, high;  ///< from low up to, but not with, high
  bool any = false;
};

/// The boxes in each axis' window: twice the centre, from the window's low on, above the index.
using ShortItems = std::array<std::vector<uint64_t>, 3>;

class ShortBinning {
 public:
  ShortBinning(const ShortBounds& bounds, const ShortBoxGrid& grid, uint32_t bins);

  void clear(ShortBin* bins) const;
  void add(const ShortBox* boxes, uint32_t count, ShortBin* bins) const;
  void merge(const ShortBin* from, ShortBin* into) const;
  /// The cheapest of the planes between bins.
  ShortSplit cheapest(const ShortBin* bins, uint32_t count, ShortPlanes& planes) const;

  /// Where a split between two planes may be cheaper than `split`.
  ShortWindows windows(const ShortPlanes& planes, uint32_t count, const ShortSplit& split) const;
  /// Appends the boxes in the windows; the first of `boxes` has the index `first`.
  static void collect(const ShortBox* boxes, uint32_t first, uint32_t count,
                      const ShortWindows& windows, ShortItems& items);
  /// The cheapest among `split` and all splits inside the windows. Sorts `items`.
  ShortSplit search(const ShortBox* boxes, const ShortBin* bins, uint32_t count,
                    const ShortPlanes& planes, const ShortWindows& windows, ShortItems& items,
                    ShortSplit split) const;

 private:
  ShortSplit search_axis(int axis, const ShortBox* boxes, const ShortBin* bins, uint32_t count,
                         const ShortPlanes& planes, const ShortWindows& windows,
                         std::vector<uint64_t>& items, ShortSplit split) const;
  int edge(uint32_t bin, int axis) const;
  float half_area(ShortBox box) const;

  ShortBounds bounds_;
  ShortBox lowest_{}, factor_{};
  Float4 unit_, pad_;
  uint32_t bins_;
};

uint32_t count_left(const ShortBox* boxes, uint32_t count, const ShortSplit& split);

/// Moves the boxes left of the split to `left`, the others to `right`, in the order that they have.
void partition(const ShortBox* boxes, uint32_t count, const ShortSplit& split, ShortBox* left,
               ShortBox* right);

}  // namespace umbel::bvh
