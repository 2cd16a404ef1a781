// Meshes of any size and kind, by the seed on the emulated device: over many seeds from one
// triangle to thousands.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ostream>
#include <random>

#include "umbel/mesh.hpp"
#if defined(UMBEL_SIMT)
#include "machine.hpp"
#endif

namespace umbel::cuda {

/// A number in [0, end), by the seed on the emulated device.
inline uint32_t any_below(uint32_t end) {
#if defined(UMBEL_SIMT)
  return simt::random_below(end);
#else
  static std::mt19937 random(1);
  return static_cast<uint32_t>(random() % end);
#endif
}

/// From 1 to `most`; from n to 2n as often as from 2n to 4n.
inline uint32_t any_size(uint32_t most) {
  const double share = any_below(1u << 20) * 0x1p-20;
  return std::min(most, static_cast<uint32_t>(std::exp(share * std::log(most + 1.0))));
}

/// Of up to `most` triangles: unconnected, a surface, around one vertex, flat, or degenerate.
struct AnyMesh : Mesh {
  uint32_t kind, size, seed;

  explicit AnyMesh(uint32_t most)
      : kind(any_below(7)), size(any_size(most)), seed(any_below(1000)) {
    static_cast<Mesh&>(*this) = made();
    if (kind < 4) return;
    for (uint32_t v = 0; v < positions.size(); ++v) {
      const uint32_t corner = v % 3;
      const auto along = static_cast<float>(v);
      positions[v] = kind == 4   ? Vec3{float(corner), float(corner == 1), 0}  // all the same
                     : kind == 5 ? Vec3{along, 0, 0}
                                 : Vec3{1, 2, -0.0f};
    }
  }

 private:
  Mesh made() const {
    const auto side = static_cast<uint32_t>(std::sqrt(size / 2.0)) + 1;
    if (kind == 1) return shapes::terrain(side, std::max(size / 2 / side, 1u), seed);
    if (kind == 2) return shapes::fan(size);
    if (kind == 3) return shapes::grid(side, std::max(size / 2 / side, 1u));
    return shapes::soup(size, seed);
  }
};

inline std::ostream& operator<<(std::ostream& out, const AnyMesh& mesh) {
  return out << "mesh of kind " << mesh.kind << ", size " << mesh.size << ", seed " << mesh.seed;
}

}  // namespace umbel::cuda
