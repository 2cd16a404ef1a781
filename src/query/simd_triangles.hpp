// The triangle test of a leaf in 256-bit vectors, for the translation units that turn on an
// instruction set before they include this. What the sets do differently comes from `Isa`:
//   le(a, b), eq(a, b)             which lanes have a <= b, a == b: Lanes
//   both, either, bits             of Lanes
//   load(words, n), load_ids       the first n of eight; the other lanes may hold anything
//   gather(base, at, n)            the first n of eight
// It does what test_triangle does, in the same order and without fused operations.
#pragma once

#include <immintrin.h>

#include <array>

#include "query/ray_queries.hpp"

#define UMBEL_SIMD [[gnu::always_inline]] inline

namespace umbel {

/// Woop's test of the triangles of a leaf.
template <typename Isa>
class TriangleTester {
 public:
  UMBEL_SIMD explicit TriangleTester(const RayFrame& f)
      : f_(f), ox_(all(f.origin[f.kx])), oy_(all(f.origin[f.ky])), oz_(all(f.origin[f.kz])) {}

  UMBEL_SIMD uint32_t operator()(const LeafStore& tree, uint32_t link, bool cull_back, float t_max,
                                 LeafHits& hits) const {
    const uint32_t n = LeafStore::leaf_size(link);
    const uint32_t* words = leaf_words(tree, link);
    // The triangles' numbers, which a hit needs: asked for together with the corners.
    __builtin_prefetch(words + size_t{tree.corner_words()} * n);
    const Corner from_a = corner(tree, words, n, 0), from_b = corner(tree, words, n, 1),
                 from_c = corner(tree, words, n, 2);
    const Corner a = sheared(from_a), b = sheared(from_b), c = sheared(from_c);
    Edges e{edge(c, b), edge(a, c), edge(b, a)};
    const uint32_t triangles = (1u << n) - 1;
    // By the signs, which are right as they are, as rounding never turns one around.
    uint32_t lanes = triangles & ~signs(_mm256_or_ps(e.u, _mm256_or_ps(e.v, e.w)));
    if (!cull_back) lanes |= triangles & signs(_mm256_and_ps(e.u, _mm256_and_ps(e.v, e.w)));
    const __m256 zero = _mm256_setzero_ps();
    const uint32_t zeros =
        triangles & Isa::bits(Isa::either(Isa::either(Isa::eq(e.u, zero), Isa::eq(e.v, zero)),
                                          Isa::eq(e.w, zero)));
    if (zeros != 0) [[unlikely]] {
      // Copies, so that the corners and edges go through memory here alone.
      const std::array corners{a, b, c};
      Edges exact = e;
      lanes = settle_zeros(corners, zeros, lanes | zeros, cull_back, exact);
      e = exact;
    }
    if (lanes == 0) return 0;
    const __m256 determinant = _mm256_add_ps(_mm256_add_ps(e.u, e.v), e.w);
    const __m256 depth = _mm256_add_ps(
        _mm256_add_ps(_mm256_mul_ps(e.u, a.z), _mm256_mul_ps(e.v, b.z)), _mm256_mul_ps(e.w, c.z));
    __m256 t = _mm256_mul_ps(_mm256_div_ps(depth, determinant), all(f_.sz * f_.unscale));
    const __m256 last = all(t_max);
    // Where the determinant is 0, so are the edge functions, and t is not a number.
    lanes &= Isa::bits(Isa::both(Isa::le(all(f_.t_min), t), Isa::le(t, last)));
    if (lanes == 0) return 0;
    const typename Isa::Lanes meets_box = settle(from_a, from_b, from_c, t);
    lanes &= Isa::bits(Isa::both(meets_box, Isa::le(t, last)));
    if (lanes == 0) return 0;
    _mm256_store_ps(hits.t, t);
    _mm256_store_ps(hits.v, e.v);
    _mm256_store_ps(hits.w, e.w);
    _mm256_store_ps(hits.determinant, determinant);
    return lanes;
  }

 private:
  struct Corner {
    __m256 x, y, z;
  };
  struct Edges {
    __m256 u, v, w;
  };
  struct Span {
    __m256 enter, leave;
  };

  /// From the ray's origin, along its axes.
  UMBEL_SIMD Corner corner(const LeafStore& tree, const uint32_t* words, uint32_t n,
                           uint32_t index) const {
    __m256 x, y, z;
    if (tree.compact) {
      const auto* vertices = reinterpret_cast<const float*>(tree.vertices.data());
      const __m256i ids = Isa::load_ids(words + size_t{index} * n, n);
      const __m256i at = _mm256_add_epi32(ids, _mm256_add_epi32(ids, ids));
      x = Isa::gather(vertices + f_.kx, at, n);
      y = Isa::gather(vertices + f_.ky, at, n);
      z = Isa::gather(vertices + f_.kz, at, n);
    } else {
      const uint32_t* rows = words + size_t{3} * index * n;
      x = Isa::load(rows + size_t{f_.kx} * n, n);
      y = Isa::load(rows + size_t{f_.ky} * n, n);
      z = Isa::load(rows + size_t{f_.kz} * n, n);
    }
    return {_mm256_sub_ps(x, ox_), _mm256_sub_ps(y, oy_), _mm256_sub_ps(z, oz_)};
  }

  UMBEL_SIMD Corner sheared(Corner p) const {
    if (f_.scale != 1.0f) [[unlikely]] {
      p.x = _mm256_mul_ps(p.x, all(f_.scale));
      p.y = _mm256_mul_ps(p.y, all(f_.scale));
      p.z = _mm256_mul_ps(p.z, all(f_.scale));
    }
    return {_mm256_sub_ps(p.x, _mm256_mul_ps(all(f_.sx), p.z)),
            _mm256_sub_ps(p.y, _mm256_mul_ps(all(f_.sy), p.z)), p.z};
  }

  UMBEL_SIMD static __m256 edge(const Corner& p, const Corner& q) {
    return _mm256_sub_ps(_mm256_mul_ps(p.x, q.y), _mm256_mul_ps(p.y, q.x));
  }

  /// As umbel::settle: corners are from the ray's origin, and as
  /// rounding keeps their order, the least of them is the least corner's.
  UMBEL_SIMD typename Isa::Lanes settle(const Corner& a, const Corner& b, const Corner& c,
                                        __m256& t) const {
    const Span x = span(a.x, b.x, c.x, f_.kx), y = span(a.y, b.y, c.y, f_.ky);
    const Span z = span(a.z, b.z, c.z, f_.kz);
    const __m256 enter = _mm256_max_ps(_mm256_max_ps(x.enter, y.enter), z.enter);
    const __m256 leave = _mm256_min_ps(_mm256_min_ps(x.leave, y.leave), z.leave);
    t = _mm256_max_ps(enter, t);
    return Isa::both(Isa::le(enter, leave), Isa::le(all(f_.t_min), leave));
  }

  /// Where the ray is between a triangle's corners along one axis.
  UMBEL_SIMD Span span(__m256 a, __m256 b, __m256 c, uint32_t axis) const {
    const __m256 inv = all(f_.inv[axis]);
    const __m256 error_bound = all(f_.error[axis] * kOwnBoxShare);
    const __m256 one = _mm256_mul_ps(_mm256_min_ps(c, _mm256_min_ps(a, b)), inv);
    const __m256 other = _mm256_mul_ps(_mm256_max_ps(c, _mm256_max_ps(a, b)), inv);
    return {_mm256_sub_ps(_mm256_min_ps(one, other), error_bound),
            _mm256_add_ps(_mm256_max_ps(one, other), error_bound)};
  }

  UMBEL_SIMD static uint32_t signs(__m256 a) {
    return static_cast<uint32_t>(_mm256_movemask_ps(a));
  }
  UMBEL_SIMD static __m256 all(float x) { return _mm256_set1_ps(x); }

  /// Computes the edge functions of the lanes `zeros` again, and returns what is left of `lanes`.
  [[gnu::noinline]] static uint32_t settle_zeros(const std::array<Corner, 3>& corners,
                                                 uint32_t zeros, uint32_t lanes, bool cull_back,
                                                 Edges& e) {
    alignas(32) float coordinates[6][8], edges[3][8];
    const auto& [a, b, c] = corners;
    const __m256 vectors[6] = {a.x, a.y, b.x, b.y, c.x, c.y};
    for (int i = 0; i < 6; ++i) _mm256_store_ps(coordinates[i], vectors[i]);
    _mm256_store_ps(edges[0], e.u);
    _mm256_store_ps(edges[1], e.v);
    _mm256_store_ps(edges[2], e.w);
    for (; zeros != 0; zeros &= zeros - 1) {
      const auto i = static_cast<uint32_t>(std::countr_zero(zeros));
      const ExactEdges exact = exact_edges(coordinates[0][i], coordinates[1][i], coordinates[2][i],
                                           coordinates[3][i], coordinates[4][i], coordinates[5][i]);
      edges[0][i] = exact.u;
      edges[1][i] = exact.v;
      edges[2][i] = exact.w;
      const bool negative = exact.u < 0.0f || exact.v < 0.0f || exact.w < 0.0f;
      const bool positive = exact.u > 0.0f || exact.v > 0.0f || exact.w > 0.0f;
      if (negative && (cull_back || positive)) lanes &= ~(1u << i);
    }
    e = {_mm256_load_ps(edges[0]), _mm256_load_ps(edges[1]), _mm256_load_ps(edges[2])};
    return lanes;
  }

  const RayFrame& f_;
  __m256 ox_, oy_, oz_;  ///< the origin along the frame's axes
};

}  // namespace umbel
