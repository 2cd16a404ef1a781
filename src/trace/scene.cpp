// Building a scene: checks, copies, lights.
#include <array>
#include <string>
#include <utility>

#include "base/parallel.hpp"
#include "base/refuse.hpp"
#include "trace/check_shading.hpp"
#include "trace/layers.hpp"
#include "trace/scene_data.hpp"

namespace umbel::trace {
namespace {

Material default_material() {
  Material plain;
  plain.base_color = {0.75f, 0.75f, 0.75f};
  plain.specular = 0.0f;
  return plain;
}

double area_of(const Scene::Data& scene, const Triangle& t) {
  const Vec3& o = scene.positions[t[0]];
  const auto edge = [&](uint32_t i) {
    const Vec3& p = scene.positions[i];
    return std::array<double, 3>{double{p.x} - o.x, double{p.y} - o.y, double{p.z} - o.z};
  };
  const auto a = edge(t[1]), b = edge(t[2]);
  const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2],
               z = a[0] * b[1] - a[1] * b[0];
  return 0.5 * std::sqrt(x * x + y * y + z * z);
}

void find_lights(Scene::Data& scene) {
  std::vector<double> strength(scene.materials.size());
  for (size_t m = 0; m < strength.size(); ++m)
    strength[m] = luminance(mean_emission(scene, scene.materials[m]));
  std::vector<double> weights;
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const TriangleRecord& record = scene.triangles[i];
    if (!(strength[record.material] > 0.0)) continue;
    const double weight = strength[record.material] * area_of(scene, record.corners);
    if (!(weight > 0.0)) continue;
    scene.lights.push_back(static_cast<uint32_t>(i));
    weights.push_back(weight);
  }
  scene.light_choices = AliasTable(weights);
  scene.light_density.assign(strength.size(), 0.0f);
  if (scene.light_choices.empty()) return;
  for (size_t m = 0; m < strength.size(); ++m)
    scene.light_density[m] = static_cast<float>(strength[m] / scene.light_choices.total());
}

template <typename T>
void copy(std::span<const T> from, std::vector<T>& to) {
  to.assign(from.begin(), from.end());
}

/// Those sets of texture coordinates beyond the first that materials use.
void copy_uv_sets(const MeshView& mesh, Scene::Data& scene) {
  std::vector<bool> used;
  for (const Material& m : scene.materials) {
    for (const TextureUse* use : texture_uses(m)) {
      if (use->texture == kNone || use->uv_set == 0) continue;
      used.resize(std::max<size_t>(used.size(), use->uv_set));
      used[use->uv_set - 1] = true;
    }
  }
  scene.uv_sets.resize(used.size());
  const uint32_t width = extra_width(mesh.extras);
  uint32_t column = 0;
  for (const Extra& extra : mesh.extras) {
    if (extra.kind == ExtraKind::kUvs && extra.set <= used.size() && used[extra.set - 1]) {
      std::vector<Vec2>& to = scene.uv_sets[extra.set - 1];
      to.resize(mesh.positions.size());
      for (size_t i = 0; i < to.size(); ++i) {
        const float* from = &mesh.extra_values[i * width + column];
        to[i] = {from[0], from[1]};
      }
    }
    column += extra_width(extra.kind);
  }
}

void fill(Scene::Data& scene, const MeshView& mesh, const Shading& shading) {
  scene.bounds = bounds(mesh);
  copy(mesh.positions, scene.positions);
  copy(mesh.normals, scene.normals);
  copy(mesh.uvs, scene.uvs);
  copy(mesh.colors, scene.colors);
  copy(shading.materials, scene.materials);
  if (scene.materials.empty()) scene.materials.push_back(default_material());
  for (const TextureView& texture : shading.textures) scene.textures.emplace_back(texture);
  scene.triangles.resize(mesh.triangles.size());
  const bool one_material = mesh.materials.empty() || shading.materials.empty();
  parallel_for(scene.triangles.size(), 4096, [&](size_t i) {
    scene.triangles[i] = {mesh.triangles[i], one_material ? 0 : mesh.materials[i]};
  });
  scene.up = normalized(shading.environment.up, {0, 1, 0});
  scene.sky = Sky(shading.environment);
  scene.sun = Sun(shading.environment);
  copy_uv_sets(mesh, scene);
  sort_materials(scene);
  find_lights(scene);
}

void check_structure(const TriangleQueries* structure, size_t triangles) {
  if (!structure) refuse("there is no structure");
  if (structure->triangle_count() != triangles)
    refuse("the structure has " + std::to_string(structure->triangle_count()) +
           " triangles, but the scene has " + std::to_string(triangles));
}

}  // namespace

Vec3 mean_emission(const Scene::Data& scene, const Material& m) {
  if (m.unlit) return {0, 0, 0};  // what it shows is found by bounces alone
  if (m.emission_texture.texture == kNone) return m.emission;
  const Vec4& mean = scene.textures[m.emission_texture.texture].mean();
  return m.emission * Vec3{mean.x, mean.y, mean.z};
}

Scene::Scene() : data_(std::make_unique<Data>()) {
  data_->structure = std::make_unique<Bvh>();
  data_->materials.push_back(default_material());
  sort_materials(*data_);
  data_->light_density.assign(1, 0.0f);
  data_->sky = Sky(Environment{});
  data_->sun = Sun(Environment{});
}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

std::vector<uint32_t> Scene::masks(const MeshView& mesh, std::span<const Material> materials) {
  if (std::none_of(materials.begin(), materials.end(), is_see_through)) return {};
  std::vector<uint32_t> bits(mesh.triangles.size());
  for (size_t i = 0; i < bits.size(); ++i) {
    const uint32_t m = mesh.materials.empty() ? 0 : mesh.materials[i];
    const bool see_through = m < materials.size() && is_see_through(materials[m]);
    bits[i] = see_through ? kSeeThroughBit : kOpaqueBit;
  }
  return bits;
}

Scene Scene::build(const MeshView& mesh, const Shading& shading, const BvhConfig& config,
                   const BuildOptions& options) {
  validate(mesh, {.progress = {}, .threads = options.threads});
  check_shading(mesh, shading);
  auto bvh =
      std::make_unique<Bvh>(Bvh::build(mesh, config, masks(mesh, shading.materials), options));
  return build(mesh, shading, std::move(bvh), {.progress = {}, .threads = options.threads});
}

Scene Scene::build(const MeshView& mesh, const Shading& shading,
                   std::unique_ptr<TriangleQueries> structure, const BuildOptions& options) {
  Scene scene;
  with_threads(options.threads, [&] {
    validate(mesh);
    check_shading(mesh, shading);
    check_structure(structure.get(), mesh.triangles.size());
    *scene.data_ = Data{};
    fill(*scene.data_, mesh, shading);
  });
  scene.data_->structure = std::move(structure);
  return scene;
}

namespace {

/// All parts as one mesh, each in its own space.
Mesh joined(const ClusterScene& clusters, std::vector<Range>& ranges) {
  Mesh mesh;
  const auto all_have = [&](auto stream) {
    return std::all_of(clusters.parts.begin(), clusters.parts.end(),
                       [&](const ClusterPart& part) { return !(part.geometry.*stream).empty(); });
  };
  const bool normals = all_have(&lod::ClusterGeometry::normals),
             uvs = all_have(&lod::ClusterGeometry::uvs),
             colors = all_have(&lod::ClusterGeometry::colors);
  const bool extras =
      !clusters.parts.empty() &&
      std::all_of(clusters.parts.begin(), clusters.parts.end(), [&](const ClusterPart& part) {
        return part.geometry.extras == clusters.parts.front().geometry.extras;
      });
  if (extras) mesh.extras = clusters.parts.front().geometry.extras;
  const auto add = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  for (const ClusterPart& part : clusters.parts) {
    const lod::ClusterGeometry& g = part.geometry;
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    ranges.push_back({static_cast<uint32_t>(mesh.triangles.size()),
                      static_cast<uint32_t>(g.triangles.size() / 3)});
    add(mesh.positions, g.positions);
    if (normals) add(mesh.normals, g.normals);
    if (uvs) add(mesh.uvs, g.uvs);
    if (colors) add(mesh.colors, g.colors);
    if (extras) add(mesh.extra_values, g.extra_values);
    for (size_t t = 0; t + 2 < g.triangles.size(); t += 3)
      mesh.triangles.push_back(
          {first + g.triangles[t], first + g.triangles[t + 1], first + g.triangles[t + 2]});
    mesh.materials.resize(mesh.triangles.size(), part.material);
  }
  return mesh;
}

void check_instances(const ClusterScene& clusters) {
  for (size_t i = 0; i < clusters.instances.size(); ++i) {
    const ClusterInstance& at = clusters.instances[i];
    if (at.part >= clusters.parts.size() || at.transform >= clusters.transforms.size())
      refuse("instances[" + std::to_string(i) + "] is part " + std::to_string(at.part) +
             " by transform " + std::to_string(at.transform) + ", but there are " +
             std::to_string(clusters.parts.size()) + " and " +
             std::to_string(clusters.transforms.size()));
  }
  for (size_t i = 0; i < clusters.parts.size(); ++i)
    if (clusters.parts[i].geometry.triangles.size() < 3)
      refuse("parts[" + std::to_string(i) + "] has no triangles");
}

}  // namespace

Scene Scene::build(const ClusterScene& clusters, const Shading& shading,
                   const BuildOptions& options) {
  check_instances(clusters);
  Scene scene;
  with_threads(options.threads, [&] {
    std::vector<Range> ranges;
    const Mesh mesh = joined(clusters, ranges);
    validate(mesh.view());
    check_shading(mesh.view(), shading);
    Data& data = *scene.data_;
    data = Data{};
    data.structure = std::make_unique<Bvh>();
    fill(data, mesh.view(), shading);
    // Lights would be sampled in the space of their part, not where instances are.
    data.lights.clear();
    data.light_choices = {};
    std::fill(data.light_density.begin(), data.light_density.end(), 0.0f);

    const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
    const std::vector<uint32_t> masks = Scene::masks(mesh.view(), shading.materials);
    bvh::Config config = bvh::preset("fast");
    std::vector<bvh::BottomTree> parts(ranges.size());
    parallel_for(parts.size(), 16, [&](size_t i) {
      const Range& range = ranges[i];
      parts[i].triangles = range;
      parts[i].mask = masks.empty() ? kOpaqueBit : masks[range.offset];
      parts[i].tree = bvh::build(std::span(boxes).subspan(range.offset, range.count), config);
      parts[i].tree.nodes.shrink_to_fit();  // builders reserve what leaves of one would need
    });
    static_assert(kCameraRays == bvh::kPrimaryRays && kOtherRays == bvh::kSecondaryRays);
    std::vector<bvh::ClusterInstance> instances;
    for (const ClusterInstance& at : clusters.instances)
      instances.push_back({at.part, at.transform, at.rays});
    const std::vector<InstanceTransform> transforms(clusters.transforms.begin(),
                                                    clusters.transforms.end());
    data.clusters = std::make_unique<const bvh::TwoLevelBvh>(
        std::move(parts), instances, transforms, mesh.positions, mesh.triangles);
    data.bounds = data.clusters->bounds();
    data.gap = clusters.gap;
  });
  return scene;
}

uint64_t Scene::instanced_triangles() const {
  return data_->clusters ? data_->clusters->instanced_triangles() : data_->triangles.size();
}

uint64_t Scene::bytes() const {
  const Data& d = *data_;
  const auto* bvh = dynamic_cast<const Bvh*>(d.structure.get());
  const uint64_t of_structure = bvh ? bvh->statistics().bytes : 0;
  return (d.clusters ? d.clusters->bytes() : of_structure) + d.positions.size() * sizeof(Vec3) +
         d.normals.size() * sizeof(Vec3) + d.uvs.size() * sizeof(Vec2) +
         d.colors.size() * sizeof(Vec4) + d.triangles.size() * sizeof(TriangleRecord);
}

void Scene::replace_structure(std::unique_ptr<TriangleQueries> structure) {
  check_structure(structure.get(), data_->triangles.size());
  data_->structure = std::move(structure);
}

const TriangleQueries& Scene::structure() const { return *data_->structure; }
Aabb Scene::bounds() const { return data_->bounds; }
uint32_t Scene::triangle_count() const { return static_cast<uint32_t>(data_->triangles.size()); }
uint32_t Scene::light_count() const { return static_cast<uint32_t>(data_->lights.size()); }

}  // namespace umbel::trace
