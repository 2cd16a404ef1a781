// Stores positions once where several vertices have them: at creases and seams. A vertex that has
// the position of an earlier one of its group, its *twin*, takes it from there. Twins lie along
// borders as shared vertices do (see shared_vertices.hpp), but here both borders may be the
// cluster's own. docs/format.md has every bit.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "asset/codec/shared_vertices.hpp"

namespace umbel::asset {

/// Encodes which vertices of each cluster have the position of an earlier one.
class Twins {
 public:
  /// `vertices` in all clusters that will come.
  explicit Twins(size_t vertices);

  /// Writes the twins of the last cluster in `borders`, whose vertices have equals as `equal` says.
  /// `group` are the integers of all vertices so far, `stride` apart, positions first. The result
  /// has for each of its vertices without an equal the twin, or kNone.
  std::vector<uint32_t> encode(const GroupBorders& borders, std::span<const uint32_t> equal,
                               std::span<const int32_t> group, uint32_t stride, BitWriter& out);

 private:
  std::vector<uint32_t> heads_, next_with_hash_;  // border vertices by their positions
};

/// Reads the twins of the last cluster in `borders` into `twin`; false, and nothing in it, if the
/// cluster has none. Throws kCorrupt if a number is out of range.
bool decode_twins(BitReader& in, const GroupBorders& borders, std::span<const uint32_t> equal,
                  std::span<uint32_t> twin);

}  // namespace umbel::asset
