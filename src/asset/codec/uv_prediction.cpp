#include "asset/codec/uv_prediction.hpp"

#include <algorithm>

namespace umbel::asset {
namespace {

/// Beyond so many times the edge or the triangle behind it, the map is not trusted.
constexpr float kMostStretch = 4;

using Vector4 = std::array<Float4, 3>;  // of four vertices, by component

Float4 dot(const Vector4& a, const Vector4& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

}  // namespace

void map_positions(const int32_t* integers, uint32_t stride, std::span<const Predictors> predictors,
                   std::span<const uint8_t> vertices, UvMap& out) {
  const Float4 zero = splat(0.0f), most = splat(kMostStretch);
  for (size_t begin = 0; begin < vertices.size(); begin += 4) {
    std::array<Predictors, 4> from;
    std::array<uint8_t, 4> of;
    Int4 closes{};
    for (size_t i = 0; i < 4; ++i) {
      of[i] = vertices[std::min(begin + i, vertices.size() - 1)];
      const Predictors p = predictors[of[i]];
      from[i] = p;
      if (p.closes_triangle()) {
        from[i] = {predictors_of(p.a() - 1, p.a(), p.a() - 1).word | Predictors::kCloses};
        closes[i] = -1;
      }
    }
    const auto way = [&](const auto& to) {
      std::array<Float4, 4> rows;
      for (size_t i = 0; i < 4; ++i) {
        const Lanes difference =
            load(integers + size_t{to(i)} * stride) - load(integers + size_t{from[i].a()} * stride);
        rows[i] = __builtin_convertvector(reinterpret_cast<SignedLanes>(difference), Float4);
      }
      transpose(rows[0], rows[1], rows[2], rows[3]);
      return Vector4{rows[0], rows[1], rows[2]};
    };
    const Vector4 x = way([&](size_t i) { return of[i]; });
    const Vector4 edge = way([&](size_t i) { return from[i].b(); });
    const Vector4 third = way([&](size_t i) { return from[i].across(); });
    // Both ends of the ways beside the edge: where along it, and the squared distance from it.
    const Float4 ee = dot(edge, edge), xe = dot(x, edge), te = dot(third, edge);
    const Float4 x_along = xe / ee, third_along = te / ee;
    const Float4 x_off = max4(dot(x, x) - x_along * xe, zero);
    const Float4 third_off = closes ? ee : dot(third, third) - third_along * te;
    const Float4 ratio = sqrt4(x_off / third_off);
    const Float4 along = x_along + ratio * third_along;
    const Int4 is_sound =
        (ee > zero) & (third_off > zero) & (along <= most) & (along >= -most) & (ratio <= most);
    // Else the parallelogram rule, or the vertex before.
    const Float4 usual_along = is_sound ? along : splat(1.0f);
    const Float4 usual_aside = is_sound ? -ratio : (closes ? zero : splat(-1.0f));
    for (size_t i = 0; i < 4; ++i) {
      out.along[of[i]] = usual_along[i];
      out.aside[of[i]] = usual_aside[i];
      out.from[of[i]] = from[i];
    }
  }
}

}  // namespace umbel::asset
