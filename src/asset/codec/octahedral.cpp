#include "asset/codec/octahedral.hpp"

#include <algorithm>
#include <array>

#include "base/simd/float4.hpp"

namespace umbel::asset {
namespace {

/// Four normals by component.
std::array<Float4, 3> from_octahedron(Float4 x, Float4 y) {
  const Float4 zero = splat(0), one = splat(1);
  const auto magnitude = [&](Float4 f) { return max4(f, -f); };
  const auto with_sign = [&](Float4 f, Float4 of) { return of < zero ? -f : f; };
  const Float4 z = one - magnitude(x) - magnitude(y);
  const Float4 fold = max4(-z, zero);
  x = x - with_sign(fold, x);
  y = y - with_sign(fold, y);
  const Float4 scale = one / sqrt4(x * x + y * y + z * z);
  return {x * scale, y * scale, z * scale};
}

float scale_of(uint32_t bits) { return 1.0f / static_cast<float>(octahedral_steps(bits)); }

}  // namespace

Vec3 decoded_normal(const int32_t* in, uint32_t bits) {
  Vec3 normal;
  decode_normals(in, 0, bits, {&normal, 1});
  return normal;
}

void decode_normals(const int32_t* in, uint32_t stride, uint32_t bits, std::span<Vec3> out) {
  const Float4 scale = splat(scale_of(bits));
  for (size_t first = 0; first < out.size(); first += 4) {
    const size_t count = std::min<size_t>(out.size() - first, 4);
    Int4 u, v;
    for (size_t i = 0; i < 4; ++i) {
      const int32_t* const integers = in + (first + std::min(i, count - 1)) * stride;
      u[i] = integers[0];
      v[i] = integers[1];
    }
    const auto [x, y, z] = from_octahedron(__builtin_convertvector(u, Float4) * scale,
                                           __builtin_convertvector(v, Float4) * scale);
    for (size_t i = 0; i < count; ++i) out[first + i] = {x[i], y[i], z[i]};
  }
}

}  // namespace umbel::asset
