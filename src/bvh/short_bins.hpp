// Bins over the centres of rounded boxes, and the cheapest of the planes between them.
#pragma once

#include <array>
#include <cstdint>

#include "bvh/short_box.hpp"

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
struct ShortCut {
  int axis = -1;
  int threshold = 0;
  uint32_t bin = 0;
  uint32_t left_count = 0;
  float left_area = 0, right_area = 0;

  bool is_left(const ShortBox& b) const { return int(b[axis]) - int(b[axis + 4]) < threshold; }
};

class ShortBinning {
 public:
  ShortBinning(const ShortBounds& bounds, const Frame& frame, uint32_t bins);

  uint32_t bins() const { return bins_; }
  void clear(ShortBin* bins) const;
  void add(const ShortBox* boxes, uint32_t count, ShortBin* bins) const;
  void merge(const ShortBin* from, ShortBin* into) const;
  ShortCut cheapest(const ShortBin* bins, uint32_t count) const;
  static uint32_t left_count(const ShortBin* bins, const ShortCut& cut);

 private:
  ShortBounds bounds_;
  ShortBox lowest_{}, factor_{};
  Float4 unit_, pad_;
  uint32_t bins_;
};

/// Moves the boxes left of the cut to `left`, the others to `right`, in the order that they have.
void partition(const ShortBox* boxes, uint32_t count, const ShortCut& cut, ShortBox* left,
               ShortBox* right);

}  // namespace umbel::bvh
