// Interference in a thin film (Belcour & Barla, "A Practical Extension to Microfacet Theory for the
// Modeling of Varying Iridescence", 2017), in the form of KHR_materials_iridescence.
#pragma once

#include "trace/vector.hpp"

namespace umbel::trace {

/// The reflectance at normal incidence with which Schlick's formula gives, at `cosine`, what a film
/// of `thickness` nanometres over a surface of reflectance `f0` reflects there; each in [0, 1].
Vec3 film_reflectance(float cosine, float film_ior, float thickness, const Vec3& f0);

}  // namespace umbel::trace
