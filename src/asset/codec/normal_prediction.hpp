// Predicts octahedral normals by the triangles around each vertex: the sum of their area vectors,
// in whole numbers, so that every machine predicts the same. docs/format.md has the arithmetic.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "asset/codec/connectivity.hpp"
#include "asset/codec/octahedral.hpp"

namespace umbel::asset {

inline constexpr uint32_t kNormalShiftBits = 4;

/// Two octahedral integers, those of the lower half unfolded: where the upper half would have them
/// if z were positive.
struct UnfoldedNormals {
  std::array<int32_t, kMaxLocal> u, v;
  std::array<int32_t, kMaxLocal> is_lower;  ///< 0 or 1
};

/// Maps the integers of the lower half to those of the upper half and back. The edge of the square
/// has each direction twice: of those only the one that quantize chooses comes back.
inline void fold(int32_t& u, int32_t& v, int32_t steps) {
  const auto far_from = [&](int32_t i) {
    const auto value = static_cast<uint32_t>(i);
    return static_cast<uint32_t>(steps) - (i < 0 ? 0u - value : value);
  };
  const uint32_t other_u = far_from(v), other_v = far_from(u);
  u = static_cast<int32_t>(u < 0 ? 0u - other_u : other_u);
  v = static_cast<int32_t>(v < 0 ? 0u - other_v : other_v);
}

/// The least shift after which area vectors fit 32 bits.
uint32_t normal_shift(const int32_t* integers, uint32_t stride, std::span<const uint8_t> triangles);

/// Normals of the first `vertices` vertices, whose positions are `stride` >= 4 apart: a fourth
/// integer is read and left.
void predict_normals(const int32_t* integers, uint32_t stride, std::span<const uint8_t> triangles,
                     uint32_t vertices, uint32_t shift, int32_t steps, UnfoldedNormals& out);

}  // namespace umbel::asset
