#include "lod/simplify/add_refitted.hpp"

#include <algorithm>

#include "base/math.hpp"

namespace umbel::lod {
namespace {

// A mean of normals that is shorter than this says nothing of where they point.
constexpr float kLeastNormal = 0.25f;

void refit_normal(Mesh& mesh, const float* values) {
  const Vec3 n{values[0], values[1], values[2]};
  const float size = length(n);
  if (!(size > kLeastNormal)) return;
  mesh.normals.back() = n * (1.0f / size);
  if (mesh.tangents.empty()) return;
  Vec4& tangent = mesh.tangents.back();
  const Vec3& normal = mesh.normals.back();
  const Vec3 t{tangent.x, tangent.y, tangent.z};
  const Vec3 along = t - normal * dot(t, normal);
  const float left = length(along);
  if (left > kLeastNormal) tangent = {along.x / left, along.y / left, along.z / left, tangent.w};
}

}  // namespace

void add_refitted(const GroupMesh& group, const Candidate& candidate, Simplified& result) {
  const float* values = candidate.refitted_values.data();
  for (uint32_t v : candidate.refitted) {
    AddedVertices& added = result.added;
    result.mesh.vertices[v] = kAddedVertex + static_cast<uint32_t>(added.position_ids.size());
    Mesh& mesh = added.mesh;
    append_vertex(mesh, group.source.mesh, group.vertices[v]);
    const float* value = values;
    if (!mesh.normals.empty()) {
      refit_normal(mesh, value);
      value += 3;
    }
    if (!mesh.uvs.empty()) value += 2;  // charts must not shift under their seams
    if (!mesh.colors.empty()) {
      const auto unit = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
      mesh.colors.back() = {unit(value[0]), unit(value[1]), unit(value[2]), unit(value[3])};
    }
    added.position_ids.push_back(group.position_ids[group.position_of[v]]);
    added.materials.push_back(group.material(v));
    values += group.attributes.weights().size();
  }
}

}  // namespace umbel::lod
