// Full-sweep SAH (see sweep_sah.cpp) on at most 32 primitives: the three axes side by side in the
// lanes of a vector, and sets of primitives as bits.
#include "bvh/build/small_sweep.hpp"

#include <cstring>
#include <limits>
#include <utility>

#include "base/simd/short_box.hpp"
#include "bvh/tree/config.hpp"

namespace umbel::bvh {
namespace {

// Negative, which does not matter to a product of two.
Float4 negated_extents(const Box4& b, Float4 pad) { return b.low + b.negated_high - pad; }

using Ranks = std::array<ShortBox, SmallSweep::kMost / 8>;

/// For each key of some vectors how many of the first `count` keys are smaller.
template <uint32_t vectors>
Ranks count_smaller(const ShortBox* keys, uint32_t count) {
  Ranks ranks{};
  const auto* const key = reinterpret_cast<const int16_t*>(keys);
  for (uint32_t k = 0; k < count; ++k) {
    const ShortBox own = ShortBox{} + key[k];
    for (uint32_t v = 0; v < vectors; ++v) ranks[v] -= ShortBox(keys[v] > own);
  }
  return ranks;
}

}  // namespace

BuiltSubtree SmallSweep::build(uint32_t count, uint32_t slot, uint32_t depth) {
  Box4 whole = Box4::empty(), centers = Box4::empty();
  for (uint32_t i = 0; i < count; ++i) {
    boxes_[i] = Box4::load(all_boxes_[ids_[i]]);
    const Float4 center = boxes_[i].center2();
    whole.extend(boxes_[i]);
    centers.extend({center, -center});
  }
  pad_ = whole.pad();
  for (uint32_t i = 0; i < count; ++i) areas_[i] = boxes_[i].half_area(pad_);
  if (count > 3)
    sort(count, centers);
  else
    for (uint32_t i = 0; i < count; ++i) orders_[0][i] = static_cast<uint8_t>(i);
  return split(0, count, slot, depth);
}

// The rank of a centre is the number of smaller ones: few enough to count them all. They are
// compared in 15 bits; of equal ones the earlier comes first.
void SmallSweep::sort(uint32_t count, const Box4& centers) {
  Float4 scale{};
  const Float4 extents = centers.extents();
  for (int axis = 0; axis < 3; ++axis)
    if (extents[axis] > 1e-30f) scale[axis] = 32767.0f / extents[axis];
  alignas(16) std::array<std::array<int16_t, kMost>, 3> keys;
  for (uint32_t i = 0; i < count; ++i) {
    const Int4 key = __builtin_convertvector((boxes_[i].center2() - centers.low) * scale, Int4);
    for (int axis = 0; axis < 3; ++axis) keys[axis][i] = static_cast<int16_t>(key[axis]);
  }
  const uint32_t vectors = (count + 7) / 8;
  for (int axis = 0; axis < 3; ++axis) {
    const auto* const key = reinterpret_cast<const ShortBox*>(keys[axis].data());
    Ranks ranks;
    if (vectors == 1)
      ranks = count_smaller<1>(key, count);
    else if (vectors == 2)
      ranks = count_smaller<2>(key, count);
    else if (vectors == 3)
      ranks = count_smaller<3>(key, count);
    else
      ranks = count_smaller<4>(key, count);
    uint32_t taken = 0;
    for (uint32_t i = 0; i < count; ++i) {
      auto rank = static_cast<uint32_t>(ranks[i / 8][i % 8]);
      while (taken >> rank & 1u) ++rank;
      taken |= 1u << rank;
      orders_[axis][rank] = static_cast<uint8_t>(i);
    }
  }
}

BuiltSubtree SmallSweep::single(uint32_t own, uint32_t slot) {
  out_.primitives[out_.primitive_count++] = ids_[own];
  return out_.make_leaf(slot, 1, boxes_[own], areas_[own]);
}

// Most nodes are pairs.
BuiltSubtree SmallSweep::pair(uint32_t a, uint32_t b, uint32_t slot) {
  if (areas_[a] < areas_[b]) std::swap(a, b);
  const uint32_t children = out_.add_pair();
  const BuiltSubtree left = single(a, children), right = single(b, children + 1);
  return out_.join(slot, children, 2, left, right, pad_);
}

// Of three there are as many ways to take one away.
BuiltSubtree SmallSweep::three(uint32_t begin, uint32_t slot) {
  std::array<uint32_t, 3> own;
  for (uint32_t i = 0; i < 3; ++i) own[i] = orders_[0][begin + i];
  Box4 a = boxes_[own[1]], b = boxes_[own[2]], c = boxes_[own[0]];
  a.extend(boxes_[own[2]]);
  b.extend(boxes_[own[0]]);
  c.extend(boxes_[own[1]]);
  const Float4 rest =
      half_areas(negated_extents(a, pad_), negated_extents(b, pad_), negated_extents(c, pad_));
  uint32_t alone = 0;
  float best = std::numeric_limits<float>::infinity();
  for (uint32_t i = 0; i < 3; ++i) {
    const float cost = areas_[own[i]] + 2 * rest[i];
    if (!(cost < best)) continue;
    best = cost;
    alone = i;
  }
  const uint32_t one = own[alone], two = own[alone == 0 ? 1 : 0], other = own[alone == 2 ? 1 : 2];
  const uint32_t children = out_.add_pair();
  BuiltSubtree left, right;
  if (areas_[one] >= rest[alone]) {
    left = single(one, children);
    right = pair(two, other, children + 1);
  } else {
    left = pair(two, other, children);
    right = single(one, children + 1);
  }
  return out_.join(slot, children, 3, left, right, pad_);
}

BuiltSubtree SmallSweep::split(uint32_t begin, uint32_t count, uint32_t slot, uint32_t depth) {
  const uint8_t* const own = orders_[0].data() + begin;
  if (count == 1) return single(own[0], slot);
  if (count == 2) return pair(own[0], own[1], slot);
  if (count == 3) return three(begin, slot);
  Choice choice = cheapest(begin, count);
  const uint32_t larger = std::max(choice.position, count - choice.position);
  if (!fits_depth(larger, out_.max_depth - depth - 1)) choice.position = count / 2;
  partition(begin, count, choice);
  const uint32_t children = out_.add_pair(), middle = begin + choice.position;
  BuiltSubtree left, right;
  if (choice.left_area >= choice.right_area) {
    left = split(begin, choice.position, children, depth + 1);
    right = split(middle, count - choice.position, children + 1, depth + 1);
  } else {
    right = split(middle, count - choice.position, children + 1, depth + 1);
    left = split(begin, choice.position, children, depth + 1);
  }
  return out_.join(slot, children, count, left, right, pad_);
}

SmallSweep::Choice SmallSweep::cheapest(uint32_t begin, uint32_t count) {
  const uint8_t *x = orders_[0].data() + begin, *y = orders_[1].data() + begin,
                *z = orders_[2].data() + begin;
  const auto areas = [&](const Box4& a, const Box4& b, const Box4& c) {
    return half_areas(negated_extents(a, pad_), negated_extents(b, pad_), negated_extents(c, pad_));
  };
  Box4 a = boxes_[x[count - 1]], b = boxes_[y[count - 1]], c = boxes_[z[count - 1]];
  for (uint32_t i = count - 1;; --i) {
    right_areas_[i] = areas(a, b, c);
    if (i == 1) break;
    a.extend(boxes_[x[i - 1]]);
    b.extend(boxes_[y[i - 1]]);
    c.extend(boxes_[z[i - 1]]);
  }
  a = boxes_[x[0]], b = boxes_[y[0]], c = boxes_[z[0]];
  Float4 best = splat(std::numeric_limits<float>::infinity()), best_left{};
  Int4 position{};
  for (uint32_t i = 1;; ++i) {
    const Float4 left = areas(a, b, c);
    const Float4 cost = left * splat(float(i)) + right_areas_[i] * splat(float(count - i));
    const Int4 better = Int4(cost < best);
    best = min4(cost, best);
    best_left = Float4((Int4(left) & better) | (Int4(best_left) & ~better));
    const int at = static_cast<int>(i);
    position = (Int4{at, at, at, at} & better) | (position & ~better);
    if (i == count - 1) break;
    a.extend(boxes_[x[i]]);
    b.extend(boxes_[y[i]]);
    c.extend(boxes_[z[i]]);
  }
  uint32_t axis = best[1] < best[0] ? 1 : 0;
  if (best[2] < best[axis]) axis = 2;
  const auto p = static_cast<uint32_t>(position[axis]);
  a.extend(boxes_[x[count - 1]]);
  // Where nothing is gained, all positions cost the same, up to rounding.
  if (!(best[axis] < a.half_area(pad_) * float(count) * 0.99999f)) return {axis, count / 2, 0, 0};
  return {axis, p, best_left[axis], right_areas_[p][axis]};
}

void SmallSweep::partition(uint32_t begin, uint32_t count, const Choice& choice) {
  uint32_t is_left = 0;
  for (uint32_t i = 0; i < choice.position; ++i) is_left |= 1u << orders_[choice.axis][begin + i];
  // Three and fewer need no order.
  const uint32_t axes = std::max(choice.position, count - choice.position) > 3 ? 3 : 1;
  for (uint32_t axis = 0; axis < axes; ++axis) {
    if (axis == choice.axis) continue;
    uint8_t* order = orders_[axis].data() + begin;
    std::array<uint8_t, kMost> rest;
    uint32_t left = 0, right = 0;
    for (uint32_t i = 0; i < count; ++i) {
      const uint8_t own = order[i];
      const uint32_t goes_left = (is_left >> own) & 1u;
      order[left] = own;
      rest[right] = own;
      left += goes_left;
      right += 1 - goes_left;
    }
    std::memcpy(order + left, rest.data(), right);
  }
}

}  // namespace umbel::bvh
