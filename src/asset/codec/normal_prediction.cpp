#include "asset/codec/normal_prediction.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace umbel::asset {
namespace {

using SignedLanes = int32_t __attribute__((vector_size(16)));
using Unsigned = uint32_t __attribute__((vector_size(16)));

Unsigned load_unsigned(const int32_t* from) {
  Unsigned lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}

/// Area vectors wrap if their edges are too long: then they predict badly.
Unsigned cross(Unsigned a, Unsigned b) {
  const auto yzx = [](Unsigned v) { return __builtin_shufflevector(v, v, 1, 2, 0, 3); };
  return yzx(a * yzx(b) - b * yzx(a));
}

}  // namespace

uint32_t normal_shift(const int32_t* integers, uint32_t stride,
                      std::span<const uint8_t> triangles) {
  // Products of edges, and their sums over a dozen triangles, stay below 2^31.
  constexpr uint32_t kEdgeBits = 13;
  uint32_t all = 0;
  for (size_t t = 0; t < triangles.size(); t += 3)
    for (size_t k = 1; k < 3; ++k)
      for (size_t c = 0; c < 3; ++c) {
        const auto edge =
            static_cast<int32_t>(static_cast<uint32_t>(integers[triangles[t + k] * stride + c]) -
                                 static_cast<uint32_t>(integers[triangles[t] * stride + c]));
        all |= static_cast<uint32_t>(edge ^ (edge >> 31));
      }
  const auto bits = static_cast<uint32_t>(std::bit_width(all));
  return std::min(bits - std::min(bits, kEdgeBits), (1u << kNormalShiftBits) - 1);
}

void predict_normals(const int32_t* integers, uint32_t stride, std::span<const uint8_t> triangles,
                     uint32_t vertices, uint32_t shift, int32_t steps, UnfoldedNormals& out) {
  std::array<Unsigned, kMaxLocal> sums;
  std::fill_n(sums.begin(), vertices, Unsigned{});
  for (size_t t = 0; t < triangles.size(); t += 3) {
    const uint32_t a = triangles[t], b = triangles[t + 1], c = triangles[t + 2];
    const Unsigned corner = load_unsigned(integers + size_t{a} * stride);
    const auto edge = [&](uint32_t end) {
      const Unsigned difference = load_unsigned(integers + size_t{end} * stride) - corner;
      return reinterpret_cast<Unsigned>(reinterpret_cast<SignedLanes>(difference) >>
                                        static_cast<int32_t>(shift));
    };
    const Unsigned area = cross(edge(b), edge(c));
    sums[a] += area;
    sums[b] += area;
    sums[c] += area;
  }
  for (uint32_t i = 0; i < vertices; ++i) {
    const SignedLanes sum = reinterpret_cast<SignedLanes>(sums[i]);
    const double x = sum[0], y = sum[1], z = sum[2];
    const double length = std::fabs(x) + std::fabs(y) + std::fabs(z);
    const double scale = length > 0 ? steps / length : 0;
    // Rounded down: the numbers are positive.
    const double above = steps + 1.5;
    out.u[i] = static_cast<int32_t>(x * scale + above) - (steps + 1);
    out.v[i] = static_cast<int32_t>(y * scale + above) - (steps + 1);
    out.is_lower[i] = sum[2] < 0;
  }
}

}  // namespace umbel::asset
