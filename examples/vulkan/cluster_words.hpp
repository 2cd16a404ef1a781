// How a cluster's geometry lies in the pool: four words a vertex (position, and a word that is free
// for a normal or texture coordinates), then three half words a triangle.
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <umbel/lod/types.hpp>

namespace sample {

constexpr uint32_t words_of(uint32_t vertices, uint32_t triangles) {
  return 4 * vertices + (3 * triangles + 1) / 2;
}

inline void write_cluster(const umbel::lod::ClusterGeometry& geometry, std::span<uint32_t> out) {
  size_t w = 0;
  for (const umbel::Vec3& p : geometry.positions) {
    out[w++] = std::bit_cast<uint32_t>(p.x);
    out[w++] = std::bit_cast<uint32_t>(p.y);
    out[w++] = std::bit_cast<uint32_t>(p.z);
    out[w++] = 0;
  }
  for (size_t i = 0; i < geometry.triangles.size(); i += 2) {
    const uint32_t second = i + 1 < geometry.triangles.size() ? geometry.triangles[i + 1] : 0u;
    out[w++] = geometry.triangles[i] | second << 16;
  }
}

}  // namespace sample
