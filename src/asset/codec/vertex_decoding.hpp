// What both decoders of vertices need: those of version 3 of the file format and of version 4.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>

#include "asset/codec/remainder_code.hpp"
#include "asset/codec/vertex_codec.hpp"

namespace umbel::asset {

inline constexpr uint32_t kDampingBits = 2;
inline constexpr uint32_t kPositionComponents = 3;

// Sums of 32-bit integers wrap: any file decodes to something, on every machine to the same.
inline uint32_t predicted_flat(int64_t a, int64_t b, int64_t across, int damping) {
  const int64_t sum = a + b;
  return static_cast<uint32_t>(sum - across - ((damping * (sum - 2 * across)) >> 4));
}
inline uint32_t predicted_smooth(int64_t a, int64_t b) {
  return static_cast<uint32_t>((a + b) >> 1);
}
inline uint32_t predicted(bool is_smooth, const int32_t* column, uint32_t stride,
                          const Predictors& p, int damping) {
  const int32_t a = column[p.a() * stride], b = column[p.b() * stride];
  return is_smooth ? predicted_smooth(a, b)
                   : predicted_flat(a, b, column[p.across() * stride], damping);
}

// ---- four lanes at a time

using Lanes = uint32_t __attribute__((vector_size(16)));
using SignedLanes = int32_t __attribute__((vector_size(16)));

inline Lanes load(const int32_t* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
/// The first two lanes; the others are 0.
inline Lanes load_two(const int32_t* from) {
  using Halves = uint64_t __attribute__((vector_size(16)));
  uint64_t two;
  std::memcpy(&two, from, sizeof(two));
  return reinterpret_cast<Lanes>(Halves{two, 0});
}
inline void store_two(Lanes lanes, int32_t* to) { std::memcpy(to, &lanes, sizeof(uint64_t)); }
inline void store(Lanes lanes, int32_t* to) { std::memcpy(to, &lanes, sizeof(lanes)); }

/// The vertices of a cluster that are its own.
struct OwnVertices {
  std::array<uint8_t, kMaxLocal + 1> vertices;
  uint32_t count = 0;
};

/// Copies the vertices that a cluster shares with earlier ones, and lists the others: without a
/// branch, which would be unpredictable. `stride` is a multiple of 4.
inline OwnVertices copy_shared(std::span<const uint32_t> source, uint32_t stride,
                               std::span<int32_t> group, int32_t* integers) {
  OwnVertices own;
  std::array<uint8_t, kMaxLocal + 1> shared;
  uint32_t count = 0, copies = 0;
  const auto size = static_cast<uint32_t>(source.size());
  for (uint32_t v = 0; v < size; ++v) {
    own.vertices[count] = shared[copies] = static_cast<uint8_t>(v);
    count += source[v] == kNone;
    copies += source[v] != kNone;
  }
  own.count = count;
  for (uint32_t i = 0; i < copies; ++i) {
    const int32_t* const equal = group.data() + size_t{source[shared[i]]} * stride;
    int32_t* const row = integers + size_t{shared[i]} * stride;
    for (uint32_t c = 0; c < stride; c += 4) store(load(equal + c), row + c);
  }
  return own;
}

/// Whether values are so small that no prediction leaves 32 bits.
inline bool are_small(std::span<const ComponentRange> ranges) {
  constexpr int64_t kMostValue = 1 << 26;
  return std::ranges::all_of(ranges, [](const ComponentRange& range) {
    return range.lowest >= -kMostValue && range.lowest + (int64_t{1} << range.bits) <= kMostValue;
  });
}

/// The flat prediction of four components.
struct FlatLanes {
  Lanes once, twice;  // masks of the damping's bits

  explicit FlatLanes(int damping)
      : once(Lanes{} - (static_cast<uint32_t>(damping) & 1)),
        twice(Lanes{} - (static_cast<uint32_t>(damping) >> 1)) {}
  /// `sum` is of a and b.
  Lanes operator()(Lanes sum, Lanes across) const {
    const Lanes flat = sum - across, bend = flat - across;
    const Lanes bends = (bend & once) + ((bend + bend) & twice);
    return flat - reinterpret_cast<Lanes>(reinterpret_cast<SignedLanes>(bends) >> 4);
  }
};
inline Lanes unzigzag_lanes(Lanes remainders) {
  return (remainders >> 1) ^ (Lanes{} - (remainders & 1));
}

}  // namespace umbel::asset
