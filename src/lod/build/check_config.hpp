// Whether a configuration can be built, and of a given mesh.
#pragma once

#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// The same with limits of 0, which mean that there is none, as what the library can hold.
Config with_limits(const Config& config);

/// With mix_materials, the numbers up to this are kept.
inline constexpr uint32_t kMostMixedMaterial = 1 << 24;

/// Throws kInvalidArgument with a sentence where no mesh can be built with it, or this one cannot.
void check_config(const Config& config);
void check_config(const MeshView& mesh, const Config& config);

}  // namespace umbel::lod
