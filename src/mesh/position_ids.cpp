// Classes of vertices at exactly the same position, each named by its lowest vertex: one pass
// through a hash table in vertex order, with hashes made in parallel beforehand.
#include "base/hash_index.hpp"
#include "base/parallel.hpp"
#include "mesh/vertex_bits.hpp"
#include "umbel/mesh.hpp"

namespace umbel {

std::vector<uint32_t> position_ids(std::span<const Vec3> positions) {
  if (positions.size() >= kNone)
    throw Error(ErrorCode::kInvalidArgument, "positions has " + std::to_string(positions.size()) +
                                                 " elements, but vertices have 32-bit indices");
  std::vector<uint64_t> hashes(positions.size());
  parallel_for(hashes.size(), 1 << 14, [&](size_t i) { hashes[i] = hash_value(positions[i], 0); });

  std::vector<uint32_t> ids(positions.size());
  HashIndex table(positions.size());
  for_each_prefetched(table, hashes, [&](uint32_t i, uint64_t hash) {
    ids[i] = table.find_or_insert(
        hash, i, [&](uint32_t other) { return same_value(positions[i], positions[other]); });
  });
  return ids;
}

}  // namespace umbel
