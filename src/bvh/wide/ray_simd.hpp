// The ray kernels of wide trees in 256-bit vectors, for the translation units that turn on an
// instruction set before they include this. What the sets do differently comes from `Isa`, as in
// query/simd_triangles.hpp, and
//   compress(keys, lanes)  the keys of these lanes first, then others that are no smaller
//   in_memory(frame)       the frame; where registers are few, its numbers are read from memory
//                          each time
// Box tests only cull, so how they round does not matter (see query/ray_frame.hpp).
#pragma once

#include <immintrin.h>

#include <bit>
#include <type_traits>

#include "bvh/wide/ray_traverse.hpp"
#include "query/simd_triangles.hpp"

namespace umbel {

/// Where a ray enters eight boxes, by where it meets their near and their far planes. Distances
/// that are not negative compare as integers do, which takes a cycle instead of three or four.
template <typename Isa>
class BoxEntry {
 public:
  struct Planes {
    __m256 x, y, z;
  };

  UMBEL_SIMD explicit BoxEntry(const RayFrame& f) : f_(f) {}

  /// Returns all bits for the boxes that the ray does not meet in [t_min, cull], none for others.
  UMBEL_SIMD __m256i operator()(const Planes& n, const Planes& f, float cull, __m256& near) const {
    const __m256 t_min = _mm256_set1_ps(f_.t_min);
    if (std::bit_cast<int32_t>(f_.t_min) < 0) [[unlikely]] {
      near = _mm256_max_ps(_mm256_max_ps(n.x, n.y), _mm256_max_ps(n.z, t_min));
      const __m256 far =
          _mm256_min_ps(_mm256_min_ps(f.x, f.y), _mm256_min_ps(f.z, _mm256_set1_ps(cull)));
      return bits(_mm256_cmp_ps(near, far, _CMP_NLE_UQ));
    }
    // Of negative ones the order is wrong, but those are before t_min anyway.
    const __m256i enter = _mm256_max_epi32(_mm256_max_epi32(bits(n.x), bits(n.y)),
                                           _mm256_max_epi32(bits(n.z), bits(t_min)));
    const __m256i last =
        _mm256_max_epi32(bits(_mm256_set1_ps(cull)), _mm256_setzero_si256());  // may be -0
    const __m256i leave =
        _mm256_min_epi32(_mm256_min_epi32(bits(f.x), bits(f.y)), _mm256_min_epi32(bits(f.z), last));
    near = _mm256_castsi256_ps(enter);
    return _mm256_cmpgt_epi32(enter, leave);
  }

 private:
  UMBEL_SIMD static __m256i bits(__m256 a) { return _mm256_castps_si256(a); }

  const RayFrame& f_;
};

/// The box test of the eight children of a node.
template <typename Isa>
class BoxTester {
 public:
  UMBEL_SIMD BoxTester(const RayFrame& f, const uint32_t* nodes) : f_(&f) {
    for (int axis = 0; axis < 3; ++axis) {
      // The lowest planes come first, the highest 32 bytes behind them.
      const uint32_t near = 64 * axis + ((f.negative << 5 >> axis) & 32);
      near_[axis] = reinterpret_cast<const char*>(nodes) + near;
      far_[axis] = reinterpret_cast<const char*>(nodes) + (near ^ 32);
    }
  }

  UMBEL_SIMD __m256i operator()(size_t link, float cull, __m256& near) const {
    const RayFrame& f = *Isa::in_memory(f_);
    return BoxEntry<Isa>(f)(
        {at(near_[0], link, f.inv[0], f.near_b[0]), at(near_[1], link, f.inv[1], f.near_b[1]),
         at(near_[2], link, f.inv[2], f.near_b[2])},
        {at(far_[0], link, f.inv[0], f.far_b[0]), at(far_[1], link, f.inv[1], f.far_b[1]),
         at(far_[2], link, f.inv[2], f.far_b[2])},
        cull, near);
  }

 private:
  UMBEL_SIMD static __m256 at(const char* planes, size_t link, const float& inv, const float& b) {
    return _mm256_fmadd_ps(_mm256_load_ps(reinterpret_cast<const float*>(planes + 8 * link)),
                           _mm256_broadcast_ss(&inv), _mm256_broadcast_ss(&b));
  }

  const RayFrame* f_;
  const char *near_[3], *far_[3];  ///< planes of the first node
};

/// The same for the eight children of a node on a grid.
template <typename Isa>
class GridBoxTester {
 public:
  UMBEL_SIMD GridBoxTester(const RayFrame& f, const uint32_t* nodes) : entry_(f), nodes_(nodes) {
    Float4 near_b, far_b;
    widen_error_bounds(f, near_b, far_b);
    for (int axis = 0; axis < 3; ++axis) {
      inv_[axis] = _mm256_set1_ps(f.inv[axis]);
      near_b_[axis] = _mm256_set1_ps(near_b[axis]);
      far_b_[axis] = _mm256_set1_ps(far_b[axis]);
      const ptrdiff_t flip = f.inv[axis] < 0.0f ? kRow : 0;
      near_at_[axis] = 2 * kRow * axis + flip;
      far_at_[axis] = 2 * kRow * axis + (kRow - flip);
    }
  }

  UMBEL_SIMD __m256i operator()(size_t link, float cull, __m256& near) const {
    const uint32_t* const node = nodes_ + 2 * link;
    const Span x = span(node, 0), y = span(node, 1), z = span(node, 2);
    const __m256i links =
        _mm256_loadu_si256(reinterpret_cast<const __m256i*>(node + grid::links_at(8)));
    const __m256i absent = _mm256_cmpeq_epi32(links, _mm256_set1_epi32(-1));
    return _mm256_or_si256(absent,
                           entry_({x.near, y.near, z.near}, {x.far, y.far, z.far}, cull, near));
  }

 private:
  static constexpr ptrdiff_t kRow = 8 * sizeof(grid::GridPlane);

  struct Span {
    __m256 near, far;
  };
  UMBEL_SIMD Span span(const uint32_t* node, int axis) const {
    const auto* const words = reinterpret_cast<const float*>(node) + axis;
    const __m256 origin = _mm256_broadcast_ss(words), inv = inv_[axis];
    const __m256 cell = _mm256_mul_ps(_mm256_broadcast_ss(words + 3), inv);
    const __m256 near_b = _mm256_fmadd_ps(origin, inv, near_b_[axis]);
    const __m256 far_b = _mm256_fmadd_ps(origin, inv, far_b_[axis]);
    return {_mm256_fmadd_ps(row(node, near_at_[axis]), cell, near_b),
            _mm256_fmadd_ps(row(node, far_at_[axis]), cell, far_b)};
  }
  UMBEL_SIMD static __m256 row(const uint32_t* node, ptrdiff_t at) {
    const auto* const bytes = reinterpret_cast<const char*>(node + grid::kFirstRow) + at;
    return _mm256_cvtepi32_ps(
        _mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes))));
  }

  __m256 inv_[3], near_b_[3], far_b_[3];
  BoxEntry<Isa> entry_;
  ptrdiff_t near_at_[3], far_at_[3];  ///< bytes from the first row on
  const uint32_t* nodes_;
};

/// The children of a node, and where the ray enters them. They are sorted by distances as integers,
/// whose last three bits give way to the child's number. So children that are entered at almost the
/// same distance come in the order of their numbers, and those at negative distances in the wrong
/// order. That costs time and nothing else: what goes onto the stack is `near`.
struct NodeChildren {
  const uint32_t* links;
  __m256 near;

  /// As unsigned numbers; those of children that are missed come last.
  UMBEL_SIMD __m256i keys(__m256i missed) const {
    return _mm256_or_si256(distances(), _mm256_or_si256(numbers(), missed));
  }

  /// By their keys. This is what the next node waits for, so it takes as few steps as can be.
  UMBEL_SIMD static uint32_t nearest(__m256i keys) {
    __m128i least = _mm_min_epu32(_mm256_castsi256_si128(keys), _mm256_extracti128_si256(keys, 1));
    least = _mm_min_epu32(least, _mm_shuffle_epi32(least, 0b01'00'11'10));
    least = _mm_min_epu32(least, _mm_shuffle_epi32(least, 0b10'11'00'01));
    return static_cast<uint32_t>(_mm_cvtsi128_si32(least)) & 7;
  }

 private:
  UMBEL_SIMD __m256i distances() const {
    return _mm256_and_si256(_mm256_castps_si256(near), _mm256_set1_epi32(0x7ffffff8));
  }
  UMBEL_SIMD static __m256i numbers() { return _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7); }
};

/// Sorts children by a network of four or eight.
template <typename Isa>
class ChildSorter {
 public:
  /// Puts the children of a mask, two at least, on the stack, the furthest first. The nearest comes
  /// last, where it is not on the stack any more.
  UMBEL_SIMD static void push(const NodeChildren& children, __m256i keys, uint32_t entered,
                              StackEntry*& top) {
    keys = Isa::compress(keys, entered);
    const auto others = static_cast<uint32_t>(std::popcount(entered)) - 1;
    const __m256i descending = _mm256_sub_epi32(_mm256_set1_epi32(static_cast<int>(others)),
                                                _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    StackEntry* const first = top;
    top += others;
    if (others < 4) {
      const __m128i sorted = sort4(_mm256_castsi256_si128(keys));
      store4(children,
             _mm_castps_si128(
                 _mm_permutevar_ps(_mm_castsi128_ps(sorted), _mm256_castsi256_si128(descending))),
             first);
      return;
    }
    const __m256i order = _mm256_permutevar8x32_epi32(sort8(keys), descending);
    store4(children, _mm256_castsi256_si128(order), first);
    store4(children, _mm256_extracti128_si256(order, 1), first + 4);
  }

 private:
  /// Writes four entries in the order of their keys, whose last three bits are children's numbers.
  UMBEL_SIMD static void store4(const NodeChildren& children, __m128i keys, StackEntry* at) {
    const __m256i links = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(children.links));
    const __m256i twice = _mm256_permutevar8x32_epi32(_mm256_castsi128_si256(keys),
                                                      _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3));
    const __m256i link = _mm256_permutevar8x32_epi32(links, twice);
    const __m256i near = _mm256_castps_si256(_mm256_permutevar8x32_ps(children.near, twice));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(at), _mm256_blend_epi32(link, near, 0b10101010));
  }
  /// Keeps the larger of the two where the bit is set, else the smaller.
  template <uint32_t larger>
  UMBEL_SIMD static __m128i exchange(__m128i a, __m128i b) {
    return _mm_blend_epi32(_mm_min_epu32(a, b), _mm_max_epu32(a, b), larger);
  }
  template <uint32_t larger>
  UMBEL_SIMD static __m256i exchange(__m256i a, __m256i b) {
    return _mm256_blend_epi32(_mm256_min_epu32(a, b), _mm256_max_epu32(a, b), larger);
  }
  UMBEL_SIMD static __m128i sort4(__m128i a) {
    a = exchange<0b1010>(a, _mm_shuffle_epi32(a, 0b10'11'00'01));
    a = exchange<0b1100>(a, _mm_shuffle_epi32(a, 0b01'00'11'10));
    return exchange<0b0100>(a, _mm_shuffle_epi32(a, 0b11'01'10'00));
  }
  UMBEL_SIMD static __m256i sort8(__m256i a) {
    const __m256i reversed = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
    a = exchange<0b10101010>(a, _mm256_shuffle_epi32(a, 0b10'11'00'01));
    a = exchange<0b11001100>(a, _mm256_shuffle_epi32(a, 0b00'01'10'11));
    a = exchange<0b10101010>(a, _mm256_shuffle_epi32(a, 0b10'11'00'01));
    a = exchange<0b11110000>(a, _mm256_permutevar8x32_epi32(a, reversed));
    a = exchange<0b11001100>(a, _mm256_shuffle_epi32(a, 0b01'00'11'10));
    return exchange<0b10101010>(a, _mm256_shuffle_epi32(a, 0b10'11'00'01));
  }
};

/// Nodes of eight children.
template <typename Isa, bool quantised>
class WideIntersector {
 public:
  static constexpr uint32_t kWidth = 8;

  UMBEL_SIMD WideIntersector(const RayFrame& frame, const BvhData& tree)
      : triangles_(frame),
        links_(tree.nodes.data() + (quantised ? grid::links_at(kWidth) : 6 * kWidth)),
        boxes_(frame, tree.nodes.data()) {}

  UMBEL_SIMD uint32_t visit(size_t node, float cull, StackEntry*& top) const {
    __m256 near;
    // Asked for together with the boxes, not after their test.
    __builtin_prefetch(links_ + 2 * node);
    const __m256i missed = boxes_(node, cull, near);
    const auto missed_bits = static_cast<uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(missed)));
    const uint32_t entered = missed_bits ^ 255u;
    if (entered == 0) return kNoChild;
    const uint32_t* const links = links_ + 2 * node;
    if ((entered & (entered - 1)) == 0) return links[std::countr_zero(entered)];
    const NodeChildren children{links, near};
    const __m256i keys = children.keys(missed);
    ChildSorter<Isa>::push(children, keys, entered, top);
    return links[NodeChildren::nearest(keys)];
  }
  UMBEL_SIMD uint32_t triangles(const BvhData& tree, uint32_t link, bool cull_back, float t_max,
                                LeafHits& hits) const {
    return triangles_(tree, link, cull_back, t_max, hits);
  }

 private:
  TriangleTester<Isa> triangles_;
  const uint32_t* links_;  ///< of the first node
  std::conditional_t<quantised, GridBoxTester<Isa>, BoxTester<Isa>> boxes_;
};

/// Nodes of two or four children, whose boxes the compiler vectorises.
template <typename Isa, uint32_t width, bool quantised>
class NarrowIntersector {
 public:
  static constexpr uint32_t kWidth = width;

  UMBEL_SIMD NarrowIntersector(const RayFrame& frame, const BvhData& tree)
      : nodes_(tree.nodes.data()), boxes_(frame), triangles_(frame) {}

  UMBEL_SIMD uint32_t visit(uint32_t node, float cull, StackEntry*& top) const {
    return boxes_.visit(nodes_ + size_t{2} * node, cull, top);
  }
  UMBEL_SIMD uint32_t triangles(const BvhData& tree, uint32_t link, bool cull_back, float t_max,
                                LeafHits& hits) const {
    return triangles_(tree, link, cull_back, t_max, hits);
  }

 private:
  const uint32_t* nodes_;
  std::conditional_t<quantised, GridBoxes<Isa, width>, PlainBoxes<Isa, width>> boxes_;
  TriangleTester<Isa> triangles_;
};

template <typename Isa, bool quantised>
static const RayKernels* simd_kernels_of(uint32_t width) {
  if (width == 2) return &kernels_of<NarrowIntersector<Isa, 2, quantised>>;
  if (width == 4) return &kernels_of<NarrowIntersector<Isa, 4, quantised>>;
  return &kernels_of<WideIntersector<Isa, quantised>>;
}
template <typename Isa>
static const RayKernels* simd_kernels(uint32_t width, bool quantised) {
  return quantised ? simd_kernels_of<Isa, true>(width) : simd_kernels_of<Isa, false>(width);
}

}  // namespace umbel
