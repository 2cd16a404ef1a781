// What the sample shows without a file of your own: a generated closed mesh, and a field of
// instances of a mesh.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
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

/// The diagonal of a box.
inline float size_of(const umbel::Aabb& box) {
  const float x = box.max.x - box.min.x, y = box.max.y - box.min.y, z = box.max.z - box.min.z;
  return std::sqrt(x * x + y * y + z * z);
}

/// What the sample shows: an asset, and how its instances stand.
struct Field {
  Field(const std::filesystem::path& file, uint32_t instance_count)
      : asset(file),
        box(asset.info().bounds),
        spacing(1.2f * std::max(box.max.x - box.min.x, box.max.z - box.min.z)),
        count(instance_count) {}
  std::vector<umbel::Transform> instances() const { return field(count, spacing); }
  float size() const { return spacing * std::sqrt(static_cast<float>(count)); }

  umbel::Asset asset;
  umbel::Aabb box;
  float spacing;
  uint32_t count;
};

}  // namespace sample
