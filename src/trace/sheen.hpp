// The reflection of cloth (Estevez & Kulla, "Production Friendly Microfacet Sheen BRDF", 2017), as
// KHR_materials_sheen has it.
#pragma once

#include "trace/vector.hpp"

namespace umbel::trace {

/// White cloth's reflectance times the cosine, in the basis in which the normal is z.
float sheen_value(const Vec3& wo, const Vec3& wi, float roughness);

/// Its albedo, at most 1.
float sheen_albedo(float cosine, float roughness);

}  // namespace umbel::trace
