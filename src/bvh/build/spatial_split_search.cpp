// Spatial splits (Stich, Friedrich & Dietrich, "Spatial Splits in Bounding Volume Hierarchies",
// 2009): chopped binning, and the references on both sides of the plane.
#include <algorithm>

#include "bvh/build/clip_triangle.hpp"
#include "bvh/build/split_bins.hpp"
#include "bvh/build/split_search.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kSpatialBins = 16;

struct SpatialBins {
  Box4 box[3][kSpatialBins];
  AxisCounts enter[kSpatialBins] = {}, leave[kSpatialBins] = {};

  SpatialBins() {
    for (auto& axis : box) std::fill(axis, axis + kSpatialBins, Box4::empty());
  }
  void join(const SpatialBins& o) {
    for (uint32_t b = 0; b < kSpatialBins; ++b) {
      for (int a = 0; a < 3; ++a) {
        box[a][b].extend(o.box[a][b]);
        enter[b][a] += o.enter[b][a];
        leave[b][a] += o.leave[b][a];
      }
    }
  }
};

/// Where planes across an axis meet a triangle. Without a margin for rounding: for estimates only.
class Slicer {
 public:
  Slicer(const Corners& corners, int axis) : axis_(axis) {
    const Float4 *low = &corners.at[0], *middle = &corners.at[1], *high = &corners.at[2];
    const auto order = [&](const Float4*& a, const Float4*& b) {
      if ((*b)[axis] < (*a)[axis]) std::swap(a, b);
    };
    order(low, middle);
    order(middle, high);
    order(low, middle);
    low_ = *low;
    middle_ = *middle;
    high_end_ = (*high)[axis];
    slope_ = slope(*low, *high);
    low_slope_ = slope(*low, *middle);
    high_slope_ = slope(*middle, *high);
  }

  Box4 at(float plane) const {
    const float s = std::clamp(plane, low_[axis_], high_end_);
    const Float4 p = low_ + slope_ * splat(s - low_[axis_]);
    const Float4 q = s < middle_[axis_] ? low_ + low_slope_ * splat(s - low_[axis_])
                                        : middle_ + high_slope_ * splat(s - middle_[axis_]);
    return {min4(p, q), min4(-p, -q)};
  }
  const Float4& middle() const { return middle_; }

 private:
  Float4 slope(Float4 from, Float4 to) const {
    const float along = to[axis_] - from[axis_];
    return along > 0 ? (to - from) * splat(1.0f / along) : splat(0);
  }

  int axis_;
  Float4 low_, middle_, slope_, low_slope_, high_slope_;
  float high_end_;
};

/// Adds a reference to one bin of an axis, or to two, without clipping, which is nearly as good.
/// Most references are such.
void add_halved(const Box4& reference, int axis, int32_t first, int32_t last, float origin,
                float width, SpatialBins& bins) {
  ++bins.enter[first][axis];
  ++bins.leave[last][axis];
  Box4 before = reference, behind = reference;
  if (first < last) {
    const float plane = origin + float(last) * width;
    before.negated_high = with_lane(before.negated_high, axis, -plane);
    behind.low = with_lane(behind.low, axis, plane);
    bins.box[axis][last].extend(behind);
  }
  bins.box[axis][first].extend(before);
}

/// Chopped binning: adds a reference to the bins of an axis from `first` to `last`, to each the
/// part that lies in it.
void add_chopped(const Box4& reference, const Corners& corners, int axis, int32_t first,
                 int32_t last, float origin, float width, SpatialBins& bins) {
  ++bins.enter[first][axis];
  ++bins.leave[last][axis];
  const Slicer slicer(corners, axis);
  const float middle = slicer.middle()[axis];
  float from = reference.low[axis];
  Box4 side = slicer.at(from);
  for (int32_t b = first; b <= last; ++b) {
    const float to = b < last ? origin + float(b + 1) * width : -reference.negated_high[axis];
    Box4 part = side;
    side = slicer.at(to);
    part.extend(side);
    if (from < middle && middle < to) part.extend({slicer.middle(), -slicer.middle()});
    part = intersection(part, reference);
    part.low = with_lane(part.low, axis, from);
    part.negated_high = with_lane(part.negated_high, axis, -to);
    if (!is_empty(part)) bins.box[axis][b].extend(part);
    from = to;
  }
}

uint32_t spatial_bins_for(uint32_t count) { return count < 16 ? 4 : count < 64 ? 8 : kSpatialBins; }

}  // namespace

Split best_spatial_split(const Box4* references, uint32_t count, const NodeBounds& bounds,
                         const MeshView& mesh) {
  const uint32_t bins = spatial_bins_for(count);
  const BinGrid grid(bounds.box, bins);
  const Float4 width = bounds.box.extents() * splat(1.0f / float(bins));
  const SpatialBins all =
      accumulate<SpatialBins>(count, [&](SpatialBins& part, uint32_t begin, uint32_t end) {
        for (uint32_t i = begin; i < end; ++i) {
          const Box4& box = references[i];
          const Int4 first = grid.of(box.low), last = grid.of(-box.negated_high);
          const bool whole = first[0] == last[0] && first[1] == last[1] && first[2] == last[2];
          if (whole) {
            for (int a = 0; a < 3; ++a) {
              part.box[a][first[a]].extend(box);
              ++part.enter[first[a]][a];
              ++part.leave[first[a]][a];
            }
            continue;
          }
          for (int a = 0; a < 3; ++a) {
            if (last[a] - first[a] < 2)
              add_halved(box, a, first[a], last[a], grid.origin[a], width[a], part);
            else
              add_chopped(box, Corners(mesh, triangle_of(box)), a, first[a], last[a],
                          grid.origin[a], width[a], part);
          }
        }
      });
  Split best;
  best.is_spatial = true;
  best.origin = grid.origin;
  best.scale = grid.scale;
  sweep_bins(all.box, all.enter, all.leave, bins, bounds.pad, best);
  if (best.axis < 0) return best;
  best.plane = grid.origin[best.axis] + float(best.bin) * width[best.axis];
  return best;
}

Halves split_references(Box4* references, uint32_t count, uint32_t spare, const Split& split,
                        const MeshView& mesh) {
  // The left half may outgrow what has been read, so both go to scratch memory first.
  Box4* left = scratch_for(2 * (size_t(count) + spare));
  Box4* right = left + count + spare;
  uint32_t left_count = 0, right_count = 0, splits_left = spare;
  const BinGrid grid(split, spatial_bins_for(count));
  const int axis = split.axis;
  const auto add = [&](const Box4& box, uint32_t tag, bool is_left) {
    (is_left ? left[left_count++] : right[right_count++]) = tagged(box, tag);
  };
  const float left_references = float(split.left_count),
              right_references = float(split.right_count);
  const float cost = split.left_area * left_references + split.right_area * right_references;
  const Float4 pad = splat(0);
  for (uint32_t i = 0; i < count; ++i) {
    const Box4 reference = references[i];
    const uint32_t tag = tag_of_reference(reference);
    const bool starts_left = grid.of(reference.low, axis) < int32_t(split.bin);
    const bool ends_left = grid.of(-reference.negated_high, axis) < int32_t(split.bin);
    if (starts_left == ends_left) {
      add(reference, tag, starts_left);
      continue;
    }
    Box4 before, behind;
    clip_triangle(Corners(mesh, triangle_of(reference)), reference, axis, split.plane, before,
                  behind);
    Box4 with_left = split.left_box, with_right = split.right_box;
    with_left.extend(reference);
    with_right.extend(reference);
    const float all_left =
        with_left.half_area(pad) * left_references + split.right_area * (right_references - 1);
    const float all_right =
        split.left_area * (left_references - 1) + with_right.half_area(pad) * right_references;
    const bool both = !is_empty(before) && !is_empty(behind);
    if (both && splits_left > 0 && cost < std::min(all_left, all_right)) {
      add(before, tag | kIsPart, true);
      add(behind, tag | kIsPart, false);
      --splits_left;
    } else if (!both) {
      add(reference, tag, !is_empty(before));
    } else {
      add(reference, tag, all_left <= all_right);
    }
  }
  if (left_count == 0 || right_count == 0) {
    // Left whole, all of them would be on one side.
    Box4* from = left_count == 0 ? right : left;
    const uint32_t n = left_count + right_count, half = n / 2;
    std::copy(from, from + half, references);
    return {half, n - half, from + half};
  }
  std::copy(left, left + left_count, references);
  return {left_count, right_count, right};
}

}  // namespace umbel::bvh
