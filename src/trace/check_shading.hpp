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

}  // namespace umbel::trace
