// Full-sweep SAH (see sweep_sah.cpp) on at most 32 primitives: the three axes side by side in the
// lanes of a vector, and sets of primitives as bits.
#include "bvh/small_sweep.hpp"

#include <cstring>
#include <limits>

#include "bvh/config.hpp"
#include "bvh/short_box.hpp"

namespace umbel::bvh {
namespace {

// Negative, which does not matter to a product of two.
Float4 negated_extents(const Box4& b, Float4 pad) { return b.low + b.negated_high - pad; }

}  // namespace

BuiltSubtree SmallSweep::build(uint32_t count, uint32_t slot, uint32_t depth) {
  Box4 whole = Box4::empty();
  for (uint32_t i = 0; i < count; ++i) {
    boxes_[i] = Box4::load(all_boxes_[ids_[i]]);
    whole.extend(boxes_[i]);
  }
  pad_ = whole.pad();
  sort(count);
  return split(0, count, slot, depth);
}

// A place in the order is the number of smaller centres: few enough to count them all.
void SmallSweep::sort(uint32_t count) {
  std::array<std::array<float, kMost>, 3> centers;
  for (uint32_t i = 0; i < count; ++i) {
    const Float4 c = boxes_[i].center2();
    for (int axis = 0; axis < 3; ++axis) centers[axis][i] = c[axis];
  }
  const uint32_t padded = (count + 3) & ~3u;
  for (int axis = 0; axis < 3; ++axis) {
    float* const c = centers[axis].data();
    for (uint32_t i = count; i < padded; ++i) c[i] = std::numeric_limits<float>::infinity();
    for (uint32_t i = 0; i < count; ++i) {
      const Float4 own = splat(c[i]);
      Int4 places{};
      // Of equal centres the earlier comes first.
      const uint32_t mine = i & ~3u;
      for (uint32_t k = 0; k < mine; k += 4) {
        Float4 others;
        std::memcpy(&others, c + k, sizeof others);
        places -= Int4(others <= own);
      }
      for (uint32_t k = mine; k < padded; k += 4) {
        Float4 others;
        std::memcpy(&others, c + k, sizeof others);
        places -= Int4(others < own);
      }
      uint32_t place = uint32_t(places[0] + places[1] + places[2] + places[3]);
      for (uint32_t k = mine; k < i; ++k) place += c[k] == c[i];
      orders_[axis][place] = static_cast<uint8_t>(i);
    }
  }
}

BuiltSubtree SmallSweep::leaf(uint32_t begin, uint32_t slot) {
  const uint32_t own = orders_[0][begin];
  out_.primitives[out_.primitive_count++] = ids_[own];
  return out_.make_leaf(slot, 1, boxes_[own], boxes_[own].half_area(pad_));
}

BuiltSubtree SmallSweep::split(uint32_t begin, uint32_t count, uint32_t slot, uint32_t depth) {
  if (count == 1) return leaf(begin, slot);
  Choice choice{0, 1, 0, 0};
  if (count > 2) {
    choice = cheapest(begin, count);
    const uint32_t larger = std::max(choice.position, count - choice.position);
    if (!fits_depth(larger, out_.max_depth - depth - 1)) choice.position = count / 2;
    partition(begin, count, choice);
  } else {
    choice.left_area = boxes_[orders_[0][begin]].half_area(pad_);
    choice.right_area = boxes_[orders_[0][begin + 1]].half_area(pad_);
  }
  const uint32_t pair = out_.add_pair(), middle = begin + choice.position;
  BuiltSubtree left, right;
  if (choice.left_area >= choice.right_area) {
    left = split(begin, choice.position, pair, depth + 1);
    right = split(middle, count - choice.position, pair + 1, depth + 1);
  } else {
    right = split(middle, count - choice.position, pair + 1, depth + 1);
    left = split(begin, choice.position, pair, depth + 1);
  }
  return out_.join(slot, pair, count, left, right, pad_);
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
  // Where nothing is gained, all positions cost the same but for rounding.
  if (!(best[axis] < a.half_area(pad_) * float(count) * 0.99999f)) return {axis, count / 2, 0, 0};
  return {axis, p, best_left[axis], right_areas_[p][axis]};
}

void SmallSweep::partition(uint32_t begin, uint32_t count, const Choice& choice) {
  uint32_t is_left = 0;
  for (uint32_t i = 0; i < choice.position; ++i) is_left |= 1u << orders_[choice.axis][begin + i];
  for (uint32_t axis = 0; axis < 3; ++axis) {
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
