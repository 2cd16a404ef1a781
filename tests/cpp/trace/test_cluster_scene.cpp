#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/math.hpp"
#include "trace/scene_data.hpp"
#include "trace/surface.hpp"
#include "umbel/lod.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {
namespace {

constexpr Transform kIdentity;

void add_level(ClusterScene& scene, const lod::Dag& dag, uint32_t level, RayKinds rays) {
  for (const uint32_t c : lod::select(dag.tables, lod::view_level(level))) {
    scene.instances.push_back({static_cast<uint32_t>(scene.parts.size()), 0, rays});
    scene.parts.push_back({dag.geometry(c), 0});
  }
}

/// All clusters of a level, where they are.
ClusterScene clusters_of(const lod::Dag& dag, uint32_t level = 0) {
  ClusterScene scene;
  scene.transforms = {kIdentity};
  add_level(scene, dag, level, kAllRays);
  return scene;
}

float hash(uint32_t i) {
  return std::fmod(std::sin(static_cast<float>(i) * 12.9898f) * 43758.5f, 1.0f);
}

Ray ray_of(uint32_t i) {
  Ray ray;
  ray.origin = {2 * hash(6 * i), 2 * hash(6 * i + 1), 2 * hash(6 * i + 2)};
  ray.direction = {hash(6 * i + 3), hash(6 * i + 4), hash(6 * i + 5)};
  return ray;
}

TEST(ClusterScene, is_hit_where_one_tree_over_all_triangles_is) {
  const Mesh mesh = shapes::blob(5, 2);
  const lod::Dag dag = lod::build(mesh.view());
  const Scene clusters = Scene::build(clusters_of(dag), {});
  const Scene whole = Scene::build(mesh.view());
  EXPECT_EQ(clusters.instanced_triangles(), mesh.triangles.size());
  EXPECT_GT(clusters.bytes(), 0u);
  uint32_t hits = 0;
  for (uint32_t i = 0; i < 3000; ++i) {
    const Ray ray = ray_of(i);
    const SceneHit one = clusters.data().intersect(ray), other = whole.data().intersect(ray);
    ASSERT_EQ(one.hit(), other.hit()) << i;
    EXPECT_EQ(clusters.data().occluded(ray), one.hit());
    if (!one.hit()) continue;
    ++hits;
    EXPECT_NEAR(one.t, other.t, 1e-5f * std::max(other.t, 1.0f)) << i;
  }
  EXPECT_GT(hits, 500u);
}

TEST(ClusterScene, with_transforms_is_hit_where_the_transformed_mesh_is) {
  const Mesh mesh = shapes::blob(4, 5);
  const lod::Dag dag = lod::build(mesh.view());
  ClusterScene scene = clusters_of(dag);
  const auto parts = static_cast<uint32_t>(scene.parts.size());
  // Turned, stretched, mirrored and moved.
  scene.transforms.push_back({{0, -0.5f, 0, 1.2f, 0.7f, 0, 0, -0.4f, 0, 0, -0.3f, 0.5f}});
  for (uint32_t p = 0; p < parts; ++p) scene.instances.push_back({p, 1});
  const Scene clusters = Scene::build(scene, {});
  Mesh both = mesh;
  const InstanceTransform transform(scene.transforms[1]);
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (const Vec3& p : mesh.positions) both.positions.push_back(transform.point_to_world(p));
  for (const Triangle& t : mesh.triangles)
    both.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  const Scene whole = Scene::build(both.view());
  EXPECT_EQ(clusters.instanced_triangles(), both.triangles.size());
  uint32_t moved = 0;
  for (uint32_t i = 0; i < 3000; ++i) {
    const Ray ray = ray_of(i);
    const SceneHit one = clusters.data().intersect(ray), other = whole.data().intersect(ray);
    ASSERT_EQ(one.hit(), other.hit()) << i;
    if (!one.hit()) continue;
    ASSERT_NEAR(one.t, other.t, 1e-4f * std::max(other.t, 1.0f)) << i;
    moved += one.transform;
    const Surface a = surface_at(clusters.data(), one, ray.direction);
    const Surface b = surface_at(whole.data(), other, ray.direction);
    EXPECT_LT(length(a.point - b.point), 1e-4f);
    if (one.primitive == other.primitive % mesh.triangles.size()) {
      EXPECT_GT(dot(a.face, b.face), 0.999f);
    }
    EXPECT_LT(dot(a.face, ray.direction), 1e-6f);
  }
  EXPECT_GT(moved, 20u);
}

TEST(ClusterScene, gives_the_picture_of_the_same_mesh) {
  const Mesh mesh = shapes::blob(4, 1);
  const Scene clusters = Scene::build(clusters_of(lod::build(mesh.view())), {});
  const Scene whole = Scene::build(mesh.view());
  Camera camera;
  camera.position = {0, 0, 3};
  Settings settings;
  settings.width = 48, settings.height = 36, settings.samples = 16;
  const Image one = render(clusters, camera, settings).image;
  const Image other = render(whole, camera, settings).image;
  double difference = 0, sum = 0;
  for (size_t i = 0; i < one.pixels.size(); ++i) {
    difference += length(one.pixels[i] - other.pixels[i]);
    sum += length(other.pixels[i]);
  }
  EXPECT_LT(difference, 0.01 * sum);
}

TEST(ClusterScene, rays_that_bounce_may_meet_a_coarser_cut) {
  const lod::Dag dag = lod::build(shapes::blob(5, 2).view());
  ClusterScene both{{}, {}, {kIdentity}};
  add_level(both, dag, 0, kCameraRays);
  add_level(both, dag, 3, kOtherRays);
  both.gap = 0.02f;
  const Scene fine = Scene::build(clusters_of(dag), {});
  const Scene coarse = Scene::build(clusters_of(dag, 3), {});
  const Scene scene = Scene::build(both, {});
  ASSERT_LT(coarse.instanced_triangles(), fine.instanced_triangles() / 4);
  EXPECT_EQ(scene.instanced_triangles(), fine.instanced_triangles());
  for (uint32_t i = 0; i < 1000; ++i) {
    const Ray ray = ray_of(i);
    EXPECT_EQ(scene.data().intersect(ray).t, fine.data().intersect(ray).t);
    EXPECT_EQ(scene.data().intersect(ray, {}, kOtherRays).t, coarse.data().intersect(ray).t);
    EXPECT_EQ(scene.data().occluded(ray), coarse.data().occluded(ray));
  }
  const Settings settings{.width = 32, .height = 24, .samples = 32};
  const Camera camera = auto_camera(fine, 32, 24);
  const Image one = render(scene, camera, settings).image,
              other = render(fine, camera, settings).image;
  double difference = 0, sum = 0;
  for (size_t i = 0; i < one.pixels.size(); ++i) {
    difference += length(one.pixels[i] - other.pixels[i]);
    sum += length(other.pixels[i]);
  }
  EXPECT_GT(difference, 0);
  EXPECT_LT(difference, 0.05 * sum);
}

/// A square at x = 2 i seen from +z, in one part.
ClusterPart square_part(uint32_t i) {
  ClusterPart part;
  const float x = 2 * static_cast<float>(i);
  part.geometry.positions = {{x, 0, 0}, {x + 1, 0, 0}, {x + 1, 1, 0}, {x, 1, 0}};
  part.geometry.triangles = {0, 1, 2, 0, 2, 3};
  return part;
}

/// The same, the lower triangle of one material and the upper, which has vertices of its own, of
/// another.
ClusterPart mixed_part(uint32_t i, uint32_t lower, uint32_t upper) {
  ClusterPart part = square_part(i);
  lod::ClusterGeometry& g = part.geometry;
  g.positions.push_back(g.positions[0]);
  g.positions.push_back(g.positions[2]);
  g.triangles = {0, 1, 2, 4, 5, 3};
  g.extras = {{ExtraKind::kMaterial, 0}};
  const auto a = static_cast<float>(lower), b = static_cast<float>(upper);
  g.extra_values = {a, a, a, b, b, b};
  return part;
}

/// A scene of parts that are not moved.
ClusterScene scene_of(std::vector<ClusterPart> parts) {
  ClusterScene clusters;
  clusters.transforms = {kIdentity};
  for (uint32_t i = 0; i < parts.size(); ++i) clusters.instances.push_back({i, 0});
  clusters.parts = std::move(parts);
  return clusters;
}

/// What a ray down at the middle of the lower (or upper) triangle of square i meets.
Surface seen(const Scene& scene, uint32_t i, bool upper = false) {
  Ray ray;
  ray.origin = {2 * static_cast<float>(i) + (upper ? 0.25f : 0.75f), upper ? 0.75f : 0.25f, 1};
  ray.direction = {0, 0, -1};
  const SceneHit hit = scene.data().intersect(ray);
  EXPECT_TRUE(hit.hit());
  return surface_at(scene.data(), hit, ray.direction);
}

TEST(ClusterScene, parts_keep_the_attributes_that_others_lack) {
  ClusterScene clusters;
  clusters.transforms = {kIdentity};
  for (uint32_t i = 0; i < 4; ++i) {
    clusters.parts.push_back(square_part(i));
    clusters.parts[i].material = i;
    clusters.instances.push_back({i, 0});
  }
  const Vec3 leaning = {0.6f, 0, 0.8f};
  clusters.parts[0].geometry.normals.assign(4, leaning);
  clusters.parts[1].geometry.colors.assign(4, {0.5f, 1, 1, 1});
  clusters.parts[2].geometry.uvs.assign(4, {0.75f, 0.5f});
  // Its second set, beside what is not read.
  clusters.parts[3].geometry.extras = {{ExtraKind::kUvs, 2}, {ExtraKind::kWeights, 0}};
  for (uint32_t v = 0; v < 4; ++v)
    clusters.parts[3].geometry.extra_values.insert(clusters.parts[3].geometry.extra_values.end(),
                                                   {0.75f, 0.5f, 1, 1, 1, 1});
  const std::vector<uint8_t> texels = {255, 255, 255, 255, 0, 0, 0, 255};
  const TextureView texture{.texels = texels, .width = 2, .height = 1, .nearest = true};
  std::vector<Material> materials(4);
  for (Material& m : materials) m.base_color = {1, 1, 1};
  materials[2].base_color_texture.texture = materials[3].base_color_texture.texture = 0;
  materials[3].base_color_texture.uv_set = 2;
  const Scene scene = Scene::build(clusters, {materials, std::span(&texture, 1), {}});
  EXPECT_NEAR(length(seen(scene, 0).shading - leaning), 0, 1e-6f);
  EXPECT_EQ(seen(scene, 1).shading, (Vec3{0, 0, 1}));
  EXPECT_EQ(seen(scene, 0).color.base, (Vec3{1, 1, 1}));
  EXPECT_EQ(seen(scene, 1).color.base, (Vec3{0.5f, 1, 1}));
  EXPECT_EQ(seen(scene, 2).color.base, (Vec3{0, 0, 0}));
  EXPECT_EQ(seen(scene, 3).color.base, (Vec3{0, 0, 0}));
}

TEST(ClusterScene, parts_without_texture_coordinates_are_without_textures) {
  ClusterScene clusters = scene_of({square_part(0), square_part(1), square_part(2)});
  clusters.parts[1].geometry.uvs.assign(4, {0.75f, 0.5f});
  clusters.parts[2].material = 1;
  const std::vector<uint8_t> texels = {0, 0, 0, 255, 0, 255, 0, 255};
  const TextureView texture{.texels = texels, .width = 2, .height = 1, .nearest = true};
  std::vector<Material> materials(2);
  for (Material& m : materials) m.base_color = {1, 1, 0.5f};
  materials[0].base_color_texture.texture = materials[1].base_color_texture.texture = 0;
  materials[1].base_color_texture.uv_set = 63;
  const Scene scene = Scene::build(clusters, {materials, std::span(&texture, 1), {}});
  EXPECT_EQ(seen(scene, 0).color.base, (Vec3{1, 1, 0.5f}));
  EXPECT_EQ(seen(scene, 1).color.base, (Vec3{0, 1, 0}));
  EXPECT_EQ(seen(scene, 2).color.base, (Vec3{1, 1, 0.5f}));
  clusters.parts[2].material = 2;
  EXPECT_THROW(Scene::build(clusters, {materials, std::span(&texture, 1), {}}), Error);
}

TEST(ClusterScene, a_part_may_mix_materials) {
  const ClusterScene clusters = scene_of({mixed_part(0, 1, 0)});
  std::vector<Material> materials(2);
  materials[0].alpha_mode = AlphaMode::kBlend;
  const Scene scene = Scene::build(clusters, {materials, {}, {}});
  EXPECT_EQ(seen(scene, 0).material, 1u);
  EXPECT_EQ(seen(scene, 0, true).material, 0u);
  // Only what is opaque occludes at once.
  Ray ray;
  ray.direction = {0, 0, -1};
  ray.origin = {0.75f, 0.25f, 1};
  EXPECT_TRUE(scene.data().occluded(ray, {.mask = kOpaqueBit}));
  ray.origin = {0.25f, 0.75f, 1};
  EXPECT_FALSE(scene.data().occluded(ray, {.mask = kOpaqueBit}));
  EXPECT_EQ(scene.instanced_triangles(), 2u);
}

TEST(ClusterScene, what_loses_its_texture_leaves_the_rest_of_its_part_see_through) {
  ClusterScene clusters = scene_of({mixed_part(0, 0, 1), square_part(1)});
  clusters.parts[1].geometry.uvs.assign(4, {0.5f, 0.5f});
  const std::vector<uint8_t> texels = {0, 0, 0, 255};
  const TextureView texture{.texels = texels, .width = 1, .height = 1, .nearest = true};
  std::vector<Material> materials(2);
  materials[0].transmission = materials[0].roughness = 1.0f;  // clear by its texture alone
  materials[0].metallic_roughness_texture.texture = 0;
  materials[1].alpha_mode = AlphaMode::kBlend;
  const Scene scene = Scene::build(clusters, {materials, std::span(&texture, 1), {}});
  Ray ray;
  ray.direction = {0, 0, -1};
  ray.origin = {0.25f, 0.75f, 1};
  EXPECT_FALSE(scene.data().occluded(ray, {.mask = kOpaqueBit}));
}

TEST(ClusterScene, hits_at_the_same_t_follow_each_other) {
  ClusterScene clusters;
  clusters.transforms = {kIdentity, kIdentity};
  ClusterPart part;
  part.geometry.positions = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0},
                             {-1, -1, 1}, {1, -1, 1}, {0, 1, 1}};
  part.geometry.triangles = {0, 1, 2, 0, 1, 2, 3, 4, 5};
  clusters.parts = {part};
  clusters.instances = {{0, 0}, {0, 1}, {0, 1}, {0, 0}};  // each twice, which changes nothing
  const Scene scene = Scene::build(clusters, {});
  const Scene::Data& data = scene.data();
  Ray ray;
  ray.origin = {0.1f, 0, -1};
  ray.direction = {0, 0, 1};
  SceneHit hit = data.intersect(ray);
  std::vector<SceneHit> ahead;
  std::vector<std::array<float, 3>> found;
  for (; hit.hit(); hit = data.next(ray, hit, {}, kCameraRays, ahead))
    found.push_back({hit.t, float(hit.primitive), float(hit.transform)});
  const std::vector<std::array<float, 3>> expected = {{1, 0, 0}, {1, 0, 1}, {1, 1, 0},
                                                      {1, 1, 1}, {2, 2, 0}, {2, 2, 1}};
  EXPECT_EQ(found, expected);
}

TEST(ClusterScene, refuses_what_does_not_fit) {
  const lod::Dag dag = lod::build(shapes::sphere(2).view());
  const ClusterScene good = clusters_of(dag);
  ClusterScene scene = good;
  scene.instances[0].part = 1000;
  EXPECT_THROW(Scene::build(scene, {}), Error);
  scene = good;
  scene.instances[0].transform = 1;
  EXPECT_THROW(Scene::build(scene, {}), Error);
  scene = good;
  scene.transforms[0].rows = {};
  EXPECT_THROW(Scene::build(scene, {}), Error);
  scene = good;
  scene.parts[0].geometry.triangles.clear();
  EXPECT_THROW(Scene::build(scene, {}), Error);
  scene = good;
  scene.parts[0].geometry.triangles[0] = 255;
  EXPECT_THROW(Scene::build(scene, {}), Error);
  scene = good;
  scene.parts[0].geometry.extras = {{ExtraKind::kMaterial, 0}};
  EXPECT_THROW(Scene::build(scene, {}), Error);
  EXPECT_EQ(Scene::build(ClusterScene{}, {}).instanced_triangles(), 0u);
}

}  // namespace
}  // namespace umbel::trace
