#include "lod/source.hpp"

#include <algorithm>
#include <cmath>

#include "base/math.hpp"
#include "lod/topology.hpp"

namespace umbel::lod {
namespace {

// Beyond this the square of a distance overflows in selection's 32-bit arithmetic.
constexpr float kLargestCoordinate = 1e18f;

float simplification_scale(const Aabb& box) {
  const Vec3 size = box.max - box.min;
  const float extent = std::max({size.x, size.y, size.z});
  // Ordinary meshes are left alone: scaling could underflow their smallest coordinates.
  if (extent == 0.0f || (extent > 1e-6f && extent < 1e6f)) return 1.0f;
  return std::ldexp(1.0f, -std::ilogb(extent));
}

}  // namespace

Source make_source(const MeshView& input, const BuildOptions& options) {
  Source source;
  source.mesh = weld(input, options);
  const Mesh& mesh = source.mesh;
  const Aabb box = bounds(mesh.view());
  for (float c : {box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z})
    if (!mesh.triangles.empty() && std::fabs(c) > kLargestCoordinate)
      throw Error(ErrorCode::kInvalidMesh, "coordinate " + std::to_string(c) +
                                               " is too large: the limit is 1e18 in magnitude");
  source.position_ids = position_ids(mesh.positions);
  for (uint32_t v = 0; v < source.position_ids.size(); ++v)
    source.has_wedges |= source.position_ids[v] != v;
  source.irregular_components = irregular_components(mesh.triangles, source.position_ids);
  if (!mesh.triangles.empty()) source.scale = simplification_scale(box);

  if (std::any_of(mesh.materials.begin(), mesh.materials.end(),
                  [](uint32_t m) { return m != 0; })) {
    source.vertex_materials.resize(mesh.positions.size());
    for (size_t i = 0; i < mesh.triangles.size(); ++i)
      for (uint32_t v : mesh.triangles[i]) source.vertex_materials[v] = mesh.materials[i];
    source.several_materials.resize(mesh.positions.size(), 0);
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
      const uint32_t p = source.position_ids[v];
      if (source.vertex_materials[v] != source.vertex_materials[p]) source.several_materials[p] = 1;
    }
  }
  return source;
}

}  // namespace umbel::lod
