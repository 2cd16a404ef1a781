// Whether a configuration can be built, and of a given mesh.
#pragma once

#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// Throws kInvalidArgument with a sentence where it cannot.
void check_config(const MeshView& mesh, const Config& config);

}  // namespace umbel::lod
