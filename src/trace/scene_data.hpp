// A Scene's data: the mesh as flat arrays, materials, textures, lights.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "bvh/two_level/two_level_bvh.hpp"
#include "trace/alias_table.hpp"
#include "trace/refraction.hpp"
#include "trace/sky.hpp"
#include "trace/texture.hpp"
#include "trace/vector.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {

/// Bits of a triangle's ray mask.
inline constexpr uint32_t kOpaqueBit = 1, kSeeThroughBit = 2;

/// One cache line's quarter a triangle, so that a hit finds all its indices at once.
struct TriangleRecord {
  Triangle corners;
  uint32_t material;
};

/// Properties of a material that are computed once.
struct MaterialKind {
  bool layered = false;  ///< scatters as a LayeredBsdf does
  bool unlit = false;
  bool colored_reflection = false;    ///< not that of index 1.5
  bool straight = false;              ///< may let light through in its direction, beside its alpha
  const BodyAlbedos* body = nullptr;  ///< where it bends light
  Vec3 absorption{0, 0, 0};           ///< inside the body, per unit of length
};

/// A hit, and the transform of the instance that was hit.
using SceneHit = bvh::InstanceHit;
using bvh::InstanceTransform;

struct Scene::Data {
  std::unique_ptr<TriangleQueries> structure;  ///< never null
  /// Instead of it, where the scene is clusters: triangles are then in their parts' spaces.
  std::unique_ptr<const bvh::TwoLevelBvh> clusters;
  float gap = 0;  ///< see ClusterScene
  Aabb bounds;
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;               ///< empty, or one a vertex
  std::vector<Vec2> uvs;                   ///< likewise
  std::vector<std::vector<Vec2>> uv_sets;  ///< set 1 and on; those not in use are empty
  std::vector<Vec4> colors;                ///< likewise
  std::vector<TriangleRecord> triangles;
  std::vector<Material> materials;
  std::vector<MaterialKind> kinds;                         ///< one a material
  std::vector<std::unique_ptr<const BodyAlbedos>> bodies;  ///< one an index
  std::vector<Texture> textures;
  Vec3 up{0, 1, 0};
  Sky sky;
  Sun sun;

  bool see_through = false;      ///< some material is not opaque
  bool absorbs = false;          ///< some body does
  std::vector<uint32_t> lights;  ///< emissive triangles
  AliasTable light_choices;      ///< by area and mean luminance
  /// A power of two by which lengths are about 1, so that their squares are floats.
  float light_scale = 1;
  /// Of each material: probability density of the point that is sampled on a light, by area, in
  /// units of scaled lengths.
  std::vector<float> light_density;

  const std::vector<Vec2>& uvs_of(uint32_t set) const {
    static const std::vector<Vec2> none;
    return set == 0 ? uvs : set <= uv_sets.size() ? uv_sets[set - 1] : none;
  }

  SceneHit intersect(const Ray& ray, const RayOptions& options = {},
                     RayKinds kind = kCameraRays) const {
    if (clusters) return clusters->intersect(ray, options, kind);
    return {{structure->intersect(ray, options)}, 0};
  }
  /// The hit that comes next behind another of the same ray, or at the same t. `ahead` keeps what
  /// follows it, where that is known, for the next call: it is empty before the first of a ray.
  SceneHit next(const Ray& ray, const SceneHit& after, const RayOptions& options, RayKinds kind,
                std::vector<SceneHit>& ahead) const;
  /// Whether anything occludes a shadow or bounce ray.
  bool occluded(const Ray& ray, const RayOptions& options = {}) const {
    return clusters ? clusters->occluded(ray, options, kOtherRays)
                    : structure->occluded(ray, options);
  }
};

/// Whether rays may pass through a surface of this material.
bool is_see_through(const Material& material);

/// The direct product of a material's emission and what its texture says on the whole.
Vec3 mean_emission(const Scene::Data& scene, const Material& material);

}  // namespace umbel::trace
