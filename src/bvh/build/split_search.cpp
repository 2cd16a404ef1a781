#include "bvh/build/split_search.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "base/cpu_buffer.hpp"
#include "base/parallel.hpp"
#include "base/simd/short_box.hpp"
#include "bvh/build/clip_triangle.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kPartitionBins = 64;
constexpr uint32_t kCutBins = 16;
constexpr uint32_t kSweepMost = 16;
constexpr uint32_t kChunk = 1u << 14;

/// add(result, begin, end) over fixed chunks, whose results are joined in their order.
template <typename Result, typename Add>
Result accumulate(uint32_t count, const Add& add) {
  Result all;
  if (count <= kChunk) {
    add(all, 0u, count);
    return all;
  }
  std::vector<Result> parts((count + kChunk - 1) / kChunk);
  parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
    add(parts[begin / kChunk], static_cast<uint32_t>(begin), static_cast<uint32_t>(end));
  });
  for (const Result& part : parts) all.join(part);
  return all;
}

struct Bounds {
  Box4 box = Box4::empty(), centers = Box4::empty();
  void join(const Bounds& o) {
    box.extend(o.box);
    centers.extend(o.centers);
  }
};

/// Bin numbers of three axes at once; never out of range, whatever rounding does.
struct Grid {
  Float4 origin, scale;
  int32_t last;

  Grid(const Box4& box, uint32_t bins) : origin(box.low), last(int32_t(bins) - 1) {
    const Float4 extents = box.extents();
    // Shorter sides have no reciprocal, and are as good as none.
    for (int a = 0; a < 4; ++a)
      scale[a] = a < 3 && extents[a] > 1e-36f ? float(bins) / extents[a] : 0;
  }
  Grid(const Split& split, uint32_t bins)
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
using Counts = std::array<uint32_t, 4>;

Int4 lanes_of(const Counts& counts) {
  Int4 lanes;
  std::memcpy(&lanes, counts.data(), sizeof lanes);
  return lanes;
}

template <uint32_t bins>
struct PartitionBins {
  Box4 box[3][bins];
  Counts count[bins] = {};

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

struct CutBins {
  Box4 box[3][kCutBins];
  Counts enter[kCutBins] = {}, leave[kCutBins] = {};

  CutBins() {
    for (auto& axis : box) std::fill(axis, axis + kCutBins, Box4::empty());
  }
  void join(const CutBins& o) {
    for (uint32_t b = 0; b < kCutBins; ++b) {
      for (int a = 0; a < 3; ++a) {
        box[a][b].extend(o.box[a][b]);
        enter[b][a] += o.enter[b][a];
        leave[b][a] += o.leave[b][a];
      }
    }
  }
};

/// One side of a plane on each axis.
struct Sides {
  Box4 box[3] = {Box4::empty(), Box4::empty(), Box4::empty()};
  Float4 areas(Float4 pad) const {
    return half_areas(box[0].extents() + pad, box[1].extents() + pad, box[2].extents() + pad);
  }
};

/// The cheapest plane between bins, the axes in the lanes of vectors. References on its left are
/// counted by where they begin, the others by where they end.
template <uint32_t most>
void sweep_bins(const Box4 (&box)[3][most], const Counts* enter, const Counts* leave, uint32_t bins,
                Float4 pad, Split& best) {
  const auto extend = [&](Sides& side, uint32_t b) {
    for (int a = 0; a < 3; ++a) side.box[a].extend(box[a][b]);
  };
  Float4 right_cost[most];
  Sides side;
  Int4 count{};
  // An empty box has an infinite area, which times nought is no number: less than nothing.
  for (uint32_t b = bins - 1; b > 0; --b) {
    extend(side, b);
    count += lanes_of(leave[b]);
    right_cost[b] = side.areas(pad) * __builtin_convertvector(count, Float4);
  }
  side = {};
  count = Int4{};
  Float4 least = splat(std::numeric_limits<float>::infinity());
  Int4 place{};
  for (uint32_t b = 1; b < bins; ++b) {
    extend(side, b - 1);
    count += lanes_of(enter[b - 1]);
    const Float4 cost = side.areas(pad) * __builtin_convertvector(count, Float4) + right_cost[b];
    const Int4 better = Int4(cost < least);
    least = min4(cost, least);
    const int at = static_cast<int>(b);
    place = (Int4{at, at, at, at} & better) | (place & ~better);
  }
  for (int a = 0; a < 3; ++a) {
    if (!(best.scale[a] > 0) || !(least[a] < best.cost)) continue;
    best.cost = least[a];
    best.axis = a;
    best.bin = static_cast<uint32_t>(place[a]);
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

template <uint32_t bins>
Split partition_by_bins(const Box4* references, uint32_t count, const NodeBounds& bounds) {
  using Bins = PartitionBins<bins>;
  const Grid grid(bounds.centers, bins);
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

using Orders = std::array<std::array<uint8_t, kSweepMost>, 3>;

/// A few references by their centres along each axis: a place in the order is the number of smaller
/// centres, few enough to count them all. Of equal ones the earlier comes first.
Orders orders_of(const Box4* references, uint32_t count) {
  alignas(16) std::array<std::array<float, kSweepMost>, 3> centers{};
  for (uint32_t i = 0; i < count; ++i) {
    const Float4 center = references[i].center2();
    for (int axis = 0; axis < 3; ++axis) centers[axis][i] = center[axis];
  }
  const uint32_t vectors = (count + 3) / 4;
  Orders orders;
  for (int axis = 0; axis < 3; ++axis) {
    const std::array<float, kSweepMost>& center = centers[axis];
    alignas(16) std::array<int32_t, kSweepMost> smaller;
    for (uint32_t v = 0; v < vectors; ++v) {
      const Float4 own = load4(&center[4 * size_t(v)]);
      Int4 counts{};
      for (uint32_t k = 0; k < count; ++k) counts -= Int4(own > splat(center[k]));
      std::memcpy(&smaller[4 * size_t(v)], &counts, sizeof counts);
    }
    uint32_t taken = 0;
    for (uint32_t i = 0; i < count; ++i) {
      auto place = static_cast<uint32_t>(smaller[i]);
      while (taken >> place & 1u) ++place;
      taken |= 1u << place;
      orders[axis][place] = static_cast<uint8_t>(i);
    }
  }
  return orders;
}

/// All partitions of a few references by their centres, on the three axes in the lanes of vectors.
Split partition_by_sweep(const Box4* references, uint32_t count, Float4 pad) {
  const Orders orders = orders_of(references, count);
  const auto extend = [&](Sides& side, uint32_t i) {
    for (int axis = 0; axis < 3; ++axis) side.box[axis].extend(references[orders[axis][i]]);
  };
  std::array<Float4, kSweepMost> right_areas;
  Sides side;
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

/// Adds a reference to one bin of an axis, or to two: nearly as good as clipping, and most are
/// such.
void halve(const Box4& reference, int axis, int32_t first, int32_t last, float origin, float width,
           CutBins& bins) {
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

/// Adds a reference to the bins of an axis from `first` to `last`, one part to each.
void chop(const Box4& reference, const Corners& corners, int axis, int32_t first, int32_t last,
          float origin, float width, CutBins& bins) {
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

Box4* scratch_for(size_t count) {
  thread_local CpuBuffer<Box4> scratch;
  if (scratch.size() < count) scratch = CpuBuffer<Box4>(count);
  return scratch.data();
}

uint32_t cut_bins_for(uint32_t count) { return count < 16 ? 4 : count < 64 ? 8 : kCutBins; }
uint32_t bins_for(uint32_t count) { return count < 256 ? 16 : kPartitionBins; }

}  // namespace

NodeBounds bounds_of(const Box4* references, uint32_t count) {
  const Bounds all = accumulate<Bounds>(count, [&](Bounds& part, uint32_t begin, uint32_t end) {
    for (uint32_t i = begin; i < end; ++i) {
      const Float4 center = references[i].center2();
      part.box.extend(references[i]);
      part.centers.extend({center, -center});
    }
  });
  return {all.box, all.centers, all.box.pad()};
}

Split best_partition(const Box4* references, uint32_t count, const NodeBounds& bounds) {
  Split best = count <= kSweepMost ? partition_by_sweep(references, count, bounds.pad)
               : bins_for(count) == 16
                   ? partition_by_bins<16>(references, count, bounds)
                   : partition_by_bins<kPartitionBins>(references, count, bounds);
  if (best.axis < 0) return best;
  const Box4 both = intersection(best.left_box, best.right_box);
  best.overlap = is_empty(both) ? 0 : both.half_area(bounds.pad);
  return best;
}

Split best_cut(const Box4* references, uint32_t count, const NodeBounds& bounds,
               const MeshView& mesh) {
  const uint32_t bins = cut_bins_for(count);
  const Grid grid(bounds.box, bins);
  const Float4 width = bounds.box.extents() * splat(1.0f / float(bins));
  const CutBins all = accumulate<CutBins>(count, [&](CutBins& part, uint32_t begin, uint32_t end) {
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
          halve(box, a, first[a], last[a], grid.origin[a], width[a], part);
        else
          chop(box, Corners(mesh, triangle_of(box)), a, first[a], last[a], grid.origin[a], width[a],
               part);
      }
    }
  });
  Split best;
  best.is_cut = true;
  best.origin = grid.origin;
  best.scale = grid.scale;
  sweep_bins(all.box, all.enter, all.leave, bins, bounds.pad, best);
  if (best.axis < 0) return best;
  best.plane = grid.origin[best.axis] + float(best.bin) * width[best.axis];
  return best;
}

/// Keeps those that are left, of which is_left(i) says 1, and moves the others to `right`.
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

Halves cut_references(Box4* references, uint32_t count, uint32_t slack, const Split& split,
                      const MeshView& mesh) {
  // The left half may outgrow what has been read, so both go to scratch memory first.
  Box4* left = scratch_for(2 * (size_t(count) + slack));
  Box4* right = left + count + slack;
  uint32_t left_count = 0, right_count = 0, splits_left = slack;
  const Grid grid(split, cut_bins_for(count));
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

const Box4* copy_to_scratch(const Box4* references, uint32_t count) {
  Box4* scratch = scratch_for(count);
  std::copy(references, references + count, scratch);
  return scratch;
}

}  // namespace umbel::bvh
