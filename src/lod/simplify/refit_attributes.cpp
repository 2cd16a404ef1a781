// Attributes of vertices that stay, refitted to the part of the surface that each now stands for
// (Hoppe 1999): the value that minimises the attribute quadric there.
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/math.hpp"
#include "lod/simplify/simplify.hpp"

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

// `candidate` is what the collapser has just made.
void GroupSimplifier::refit_attributes(Candidate& candidate) const {
  const size_t count = attribute_weights_.size();
  std::vector<uint8_t> seen(vertices_.size(), 0);
  std::vector<float> values(count);
  for (const Triangle& t : candidate.triangles)
    for (uint32_t v : t) {
      if (std::exchange(seen[v], 1)) continue;
      std::copy_n(attributes_.begin() + count * v, count, values.begin());
      if (!collapser_.refit(v, values)) continue;
      candidate.refitted.push_back(v);
      candidate.refits.insert(candidate.refits.end(), values.begin(), values.end());
    }
}

// The vertices with their new attributes, in the place of the old ones.
void GroupSimplifier::add_refitted(const Candidate& candidate, Simplified& result) {
  const float* values = candidate.refits.data();
  for (uint32_t v : candidate.refitted) {
    AddedVertices& added = result.added;
    left_.vertices[v] = kAddedVertex + static_cast<uint32_t>(added.position_ids.size());
    Mesh& mesh = added.mesh;
    append_vertex(mesh, source_.mesh, vertices_[v]);
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
    added.position_ids.push_back(position_ids_[position_of_[v]]);
    added.materials.push_back(material(v));
    values += attribute_weights_.size();
  }
}

}  // namespace umbel::lod
