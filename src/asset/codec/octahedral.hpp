// Octahedral integers of unit vectors, and back (Meyer et al., "On Floating-Point Normal Vectors",
// 2010).
#pragma once

#include <cstdint>
#include <span>

#include "umbel/mesh.hpp"

namespace umbel::asset {

/// The largest integer of an octahedral component of `bits` bits, 1 on the octahedron.
constexpr int32_t octahedral_steps(uint32_t bits) { return (int32_t{1} << bits) / 2 - 1; }

Vec3 decoded_normal(const int32_t* in, uint32_t bits);
/// As many normals as `out` has room for, whose integers are `stride` apart.
void decode_normals(const int32_t* in, uint32_t stride, uint32_t bits, std::span<Vec3> out);

}  // namespace umbel::asset
