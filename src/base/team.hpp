// Teams: lanes that work on one thing together and share a little fast memory. On the processor a
// team is one thread; on a device it is a block, a warp, or (where it is found out on the device
// how much there is to do) 8 lanes of a warp. An algorithm is written once, for a team of any size:
//
//   struct Body {
//     static constexpr uint32_t kLanes = 32;  // of a device's team: 8, 32, or 64 to 1024
//     struct Shared { ... };                  // memory of the team, without a value at first
//     template <typename Team>
//     UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const;
//   };
//   exec.for_each_team(n, body);
//
// What one lane writes to shared memory others may read after the next sync(), which all lanes
// must reach. reduce() gives every lane the result, and is a sync() itself.
#pragma once

#include <cstdint>

#include "base/host_device.hpp"

namespace umbel {

/// For bodies that share nothing.
struct NothingShared {};

/// A team of one thread.
struct SerialTeam {
  static constexpr bool kIsSerial = true;

  UMBEL_HOST_DEVICE static constexpr uint32_t size() { return 1; }
  UMBEL_HOST_DEVICE static constexpr uint32_t rank() { return 0; }
  UMBEL_HOST_DEVICE void sync() const {}

  /// op over the values of all lanes; op must be exactly associative and commutative.
  template <typename T, typename Op>
  UMBEL_HOST_DEVICE T reduce(const T& value, const Op&) const {
    return value;
  }
  /// The lanes with a smaller rank for which `flag` holds.
  UMBEL_HOST_DEVICE uint32_t rank_among(bool) const { return 0; }
  /// The lanes for which `flag` holds.
  UMBEL_HOST_DEVICE uint32_t count(bool flag) const { return flag ? 1 : 0; }
  /// The same as bits; of teams of at most 32 lanes.
  UMBEL_HOST_DEVICE uint32_t ballot(bool flag) const { return flag ? 1 : 0; }

  UMBEL_HOST_DEVICE static uint32_t add(uint32_t* counter, uint32_t amount) {
    const uint32_t old = *counter;
    *counter += amount;
    return old;
  }
  template <typename T>
  UMBEL_HOST_DEVICE static void lower(T* least, T value) {
    if (value < *least) *least = value;
  }
  /// Makes a word that is still `free` the value, and returns what it was.
  UMBEL_HOST_DEVICE static uint32_t claim(uint32_t* word, uint32_t free, uint32_t value) {
    const uint32_t old = *word;
    if (old == free) *word = value;
    return old;
  }
};

}  // namespace umbel
