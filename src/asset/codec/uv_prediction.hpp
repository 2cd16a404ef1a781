// Predicts texture coordinates by positions: most charts are nearly flat and stretched evenly, so
// the map from a triangle to its texture coordinates goes on beyond its edges.
//
// Triangles have similar shapes on the surface and in the texture (Váša & Brunnett, "Efficient
// Encoding of Texture Coordinates Guided by Mesh Geometry", 2014). Here the triangle behind the
// active edge is unfolded about that edge into the plane of the new one. Where a region starts, its
// first two vertices give a similarity for the third. All of it is binary32 in a fixed order, so
// that every machine predicts the same; docs/format.md has the arithmetic.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "asset/codec/connectivity.hpp"
#include "asset/codec/vertex_decoding.hpp"
#include "base/simd/float4.hpp"

namespace umbel::asset {

/// Where each vertex is beside three others: `along` times the way from the first to the second,
/// plus `aside` times the way from the first to the third, or, at the last vertex of a region's
/// first triangle, that way to the second turned by a right angle.
struct UvMap {
  std::array<float, kMaxLocal> along, aside;
  std::array<Predictors, kMaxLocal> from;  ///< first, second, third
};

/// Of the vertices of a list of them, by positions that are `stride` >= 4 apart: a fourth integer
/// is read and left.
void map_positions(const int32_t* integers, uint32_t stride, std::span<const Predictors> predictors,
                   std::span<const uint8_t> vertices, UvMap& out);

/// What the map makes of the texture coordinates of those three.
class MappedUvs {
 public:
  /// Turned clockwise where the texture is mirrored on the surface.
  MappedUvs(const UvMap& map, bool is_mirrored)
      : map_(map), turn_(is_mirrored ? Float4{1, -1, 0, 0} : Float4{-1, 1, 0, 0}) {}

  /// `column` are the texture coordinates of the first vertex.
  UMBEL_READ_INLINE Lanes operator()(uint32_t v, const int32_t* column, size_t stride) const {
    const Predictors from = map_.from[v];
    const Lanes first = load_two(column + from.a() * stride);
    const auto way = [&](uint32_t to) {
      const Lanes difference = load_two(column + to * stride) - first;
      return __builtin_convertvector(reinterpret_cast<SignedLanes>(difference), Float4);
    };
    const Float4 second = way(from.b());
    const Float4 turned = __builtin_shufflevector(second, second, 1, 0, 2, 3) * turn_;
    const Float4 third = from.closes_triangle() ? turned : way(from.across());
    Float4 sum = second * splat(map_.along[v]) + third * splat(map_.aside[v]);
    sum = max4(min4(sum, splat(kMost)), splat(-kMost));
    const SignedLanes sign =
        reinterpret_cast<SignedLanes>(sum) & reinterpret_cast<SignedLanes>(splat(-0.0f));
    sum = sum + reinterpret_cast<Float4>(sign | reinterpret_cast<SignedLanes>(splat(0.5f)));
    return first + reinterpret_cast<Lanes>(__builtin_convertvector(sum, SignedLanes));
  }

 private:
  static constexpr float kMost = 1 << 30;

  const UvMap& map_;
  Float4 turn_;
};

}  // namespace umbel::asset
