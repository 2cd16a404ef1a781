// A digest of the triangles as a multiset: the sum, modulo 2^64, of the XXH64 of each triangle's
// 36 bytes of positions (little-endian floats, -0 as 0), rotated so that they are the least of
// the three rotations when read as nine unsigned integers. Sums do not depend on order.
#include <algorithm>

#include "base/bytes.hpp"
#include "base/parallel.hpp"
#include "mesh/streams.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel {
namespace {

// The words of a position: the first two in one, the first above.
struct CornerWords {
  // Twice around, so that all three rotations stand in a row.
  std::array<uint64_t, 5> xy;
  std::array<uint32_t, 5> z;
};

bool is_less(const CornerWords& c, size_t a, size_t b) {
  for (size_t i = 0; i < 3; ++i) {
    if (c.xy[a + i] != c.xy[b + i]) return c.xy[a + i] < c.xy[b + i];
    if (c.z[a + i] != c.z[b + i]) return c.z[a + i] < c.z[b + i];
  }
  return false;
}

// Where the least rotation starts.
size_t least_rotation(const CornerWords& c) {
  const uint64_t a = c.xy[0], b = c.xy[1], d = c.xy[2];
  // All but degenerate triangles and tall ones are decided by the first words of the least corner.
  if (a != b && b != d && d != a) {
    const size_t first = b < a ? 1 : 0;
    return d < std::min(a, b) ? 2 : first;
  }
  size_t least = 0;
  for (size_t by = 1; by < 3; ++by)
    if (is_less(c, by, least)) least = by;
  return least;
}

uint64_t triangle_digest(const MeshView& mesh, const Triangle& t) {
  CornerWords c;
  for (size_t i = 0; i < 5; ++i) {
    const auto [x, y, z] = value_bits(mesh.positions[t[i % 3]]);
    c.xy[i] = uint64_t{x} << 32 | y;
    c.z[i] = z;
  }
  const size_t i = least_rotation(c);
  // What was stored is loaded in the same pieces, so that no load waits for two stores.
  const uint64_t second = c.xy[i + 1];
  std::array<uint64_t, 5> words{std::rotl(c.xy[i], 32), (second >> 32 << 32) | c.z[i],
                                uint64_t{c.z[i + 1]} << 32 | (second & 0xffffffffu),
                                std::rotl(c.xy[i + 2], 32), c.z[i + 2]};
  for (uint64_t& word : words) word = little_endian(word);
  return xxh64(words.data(), 3 * sizeof(Vec3));
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
