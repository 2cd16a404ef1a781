// Where radix trees over sorted Morton codes part, for any executor.
#pragma once

#include <cstdint>

#include "base/bit_count.hpp"
#include "base/host_device.hpp"

namespace umbel::bvh {

/// Leading bits that positions i and j > i have in common. Equal codes are told apart by position.
template <typename Key>
UMBEL_HOST_DEVICE inline int common_bits(const Key* codes, uint32_t i, uint32_t j) {
  const Key difference = codes[i] ^ codes[j];
  if (difference != 0) return int(leading_zeros(difference));
  return int(sizeof(Key) * 8) + int(leading_zeros(i ^ j));
}

/// Where the range [begin, end), of at least two codes, splits: the first position of the right
/// part.
template <typename Key>
UMBEL_HOST_DEVICE inline uint32_t radix_split(const Key* codes, uint32_t begin, uint32_t end) {
  const int common = common_bits(codes, begin, end - 1);
  uint32_t low = begin, high = end - 1;  // low shares more than that with begin, high does not
  while (high - low > 1) {
    const uint32_t middle = low + (high - low) / 2;
    (common_bits(codes, begin, middle) > common ? low : high) = middle;
  }
  return high;
}

/// A range of codes, with the subtree over them, on its way up the radix tree. Node i is where the
/// codes i and i + 1 part.
struct RadixClimb {
  const uint64_t* codes;
  uint32_t n;
  uint32_t begin, end;  ///< its codes, the last one included
  int before, behind;   ///< bits in common with the codes beside it; -1: there are none

  UMBEL_HOST_DEVICE static RadixClimb from(const uint64_t* codes, uint32_t n, uint32_t leaf) {
    return from(codes, n, leaf, leaf);
  }
  /// From all codes below a node.
  UMBEL_HOST_DEVICE static RadixClimb from(const uint64_t* codes, uint32_t n, uint32_t begin,
                                           uint32_t end) {
    RadixClimb climb{codes, n, begin, end, -1, -1};
    climb.look_before();
    climb.look_behind();
    return climb;
  }
  UMBEL_HOST_DEVICE bool is_all() const { return end - begin == n - 1; }
  UMBEL_HOST_DEVICE uint32_t count() const { return end - begin + 1; }
  /// Of the two children of the node above.
  UMBEL_HOST_DEVICE bool is_right() const { return before > behind; }
  UMBEL_HOST_DEVICE uint32_t parent() const { return is_right() ? begin - 1 : end; }
  /// What the one that it meets there does not know.
  UMBEL_HOST_DEVICE uint32_t far_end() const { return is_right() ? end : begin; }

  /// To the node above, with the far end of the other child.
  UMBEL_HOST_DEVICE void go_up(uint32_t other_far_end) {
    if (is_right()) {
      begin = other_far_end;
      look_before();
    } else {
      end = other_far_end;
      look_behind();
    }
  }

 private:
  UMBEL_HOST_DEVICE void look_before() {
    before = begin > 0 ? common_bits(codes, begin - 1, begin) : -1;
  }
  UMBEL_HOST_DEVICE void look_behind() {
    behind = end + 1 < n ? common_bits(codes, end, end + 1) : -1;
  }
};

}  // namespace umbel::bvh
