// Building a scene: checks, copies, lights.
#include <array>
#include <bit>
#include <map>
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
  const Vec3d size = to_double(scene.bounds.max) - to_double(scene.bounds.min);
  scene.light_scale = std::ldexp(1.0f, -std::clamp(std::ilogb(length(size)), -126, 126));
  const double area = double{scene.light_scale} * scene.light_scale;
  for (size_t m = 0; m < strength.size(); ++m)
    scene.light_density[m] = static_cast<float>(strength[m] / (scene.light_choices.total() * area));
}

template <typename T>
void copy(std::span<const T> from, std::vector<T>& to) {
  to.assign(from.begin(), from.end());
}

UvSets uv_sets_in(bool has_first, std::span<const Extra> extras) {
  UvSets sets = has_first ? 1 : 0;
  for (const Extra& extra : extras)
    if (extra.kind == ExtraKind::kUvs && extra.set < kMostUvSets) sets |= UvSets{1} << extra.set;
  return sets;
}

/// Those sets of texture coordinates beyond the first that materials use.
void copy_uv_sets(const MeshView& mesh, Scene::Data& scene) {
  UvSets used = 0;
  for (const Material& m : scene.materials) used |= uv_sets_used(m);
  scene.uv_sets.resize(used > 1 ? std::bit_width(used) - 1 : 0);
  const uint32_t width = extra_width(mesh.extras);
  uint32_t column = 0;
  for (const Extra& extra : mesh.extras) {
    if (extra.kind == ExtraKind::kUvs && extra.set < kMostUvSets && (used >> extra.set & 1) != 0) {
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
  // Beyond 0 and 1 a surface would send out more light than it gets, or less than none.
  for (Vec4& c : scene.colors)
    for (float* part : {&c.x, &c.y, &c.z, &c.w}) *part = std::clamp(*part, 0.0f, 1.0f);
  const UvSets sets = uv_sets_in(!mesh.uvs.empty(), mesh.extras);
  for (const Material& m : shading.materials) scene.materials.push_back(with_uv_sets(m, sets));
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

SceneHit Scene::Data::next(const Ray& ray, const SceneHit& after, const RayOptions& options,
                           RayKinds kind, std::vector<SceneHit>& ahead) const {
  if (!ahead.empty()) {
    const SceneHit hit = ahead.back();
    ahead.pop_back();
    return hit;
  }
  if (clusters) return clusters->next(ray, after, options, kind, ahead);
  Ray rest = ray;
  rest.t_min = after.t;
  // The hits at the same t come before it: that one, and mostly no other.
  std::array<Hit, 2> few;
  std::vector<Hit> many;
  for (std::span<Hit> hits = few;; hits = many) {
    const size_t count = structure->all_hits(rest, hits, options);
    size_t first = 0;
    while (first < count && !after.precedes({{hits[first]}, 0})) ++first;
    for (size_t i = count; i > first + 1; --i) ahead.push_back({{hits[i - 1]}, 0});
    if (first < count) return {{hits[first]}, 0};
    if (count < hits.size()) return {};
    many.resize(2 * hits.size());
  }
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
    find_lights(*scene.data_);
  });
  scene.data_->structure = std::move(structure);
  return scene;
}

namespace {

/// Parts as one mesh, each in its own space.
struct Joined {
  Mesh mesh;
  std::vector<Range> trees;     ///< triangles of one part that have one mask
  std::vector<Range> of_parts;  ///< the trees of each part
};

/// The sets of texture coordinates beyond the first that any part has.
std::vector<Extra> uv_sets_of(const ClusterScene& clusters) {
  std::vector<Extra> sets;
  for (const ClusterPart& part : clusters.parts)
    for (const Extra& extra : part.geometry.extras)
      if (extra.kind == ExtraKind::kUvs && std::ranges::find(sets, extra) == sets.end())
        sets.push_back(extra);
  std::ranges::sort(sets, {}, &Extra::set);
  return sets;
}

void add_uv_sets(const lod::ClusterGeometry& g, Mesh& mesh) {
  const uint32_t width = extra_width(mesh.extras), from_width = extra_width(g.extras);
  const size_t first = mesh.extra_values.size();
  mesh.extra_values.resize(first + g.positions.size() * width);
  uint32_t from = 0;
  for (const Extra& extra : g.extras) {
    const auto set = std::ranges::find(mesh.extras, extra);
    if (set != mesh.extras.end()) {
      const size_t to = first + 2 * static_cast<size_t>(set - mesh.extras.begin());
      for (size_t v = 0; v < g.positions.size(); ++v)
        for (size_t k = 0; k < 2; ++k)
          mesh.extra_values[to + v * width + k] = g.extra_values[v * from_width + from + k];
    }
    from += extra_width(extra.kind);
  }
}

/// Of the triangle with this first vertex.
uint32_t material_of(const ClusterPart& part, size_t vertex) {
  const lod::ClusterGeometry& g = part.geometry;
  if (g.extras.empty() || g.extras.back().kind != ExtraKind::kMaterial) return part.material;
  const float value = g.extra_values[(vertex + 1) * extra_width(g.extras) - 1];
  return value >= 0 && value <= 0x1p24f ? static_cast<uint32_t>(value) : 0;
}

/// What only some parts have is zero in the others, which a hit takes for nothing, or white. For
/// textures see `fit_materials`.
Joined joined(const ClusterScene& clusters, std::span<const Material> materials) {
  Joined all;
  Mesh& mesh = all.mesh;
  const auto any_has = [&](auto stream) {
    return std::any_of(clusters.parts.begin(), clusters.parts.end(),
                       [&](const ClusterPart& part) { return !(part.geometry.*stream).empty(); });
  };
  const bool normals = any_has(&lod::ClusterGeometry::normals),
             uvs = any_has(&lod::ClusterGeometry::uvs),
             colors = any_has(&lod::ClusterGeometry::colors);
  mesh.extras = uv_sets_of(clusters);
  for (const ClusterPart& part : clusters.parts) {
    const lod::ClusterGeometry& g = part.geometry;
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    const auto add = [&](auto& to, const auto& from, const auto& otherwise) {
      to.insert(to.end(), from.begin(), from.end());
      if (from.empty()) to.resize(first + g.positions.size(), otherwise);
    };
    add(mesh.positions, g.positions, Vec3{});
    if (normals) add(mesh.normals, g.normals, Vec3{0, 0, 0});
    if (uvs) add(mesh.uvs, g.uvs, Vec2{0, 0});
    if (colors) add(mesh.colors, g.colors, Vec4{1, 1, 1, 1});
    if (!mesh.extras.empty()) add_uv_sets(g, mesh);
    Range trees{static_cast<uint32_t>(all.trees.size()), 0};
    for (const bool see_through : {false, true}) {
      const auto offset = static_cast<uint32_t>(mesh.triangles.size());
      for (size_t t = 0; t + 2 < g.triangles.size(); t += 3) {
        const uint32_t m = material_of(part, g.triangles[t]);
        if ((m < materials.size() && is_see_through(materials[m])) != see_through) continue;
        mesh.triangles.push_back(
            {first + g.triangles[t], first + g.triangles[t + 1], first + g.triangles[t + 2]});
        mesh.materials.push_back(m);
      }
      const auto count = static_cast<uint32_t>(mesh.triangles.size()) - offset;
      if (count == 0) continue;
      all.trees.push_back({offset, count});
      ++trees.count;
    }
    all.of_parts.push_back(trees);
  }
  return all;
}

/// Gives triangles of parts that lack texture coordinates which others have materials without the
/// textures that need them. Returns all materials.
std::vector<Material> fit_materials(const ClusterScene& clusters, std::span<const Material> given,
                                    Joined& all) {
  std::vector<Material> materials(given.begin(), given.end());
  if (given.empty()) return materials;
  std::vector<UvSets> used(given.size());
  std::ranges::transform(given, used.begin(), uv_sets_used);
  std::map<std::pair<uint32_t, UvSets>, uint32_t> fitted;
  for (size_t p = 0; p < clusters.parts.size(); ++p) {
    const lod::ClusterGeometry& g = clusters.parts[p].geometry;
    const UvSets there = uv_sets_in(!g.uvs.empty(), g.extras);
    const Range& trees = all.of_parts[p];
    for (const Range& tree : std::span(all.trees).subspan(trees.offset, trees.count)) {
      for (uint32_t& m : std::span(all.mesh.materials).subspan(tree.offset, tree.count)) {
        if ((used[m] & ~there) == 0) continue;
        const auto [at, is_new] =
            fitted.try_emplace({m, used[m] & there}, static_cast<uint32_t>(materials.size()));
        if (is_new) materials.push_back(with_uv_sets(given[m], there));
        m = at->second;
      }
    }
  }
  return materials;
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
  for (size_t i = 0; i < clusters.parts.size(); ++i) {
    const lod::ClusterGeometry& g = clusters.parts[i].geometry;
    const std::string name = "parts[" + std::to_string(i) + "]";
    if (g.triangles.size() < 3) refuse(name + " has no triangles");
    const uint32_t last = *std::ranges::max_element(g.triangles);
    if (last >= g.positions.size())
      refuse(name + " uses vertex " + std::to_string(last) + ", but has only " +
             std::to_string(g.positions.size()));
    if (g.extra_values.size() != g.positions.size() * extra_width(g.extras))
      refuse(name + " has " + std::to_string(g.extra_values.size()) +
             " extra values, but must have " + std::to_string(extra_width(g.extras)) + " a vertex");
  }
}

}  // namespace

Scene Scene::build(const ClusterScene& clusters, const Shading& shading,
                   const BuildOptions& options) {
  check_instances(clusters);
  Scene scene;
  with_threads(options.threads, [&] {
    Joined all = joined(clusters, shading.materials);
    const Mesh& mesh = all.mesh;
    validate(mesh.view());
    check_shading(mesh.view(), shading);
    // Of the materials as given: all triangles of a tree have the same.
    const std::vector<uint32_t> masks = Scene::masks(mesh.view(), shading.materials);
    const std::vector<Material> materials = fit_materials(clusters, shading.materials, all);
    Data& data = *scene.data_;
    data = Data{};
    data.structure = std::make_unique<Bvh>();
    fill(data, mesh.view(), {materials, shading.textures, shading.environment});
    // Without lights, which would be sampled in the space of their part, not where instances are.
    data.light_density.assign(data.materials.size(), 0.0f);

    const std::vector<Aabb> boxes = triangle_boxes(mesh.view());
    bvh::Config config = bvh::preset("fast");
    std::vector<bvh::BottomTree> trees(all.trees.size());
    parallel_for(trees.size(), 16, [&](size_t i) {
      const Range& range = all.trees[i];
      trees[i].triangles = range;
      trees[i].mask = masks.empty() ? kOpaqueBit : masks[range.offset];
      trees[i].tree = bvh::build(std::span(boxes).subspan(range.offset, range.count), config);
      trees[i].tree.nodes.shrink_to_fit();  // builders reserve what leaves of one would need
    });
    static_assert(kCameraRays == bvh::kPrimaryRays && kOtherRays == bvh::kSecondaryRays);
    std::vector<bvh::ClusterInstance> instances;
    for (const ClusterInstance& at : clusters.instances) {
      const Range& own = all.of_parts[at.part];
      for (uint32_t tree = own.offset; tree < own.offset + own.count; ++tree)
        instances.push_back({tree, at.transform, at.rays});
    }
    const std::vector<InstanceTransform> transforms(clusters.transforms.begin(),
                                                    clusters.transforms.end());
    data.clusters = std::make_unique<const bvh::TwoLevelBvh>(
        std::move(trees), instances, transforms, mesh.positions, mesh.triangles);
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
