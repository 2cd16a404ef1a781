// The path tracer: materials, scenes, cameras, and films to which samples are added.
#include "umbel/trace.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "bind.hpp"
#include "umbel/kdtree.hpp"
#include "umbel/stream.hpp"
#include "umbel/uniform.hpp"

namespace umbel::python {
namespace {

using Triple = std::array<float, 3>;
using Texels = nb::ndarray<const uint8_t, nb::shape<-1, -1, 4>, nb::c_contig, nb::device::cpu>;
/// Index, offset u v, scale u v, rotation, set of UVs; an index of -1 stands for no texture.
using Use = std::tuple<int64_t, float, float, float, float, float, uint32_t>;

Vec3 vec3(const Triple& t) { return {t[0], t[1], t[2]}; }
Triple triple(const Vec3& v) { return {v.x, v.y, v.z}; }

trace::TextureUse texture_use(const Use& use) {
  const auto [index, u, v, scale_u, scale_v, rotation, uv_set] = use;
  // A number that is too large for the tracer stays so, which refuses it.
  const auto texture = static_cast<uint32_t>(std::min<int64_t>(index, kNone - 1));
  return {index < 0 ? kNone : texture, {u, v}, {scale_u, scale_v}, rotation, uv_set};
}

/// A texture as Python gave it, kept alive.
struct TextureInput {
  Texels texels;
  trace::TextureView view;
};

/// Makes a struct's vector member a property that is a tuple in Python.
template <typename T, typename Class>
void triple_property(Class& binding, const char* name, Vec3 T::* member) {
  binding.def_prop_rw(
      name, [member](const T& self) { return triple(self.*member); },
      [member](T& self, const Triple& value) { self.*member = vec3(value); });
}

template <typename Class>
void use_property(Class& binding, const char* name, trace::TextureUse trace::Material::* member) {
  binding.def_prop_rw(
      name,
      [member](const trace::Material& self) {
        const trace::TextureUse& use = self.*member;
        const int64_t index = use.texture == kNone ? -1 : static_cast<int64_t>(use.texture);
        return Use{index,       use.offset.x, use.offset.y, use.scale.x,
                   use.scale.y, use.rotation, use.uv_set};
      },
      [member](trace::Material& self, const Use& use) { self.*member = texture_use(use); });
}

void bind_material(nb::module_& module) {
  using trace::Material;
  nb::class_<Material> material(module, "TraceMaterial");
  material.def(nb::init<>());
  const std::pair<const char*, float Material::*> numbers[] = {
      {"alpha", &Material::alpha},
      {"metallic", &Material::metallic},
      {"roughness", &Material::roughness},
      {"specular", &Material::specular},
      {"alpha_cutoff", &Material::alpha_cutoff},
      {"normal_scale", &Material::normal_scale},
      {"ior", &Material::ior},
      {"transmission", &Material::transmission},
      {"attenuation_distance", &Material::attenuation_distance},
      {"diffuse_transmission", &Material::diffuse_transmission},
      {"clearcoat", &Material::clearcoat},
      {"clearcoat_roughness", &Material::clearcoat_roughness},
      {"clearcoat_normal_scale", &Material::clearcoat_normal_scale},
      {"sheen_roughness", &Material::sheen_roughness},
      {"iridescence", &Material::iridescence},
      {"iridescence_ior", &Material::iridescence_ior},
      {"iridescence_thickness_min", &Material::iridescence_thickness_min},
      {"iridescence_thickness_max", &Material::iridescence_thickness_max},
  };
  for (const auto& [name, member] : numbers)
    material.def_prop_rw(
        name, [member](const Material& self) { return self.*member; },
        [member](Material& self, float value) { self.*member = value; });
  material.def_rw("alpha_mode", &Material::alpha_mode)
      .def_rw("unlit", &Material::unlit)
      .def_rw("body", &Material::body);
  triple_property(material, "base_color", &Material::base_color);
  triple_property(material, "emission", &Material::emission);
  triple_property(material, "specular_color", &Material::specular_color);
  triple_property(material, "attenuation_color", &Material::attenuation_color);
  triple_property(material, "diffuse_transmission_color", &Material::diffuse_transmission_color);
  triple_property(material, "sheen_color", &Material::sheen_color);
  use_property(material, "base_color_texture", &Material::base_color_texture);
  use_property(material, "metallic_roughness_texture", &Material::metallic_roughness_texture);
  use_property(material, "emission_texture", &Material::emission_texture);
  use_property(material, "normal_texture", &Material::normal_texture);
  use_property(material, "specular_texture", &Material::specular_texture);
  use_property(material, "specular_color_texture", &Material::specular_color_texture);
  use_property(material, "transmission_texture", &Material::transmission_texture);
  use_property(material, "diffuse_transmission_texture", &Material::diffuse_transmission_texture);
  use_property(material, "diffuse_transmission_color_texture",
               &Material::diffuse_transmission_color_texture);
  use_property(material, "clearcoat_texture", &Material::clearcoat_texture);
  use_property(material, "clearcoat_roughness_texture", &Material::clearcoat_roughness_texture);
  use_property(material, "clearcoat_normal_texture", &Material::clearcoat_normal_texture);
  use_property(material, "sheen_color_texture", &Material::sheen_color_texture);
  use_property(material, "sheen_roughness_texture", &Material::sheen_roughness_texture);
  use_property(material, "iridescence_texture", &Material::iridescence_texture);
  use_property(material, "iridescence_thickness_texture", &Material::iridescence_thickness_texture);
}

void bind_shading(nb::module_& module) {
  using trace::Environment;
  nb::enum_<trace::AlphaMode>(module, "TraceAlpha")
      .value("opaque", trace::AlphaMode::kOpaque)
      .value("mask", trace::AlphaMode::kMask)
      .value("blend", trace::AlphaMode::kBlend);
  nb::enum_<trace::Wrap>(module, "TraceWrap")
      .value("repeat", trace::Wrap::kRepeat)
      .value("clamp", trace::Wrap::kClamp)
      .value("mirror", trace::Wrap::kMirror);

  nb::class_<TextureInput>(module, "TraceTexture")
      .def(
          "__init__",
          [](TextureInput* self, Texels texels, bool srgb, bool nearest, trace::Wrap u,
             trace::Wrap v) {
            const auto height = static_cast<uint32_t>(texels.shape(0));
            const auto width = static_cast<uint32_t>(texels.shape(1));
            const std::span<const uint8_t> bytes(texels.data(), texels.size());
            new (self) TextureInput{std::move(texels), {bytes, width, height, srgb, nearest, u, v}};
          },
          "texels"_a, "srgb"_a, "nearest"_a, "wrap_u"_a, "wrap_v"_a);

  nb::class_<Environment> environment(module, "TraceEnvironment");
  environment.def(nb::init<>())
      .def_prop_rw(
          "constant",
          [](const Environment& self) { return self.kind == Environment::Kind::kConstant; },
          [](Environment& self, bool constant) {
            self.kind = constant ? Environment::Kind::kConstant : Environment::Kind::kSky;
          })
      .def_rw("turbidity", &Environment::turbidity)
      .def_rw("sun_radius", &Environment::sun_radius)
      .def_rw("sun_strength", &Environment::sun_strength)
      .def_rw("sky_strength", &Environment::sky_strength);
  triple_property(environment, "color", &Environment::color);
  triple_property(environment, "up", &Environment::up);
  triple_property(environment, "sun_direction", &Environment::sun_direction);
  triple_property(environment, "ground_albedo", &Environment::ground_albedo);
}

/// The structure that rays go through, by the name that the command line has for it.
std::unique_ptr<TriangleQueries> build_structure(const MeshView& mesh, const std::string& accel,
                                                 const std::string& preset,
                                                 std::span<const uint32_t> masks,
                                                 const BuildOptions& options) {
  if (accel == "kdtree")
    return std::make_unique<kdtree::KdTree>(kdtree::KdTree::build(mesh, {}, masks, options));
  if (accel == "grid")
    return std::make_unique<uniform::TwoLevelGrid>(
        uniform::TwoLevelGrid::build(mesh, {}, masks, options));
  if (accel == "octree")
    return std::make_unique<uniform::Octree>(uniform::Octree::build(mesh, {}, masks, options));
  if (accel == "bih")
    return std::make_unique<uniform::IntervalHierarchy>(
        uniform::IntervalHierarchy::build(mesh, {}, masks, options));
  if (accel != "bvh")
    throw Error(ErrorCode::kInvalidArgument,
                "accel must be bvh, kdtree, grid, octree or bih, not " + accel);
  BvhConfig config;
  config.tree = bvh::preset(preset);
  return std::make_unique<Bvh>(Bvh::build(mesh, config, masks, options));
}

trace::Scene build_scene(const MeshArrays& mesh, const std::vector<trace::Material>& materials,
                         const std::vector<const TextureInput*>& textures,
                         const trace::Environment& environment, const std::string& accel,
                         const std::string& preset, const nb::object& progress, uint32_t threads) {
  std::vector<trace::TextureView> views;
  for (const TextureInput* texture : textures) views.push_back(texture->view);
  const trace::Shading shading{materials, views, environment};
  return run(progress, threads, [&](const BuildOptions& options) {
    const MeshView view = mesh.view();
    validate(view, {.progress = {}, .threads = options.threads});
    auto structure =
        build_structure(view, accel, preset, trace::Scene::masks(view, materials), options);
    return trace::Scene::build(view, shading, std::move(structure),
                               {.progress = {}, .threads = options.threads});
  });
}

/// The clusters of a residency's cut, `table` of (view, page, group, cluster), each view by its
/// transform and for its kind of rays. Pages are read and decoded once each.
trace::ClusterScene read_clusters(const Asset& asset, std::span<const StreamCluster> table,
                                  std::span<const Transform> transforms,
                                  std::span<const uint32_t> rays) {
  trace::ClusterScene scene;
  scene.transforms.assign(transforms.begin(), transforms.end());
  std::vector<StreamCluster> order(table.begin(), table.end());
  const auto key = [](const StreamCluster& c) {
    return std::tuple(c.page, c.group, c.cluster, c.view);
  };
  std::sort(order.begin(), order.end(),
            [&](const StreamCluster& a, const StreamCluster& b) { return key(a) < key(b); });
  AssetPage page;
  std::vector<lod::ClusterGeometry> group;
  const StreamCluster* before = nullptr;
  for (const StreamCluster& c : order) {
    if (c.view >= transforms.size() || c.view >= rays.size())
      throw Error(ErrorCode::kInvalidArgument, "there is no transform for each view");
    if (!before || before->page != c.page) page = asset.read_page(c.page);
    if (!before || before->page != c.page || before->group != c.group)
      group = asset.decode(page, c.group);
    if (c.cluster >= group.size())
      throw Error(ErrorCode::kInvalidArgument, "the table does not fit the asset");
    if (!before || key(*before) != key(c)) {
      const bool is_new = !before || before->page != c.page || before->group != c.group ||
                          before->cluster != c.cluster;
      if (is_new)
        scene.parts.push_back(
            {std::move(group[c.cluster]), page.groups[c.group].clusters[c.cluster].material});
      scene.instances.push_back(
          {static_cast<uint32_t>(scene.parts.size() - 1), c.view, rays[c.view]});
    }
    before = &c;
  }
  return scene;
}

trace::Scene cluster_scene(const Asset& asset, const Rows<uint32_t, 4>& table,
                           const Rows<float, 12>& transforms, const Flat<uint32_t>& rays, float gap,
                           const std::vector<trace::Material>& materials,
                           const std::vector<const TextureInput*>& textures,
                           const trace::Environment& environment, const nb::object& progress,
                           uint32_t threads) {
  std::vector<trace::TextureView> views;
  for (const TextureInput* texture : textures) views.push_back(texture->view);
  const trace::Shading shading{materials, views, environment};
  return run(progress, threads, [&](const BuildOptions& options) {
    trace::ClusterScene clusters =
        read_clusters(asset, rows_of<StreamCluster>(table), rows_of<Transform>(transforms),
                      rows_of<uint32_t>(rays));
    clusters.gap = gap;
    return trace::Scene::build(clusters, shading, options);
  });
}

void bind_scene(nb::module_& module) {
  nb::class_<Camera> camera(module, "TraceCamera");
  camera.def(nb::init<>())
      .def_rw("fov_y", &Camera::fov_y)
      .def_rw("lens_radius", &Camera::lens_radius)
      .def_rw("focus_distance", &Camera::focus_distance);
  triple_property(camera, "position", &Camera::position);
  triple_property(camera, "target", &Camera::target);
  triple_property(camera, "up", &Camera::up);

  const auto viewpoint = [](float azimuth, float elevation, float fov_y, float margin) {
    return trace::Viewpoint{azimuth, elevation, fov_y, margin};
  };
  nb::class_<trace::Scene>(module, "TraceScene")
      .def_prop_ro("triangle_count", &trace::Scene::triangle_count)
      .def_prop_ro("light_count", &trace::Scene::light_count)
      .def_prop_ro("instanced_triangles", &trace::Scene::instanced_triangles)
      .def_prop_ro("bytes", &trace::Scene::bytes)
      .def(
          "auto_camera",
          [=](const trace::Scene& scene, uint32_t width, uint32_t height, float azimuth,
              float elevation, float fov_y, float margin) {
            const nb::gil_scoped_release release;
            return trace::auto_camera(scene, width, height,
                                      viewpoint(azimuth, elevation, fov_y, margin));
          },
          "width"_a, "height"_a, "azimuth"_a, "elevation"_a, "fov_y"_a, "margin"_a);
  module.def("cluster_scene", &cluster_scene, "asset"_a, "table"_a, "transforms"_a, "rays"_a,
             "gap"_a, "materials"_a, "textures"_a, "environment"_a, "progress"_a = nb::none(),
             "threads"_a = 0);
  module.def("trace_scene", &build_scene, "mesh"_a, "materials"_a, "textures"_a, "environment"_a,
             "accel"_a, "preset"_a, "progress"_a = nb::none(), "threads"_a = 0);
  module.def(
      "trace_frame",
      [=](const MeshArrays& mesh, const Triple& up, uint32_t width, uint32_t height, float azimuth,
          float elevation, float fov_y, float margin) {
        const nb::gil_scoped_release release;
        return trace::fit_camera(mesh.view(), vec3(up), width, height,
                                 viewpoint(azimuth, elevation, fov_y, margin));
      },
      "mesh"_a, "up"_a, "width"_a, "height"_a, "azimuth"_a, "elevation"_a, "fov_y"_a, "margin"_a);
}

void bind_boxes(nb::module_& module) {
  module.def(
      "boxes_per_pixel",
      [](const Rows<float, 6>& boxes, const Camera& camera, uint32_t width, uint32_t height,
         uint32_t threads) {
        return take<uint32_t>(run(nb::none(), threads, [&](const BuildOptions& options) {
          return trace::boxes_per_pixel(rows_of<Aabb>(boxes), camera, width, height, options);
        }));
      },
      "boxes"_a, "camera"_a, "width"_a, "height"_a, "threads"_a = 0);
}

Dict statistics_of(const trace::Film& film) {
  const trace::Statistics& s = film.statistics;
  Dict result;
  result["primary_rays"] = s.primary;
  result["bounce_rays"] = s.bounce;
  result["shadow_rays"] = s.shadow;
  result["continued_rays"] = s.continued;
  result["rays"] = s.rays();
  result["seconds"] = s.seconds;
  return result;
}

/// (height, width, 3) float32
Array<float> pixels_of(trace::Image image) {
  auto owner = std::make_unique<std::vector<Vec3>>(std::move(image.pixels));
  static float nothing = 0.0f;
  float* data = owner->empty() ? &nothing : &owner->front().x;
  const size_t shape[3] = {image.height, image.width, 3};
  nb::capsule capsule(owner.release(),
                      [](void* p) noexcept { delete static_cast<std::vector<Vec3>*>(p); });
  return Array<float>(data, 3, shape, capsule);
}

void bind_film(nb::module_& module) {
  using trace::Settings;
  nb::class_<Settings>(module, "TraceSettings")
      .def(nb::init<>())
      .def_rw("width", &Settings::width)
      .def_rw("height", &Settings::height)
      .def_rw("samples", &Settings::samples)
      .def_rw("seed", &Settings::seed)
      .def_rw("max_bounces", &Settings::max_bounces)
      .def_rw("roulette_from", &Settings::roulette_from)
      .def_rw("shadow_samples", &Settings::shadow_samples)
      .def_rw("clamp", &Settings::clamp);
  nb::class_<trace::Film>(module, "TraceFilm", "A picture that grows: sums of samples.")
      .def(nb::init<>())
      .def_ro("samples", &trace::Film::samples)
      .def_prop_ro("statistics", &statistics_of)
      .def(
          "pixels", [](const trace::Film& film) { return pixels_of(film.image()); },
          "(height, width, 3) float32: the means so far")
      .def(
          "add",
          [](trace::Film& film, const trace::Scene& scene, const Camera& camera,
             const Settings& settings, const nb::object& progress, uint32_t threads) {
            run(progress, threads, [&](const BuildOptions& options) {
              trace::accumulate(scene, camera, settings, film, options);
            });
          },
          "scene"_a, "camera"_a, "settings"_a, "progress"_a = nb::none(), "threads"_a = 0);
  module.def(
      "trace_features",
      [](const trace::Scene& scene, const Camera& camera, const Settings& settings,
         const nb::object& progress, uint32_t threads) {
        trace::Features made;
        run(progress, threads, [&](const BuildOptions& options) {
          made = trace::features(scene, camera, settings, options);
        });
        return std::pair(pixels_of(std::move(made.albedo)), pixels_of(std::move(made.normal)));
      },
      "scene"_a, "camera"_a, "settings"_a, "progress"_a = nb::none(), "threads"_a = 0,
      "Albedo and normal of what is seen: two (height, width, 3) float32");
}

}  // namespace

void bind_trace(nb::module_& module) {
  bind_shading(module);
  bind_material(module);
  bind_scene(module);
  bind_boxes(module);
  bind_film(module);
}

}  // namespace umbel::python
