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
using Corners = std::array<Corner, 3>;

Corners rotated(const Corners& c, size_t by) { return {c[by], c[(by + 1) % 3], c[(by + 2) % 3]}; }

Corners least_rotation(const Corners& c) {
  // All but degenerate triangles are decided by where the least corner is.
  if (c[0] < c[1] && c[0] < c[2]) return c;
  if (c[1] < c[0] && c[1] < c[2]) return rotated(c, 1);
  if (c[2] < c[0] && c[2] < c[1]) return rotated(c, 2);
  return std::min({c, rotated(c, 1), rotated(c, 2)});
}

uint64_t triangle_digest(const MeshView& mesh, const Triangle& t) {
  Corners corners =
      least_rotation({value_bits(mesh.positions[t[0]]), value_bits(mesh.positions[t[1]]),
                      value_bits(mesh.positions[t[2]])});
  if constexpr (std::endian::native == std::endian::big) {
    for (Corner& corner : corners)
      for (uint32_t& word : corner)
        word = word << 24 | (word & 0xff00) << 8 | (word >> 8 & 0xff00) | word >> 24;
  }
  return xxh64(&corners, sizeof corners);
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
