// A digest of the triangles as a multiset: the sum, modulo 2^64, of the XXH64 of each triangle's
// 36 bytes of positions (little-endian floats, -0 as 0), rotated so that they are the least of
// the three rotations when read as nine unsigned integers. Sums do not depend on order.
#include <algorithm>

#include "base/parallel.hpp"
#include "mesh/streams.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel {
namespace {

using Corner = std::array<uint32_t, 3>;
// Twice around, so that all three rotations stand in a row.
using Corners = std::array<Corner, 5>;

std::array<Corner, 3> rotation(const Corners& c, size_t by) {
  return {c[by], c[by + 1], c[by + 2]};
}

// Where the least rotation starts.
size_t least_rotation(const Corners& c) {
  const auto key = [&](size_t i) { return uint64_t{c[i][0]} << 32 | c[i][1]; };
  const uint64_t a = key(0), b = key(1), d = key(2);
  // All but degenerate triangles and tall ones are decided by the first words of the least corner.
  if (a != b && b != d && d != a) {
    const size_t first = b < a ? 1 : 0;
    return d < std::min(a, b) ? 2 : first;
  }
  size_t least = 0;
  for (size_t by = 1; by < 3; ++by)
    if (rotation(c, by) < rotation(c, least)) least = by;
  return least;
}

uint64_t triangle_digest(const MeshView& mesh, const Triangle& t) {
  Corners corners;
  for (size_t i = 0; i < 3; ++i) corners[i] = value_bits(mesh.positions[t[i]]);
  corners[3] = corners[0];
  corners[4] = corners[1];
  const size_t first = least_rotation(corners);
  if constexpr (std::endian::native == std::endian::big) {
    for (Corner& corner : corners)
      for (uint32_t& word : corner)
        word = word << 24 | (word & 0xff00) << 8 | (word >> 8 & 0xff00) | word >> 24;
  }
  return xxh64(&corners[first], 3 * sizeof(Corner));
}

}  // namespace

uint64_t triangle_set_digest(const MeshView& mesh) {
  check_indices(mesh);
  std::vector<uint64_t> sums((mesh.triangles.size() + kTriangleChunk - 1) / kTriangleChunk);
  parallel_chunks(mesh.triangles.size(), kTriangleChunk, [&](size_t begin, size_t end) {
    uint64_t sum = 0;
    for (size_t i = begin; i < end; ++i) sum += triangle_digest(mesh, mesh.triangles[i]);
    sums[begin / kTriangleChunk] = sum;
  });
  uint64_t digest = 0;
  for (uint64_t sum : sums) digest += sum;
  return digest;
}

}  // namespace umbel
