// What the sample shows without a file of your own: a generated closed mesh, and a field of
// instances of a mesh.
#pragma once

#include <cmath>
#include <memory>
#include <umbel/umbel.hpp>
#include <vector>

namespace sample {

/// A closed mesh of 20 * 4^subdivisions triangles, built and written to `path`.
inline void write_blob(const std::filesystem::path& path, uint32_t subdivisions) {
  umbel::write_asset(path, umbel::lod::build(umbel::shapes::blob(subdivisions, 1).view()));
}

/// A square field of so many instances, each turned by itself, `spacing` apart.
inline std::vector<umbel::Transform> field(uint32_t count, float spacing) {
  std::vector<umbel::Transform> out;
  const uint32_t side = static_cast<uint32_t>(std::ceil(std::sqrt(static_cast<double>(count))));
  for (uint32_t i = 0; i < count; ++i) {
    const float angle = count == 1 ? 0 : 2.4f * static_cast<float>(i);
    const float c = std::cos(angle), s = std::sin(angle);
    const float middle = 0.5f * static_cast<float>(side - 1);
    const float x = spacing * (static_cast<float>(i % side) - middle);
    const float z = spacing * (static_cast<float>(i / side) - middle);
    out.push_back({{c, 0, s, x, 0, 1, 0, 0, -s, 0, c, z}});
  }
  return out;
}

}  // namespace sample
