// Whether a configuration can be built, and of a given mesh.
#pragma once

#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// The same with limits of 0, which mean that there is none, as what the library can hold.
Config with_limits(const Config& config);

/// Throws kInvalidArgument with a sentence where it cannot.
void check_config(const MeshView& mesh, const Config& config);

}  // namespace umbel::lod
