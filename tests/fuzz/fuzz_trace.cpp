// Fuzzes the path tracer: the bytes become a mesh (NaN, infinite and huge positions, coordinates of
// textures and colours among them), materials, textures of any size, an environment, clusters by
// transforms, a camera and settings. Whatever is accepted must be rendered without a fault, and the
// same by any number of threads.
#include <array>
#include <cstring>
#include <vector>

#include "c_interface.hpp"
#include "umbel/trace.hpp"

namespace {

using umbel::Vec3;
using umbel::fuzz::expect;
using umbel::fuzz::Input;
namespace trace = umbel::trace;

Vec3 point(Input& in) {
  const umbel_vec3 p = in.point();
  return {p.x, p.y, p.z};
}

/// Within [0, 1], where most of what is fuzzed is refused otherwise.
float share(Input& in) { return in.seldom(32) ? in.number() : in.bytes.probability(); }
Vec3 color(Input& in) {
  const float r = share(in), g = share(in);
  return {r, g, share(in)};
}

umbel::Mesh read_mesh(Input& in) {
  umbel::Mesh mesh;
  for (uint32_t i = 3 + in.below(30); i-- > 0;) mesh.positions.push_back(point(in));
  const auto vertices = static_cast<uint32_t>(mesh.positions.size());
  for (uint32_t i = in.below(24); i-- > 0;)
    mesh.triangles.push_back({in.below(vertices), in.below(vertices), in.below(vertices)});
  if (in.likes(1))
    for (uint32_t i = 0; i < vertices; ++i) mesh.normals.push_back(point(in));
  if (in.likes(2))
    for (uint32_t i = 0; i < vertices; ++i) mesh.uvs.push_back({in.number(), 8 * in.number()});
  if (in.likes(3))
    for (uint32_t i = 0; i < vertices; ++i)
      mesh.colors.push_back({share(in), share(in), share(in), share(in)});
  return mesh;
}

struct Shading {
  std::vector<trace::Material> materials;
  std::vector<std::vector<uint8_t>> texels;
  std::vector<trace::TextureView> textures;
  trace::Environment environment;
  trace::Shading view() const { return {materials, textures, environment}; }
};

trace::TextureUse texture_use(Input& in, const Shading& shading) {
  trace::TextureUse use;
  if (shading.textures.empty() || in.below(2)) return use;
  use.texture = in.below(static_cast<uint32_t>(shading.textures.size()) + (in.seldom(64) ? 1 : 0));
  if (in.likes(4)) {
    use.offset = {in.number(), in.number()};
    use.scale = {in.number(), in.number()};
    use.rotation = in.number();
    use.uv_set = in.seldom(8) ? in.below(255) : 0;
  }
  return use;
}

/// What glTF's extensions add.
void add_layers(Input& in, const Shading& shading, trace::Material& m) {
  m.unlit = in.seldom(8);
  m.ior = in.seldom(8) ? in.number() : 1 + in.bytes.probability();
  m.body = in.below(2) != 0;
  m.attenuation_distance = in.number();
  m.clearcoat_normal_scale = in.number();
  m.iridescence_ior = 1 + share(in);
  m.iridescence_thickness_min = 400 * share(in);
  m.iridescence_thickness_max = 400 * share(in);
  for (float* value : {&m.transmission, &m.diffuse_transmission, &m.clearcoat,
                       &m.clearcoat_roughness, &m.sheen_roughness, &m.iridescence})
    if (in.below(2)) *value = share(in);
  for (Vec3* value :
       {&m.specular_color, &m.attenuation_color, &m.diffuse_transmission_color, &m.sheen_color})
    if (in.below(2)) *value = color(in);
  for (trace::TextureUse* use :
       {&m.specular_texture, &m.specular_color_texture, &m.transmission_texture,
        &m.diffuse_transmission_texture, &m.clearcoat_texture, &m.clearcoat_normal_texture,
        &m.sheen_color_texture, &m.iridescence_texture, &m.iridescence_thickness_texture})
    if (in.below(4) == 0) *use = texture_use(in, shading);
}

trace::Material material(Input& in, const Shading& shading) {
  trace::Material m;
  m.base_color = color(in);
  m.alpha = share(in);
  m.metallic = share(in);
  m.roughness = share(in);
  m.specular = share(in);
  if (in.below(4) == 0) m.emission = color(in);
  m.alpha_mode = static_cast<trace::AlphaMode>(in.seldom(64) ? 3 : in.below(3));
  m.alpha_cutoff = share(in);
  m.normal_scale = in.number();
  for (trace::TextureUse* use : {&m.base_color_texture, &m.metallic_roughness_texture,
                                 &m.emission_texture, &m.normal_texture})
    *use = texture_use(in, shading);
  if (in.below(2)) add_layers(in, shading, m);
  return m;
}

Shading read_shading(Input& in, umbel::Mesh& mesh) {
  Shading shading;
  for (uint32_t i = in.below(3); i-- > 0;) {
    trace::TextureView t;
    t.width = in.seldom(32) ? in.bytes.integral<uint32_t>() : in.below(5);
    t.height = 1 + in.below(4);
    if (in.seldom(4) && t.width < 5) t.height = in.below(2);
    t.srgb = in.below(2) != 0;
    t.nearest = in.below(2) != 0;
    t.wrap_u = static_cast<trace::Wrap>(in.below(3));
    t.wrap_v = static_cast<trace::Wrap>(in.below(3));
    shading.texels.emplace_back(t.width < 5 ? 4 * size_t{t.width} * t.height : 4);
    for (uint8_t& texel : shading.texels.back()) texel = in.bytes.integral<uint8_t>();
    shading.textures.push_back(t);
  }
  for (size_t i = 0; i < shading.textures.size(); ++i)
    shading.textures[i].texels = shading.texels[i];
  for (uint32_t i = in.below(4); i-- > 0;) shading.materials.push_back(material(in, shading));
  const auto materials = static_cast<uint32_t>(shading.materials.size());
  if (materials > 0)
    for (size_t t = 0; t < mesh.triangles.size(); ++t)
      mesh.materials.push_back(in.below(materials + (in.seldom(255) ? 1 : 0)));
  if (in.likes(5)) {
    trace::Environment& e = shading.environment;
    if (in.below(2)) e.kind = trace::Environment::Kind::kConstant;
    e.color = color(in);
    e.up = point(in);
    e.sun_direction = point(in);
    e.turbidity = 1.5f + 9 * share(in);
    e.sun_radius = share(in);
    e.sun_strength = share(in);
    e.sky_strength = share(in);
    e.ground_albedo = color(in);
  }
  return shading;
}

/// The mesh as clusters, each where a transform puts it.
trace::ClusterScene clusters_of(Input& in, const umbel::Mesh& mesh) {
  trace::ClusterScene scene;
  for (uint32_t i = in.below(4); i-- > 0;) {
    trace::ClusterPart part;
    part.geometry.positions = mesh.positions;
    part.geometry.normals = mesh.normals;
    part.geometry.uvs = mesh.uvs;
    part.geometry.colors = mesh.colors;
    for (const umbel::Triangle& t : mesh.triangles)
      for (const uint32_t v : t) part.geometry.triangles.push_back(static_cast<uint8_t>(v));
    part.material = mesh.materials.empty() ? 0 : mesh.materials[0];
    scene.parts.push_back(std::move(part));
  }
  for (uint32_t i = in.below(4); i-- > 0;) {
    umbel::Transform transform;
    for (uint32_t k = in.below(5); k-- > 0;) transform.rows[in.below(12)] = in.number();
    scene.transforms.push_back(transform);
  }
  const auto parts = static_cast<uint32_t>(scene.parts.size() + in.below(2) * in.below(2));
  const auto transforms = static_cast<uint32_t>(scene.transforms.size());
  if (parts > 0 && transforms > 0)
    for (uint32_t i = in.below(6); i-- > 0;)
      scene.instances.push_back({in.below(parts), in.below(transforms), 1 + in.below(3)});
  if (in.likes(6)) scene.gap = in.number();
  return scene;
}

umbel::Camera camera_of(Input& in, const trace::Scene& scene) {
  if (in.below(2)) return trace::auto_camera(scene, 4, 4);
  umbel::Camera camera;
  camera.position = point(in);
  camera.target = point(in);
  camera.up = point(in);
  if (in.likes(7)) {
    camera.fov_y = in.number();
    camera.lens_radius = in.number();
    camera.focus_distance = in.number();
  }
  return camera;
}

trace::Settings settings_of(Input& in) {
  trace::Settings settings;
  settings.width = settings.height = 4;
  settings.samples = 1 + in.below(2);
  settings.seed = in.below(255);
  settings.max_bounces = in.below(6);
  settings.roulette_from = in.below(4);
  settings.shadow_samples = in.below(3);
  settings.clamp = in.seldom(8) ? in.number() : 0;
  if (in.seldom(32)) settings.width = in.below(2);
  return settings;
}

void render(Input& in, const trace::Scene& scene) {
  const umbel::Camera camera = camera_of(in, scene);
  const trace::Settings settings = settings_of(in);
  umbel::BuildOptions one, two;
  one.threads = 1;
  two.threads = 2;
  const trace::Picture a = trace::render(scene, camera, settings, one);
  const trace::Picture b = trace::render(scene, camera, settings, two);
  expect(a.image.pixels.size() == size_t{settings.width} * settings.height, "pixels are missing");
  expect(std::memcmp(a.image.pixels.data(), b.image.pixels.data(),
                     a.image.pixels.size() * sizeof(Vec3)) == 0,
         "threads change a picture");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Input in(data, size);
  umbel::Mesh mesh = read_mesh(in);
  const Shading shading = read_shading(in, mesh);
  umbel::BuildOptions options;
  options.threads = 1;
  try {
    if (in.below(3))
      render(in, trace::Scene::build(mesh.view(), shading.view(), umbel::BvhConfig{}, options));
    else
      render(in, trace::Scene::build(clusters_of(in, mesh), shading.view(), options));
  } catch (const umbel::Error& error) {
    const auto code = error.code();
    expect(code == umbel::ErrorCode::kInvalidArgument || code == umbel::ErrorCode::kInvalidMesh,
           "a failure that is not the input's fault");
  }
  return 0;
}
