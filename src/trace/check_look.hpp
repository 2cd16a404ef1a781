// What is refused in a look, with a sentence that names it.
#pragma once

#include <array>
#include <string>

#include "umbel/trace.hpp"

namespace umbel::trace {

[[noreturn]] void refuse(const std::string& sentence);

/// Throws kInvalidArgument where a look is out of range or does not fit the mesh.
void check_look(const MeshView& mesh, const Look& look);

/// Every place where a material uses a texture.
std::array<const TextureUse*, 16> texture_uses(const Material& material);

}  // namespace umbel::trace
