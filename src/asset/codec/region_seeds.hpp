// Where the traversal of a cluster goes on once it has a whole connected region. The first vertex
// of the next region is predicted by the last one of this, and the two after it by each other, so
// they should be alike.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/simd/float4.hpp"

namespace umbel::asset {

class RegionSeeds {
 public:
  /// `values` are the vertices' integers, as many for each; without any, all vertices are alike.
  RegionSeeds(std::span<const uint8_t> triangles, std::span<const int32_t> values,
              uint32_t vertices);

  struct Seed {
    uint32_t triangle, corner;  ///< the corner comes first
  };
  /// The first region's seed.
  static constexpr Seed kFirst{0, 0};
  /// The seed after the vertex `last`, among the triangles that are not in `visited`: there must be
  /// one. A vertex in `known` takes about `known_bits`.
  Seed next(uint8_t last, std::span<const bool> visited, std::span<const bool> known,
            uint32_t known_bits);

 private:
  void load_values();
  uint32_t cost_of(size_t from, size_t to) const;
  void find_costs(uint8_t last, std::span<const bool> known, uint32_t known_bits);

  std::span<const uint8_t> triangles_;
  std::span<const int32_t> values_;
  uint32_t vertices_;
  size_t blocks_ = 0;                 ///< of four components, a vertex
  std::vector<Int4> rows_;            ///< the vertices' values, padded with zeros
  std::vector<uint32_t> rest_;        ///< triangles that were not visited, in order
  std::vector<uint32_t> edge_costs_;  ///< by corner: from its vertex to the next corner's
  std::vector<uint32_t> costs_;       ///< by vertex: from the last one
};

}  // namespace umbel::asset
