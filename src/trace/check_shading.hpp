// Checks of materials, textures and the environment.
#pragma once

#include <array>
#include <string>

#include "umbel/trace.hpp"

namespace umbel::trace {

/// Throws kInvalidArgument where a shading is out of range or does not fit the mesh.
void check_shading(const MeshView& mesh, const Shading& shading);

/// All textures that a material may use.
std::array<const TextureUse*, 16> texture_uses(const Material& material);

/// Sets of texture coordinates, a bit each.
using UvSets = uint64_t;
constexpr uint32_t kMostUvSets = 64;
/// The sets that a material's textures use.
UvSets uv_sets_used(const Material& material);
/// The material without the textures that use other sets than these.
Material with_uv_sets(Material material, UvSets sets);

}  // namespace umbel::trace
