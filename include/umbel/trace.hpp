// A path tracer over triangle_queries.hpp: pictures of meshes, and the rays that compare
// structures.
//
//   const trace::Scene scene = trace::Scene::build(mesh.view(), shading);
//   const Camera camera = trace::auto_camera(scene, 1024, 768);
//   const trace::Picture picture = trace::render(scene, camera, settings);
//
// Light is computed forward from the camera: at every hit two shadow rays go to the lights (sun,
// sky, emissive triangles) and one ray goes on, until Russian roulette ends the path. What the
// shadow rays and the bounces both find is weighted by multiple importance sampling (Veach 1997).
// Radiance is linear RGB with sRGB's primaries. All surfaces have two sides; where a material is
// the surface of a body, triangles run counter-clockwise seen from outside.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "umbel/camera.hpp"
#include "umbel/lod/types.hpp"
#include "umbel/mesh.hpp"
#include "umbel/trace_material.hpp"
#include "umbel/triangle_bvh.hpp"
#include "umbel/types.hpp"

namespace umbel::trace {

/// The light from outside. Preetham, Shirley & Smits 1999 for a clear sky, in units in which a
/// white horizontal surface under a high sun has radiance of about 1.
struct Environment {
  enum class Kind : uint32_t {
    kSky,       ///< sun and sky above, light reflected by the ground below the horizon
    kConstant,  ///< `color` everywhere, no sun
  };
  Kind kind = Kind::kSky;
  Vec3 color{1, 1, 1};                     ///< radiance of kConstant
  Vec3 up{0, 1, 0};                        ///< to the zenith
  Vec3 sun_direction{0.5f, 0.75f, 0.43f};  ///< to the sun; lifted to 3 degrees where lower
  float turbidity = 2.0f;                  ///< haze, 1.7 (clear) .. 10 (thick)
  float sun_radius = 0.0093f;              ///< angle in radians, 0.001..0.5: softness of shadows
                                           ///< (the real one: 0.0047)
  float sun_strength = 1.0f;               ///< times the model's, >= 0
  float sky_strength = 1.0f;               ///< times the model's, >= 0
  Vec3 ground_albedo{0.3f, 0.29f, 0.27f};  ///< of what lies below the horizon, each in [0, 1]
};

/// What a mesh's material indices mean, and the light on it.
struct Shading {
  std::span<const Material> materials;  ///< empty: one Lambert material of albedo 0.75
  std::span<const TextureView> textures;
  Environment environment;
};

/// A cluster of a cut, in its own space.
struct ClusterPart {
  lod::ClusterGeometry geometry;
  uint32_t material = 0;
};
/// Which rays meet a cluster: those from the camera, or bounce and shadow rays.
enum RayKinds : uint32_t { kCameraRays = 1, kOtherRays = 2, kAllRays = 3 };
struct ClusterInstance {
  uint32_t part, transform;
  uint32_t rays = kAllRays;
};
/// Instances of clusters.
struct ClusterScene {
  std::vector<ClusterPart> parts;
  std::vector<ClusterInstance> instances;
  std::vector<Transform> transforms;  ///< from a part's space to the world; invertible
  /// If other rays meet a coarser cut than the camera's: the largest distance between the two cuts,
  /// relative to the distance from the camera. Other rays start that far from their surface.
  float gap = 0;
};

/// A mesh ready to be rendered. It keeps copies of all that it needs.
class UMBEL_API Scene {
 public:
  Scene();  ///< no triangles: pictures show the sky
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  /// Throws kInvalidMesh for an invalid mesh and kInvalidArgument for a shading that does not fit
  /// it or is out of range.
  static Scene build(const MeshView& mesh, const Shading& shading = {},
                     const BvhConfig& config = {}, const BuildOptions& options = {});
  /// The same over any structure of the same triangles, built with `masks` of the same shading.
  static Scene build(const MeshView& mesh, const Shading& shading,
                     std::unique_ptr<TriangleQueries> structure, const BuildOptions& options = {});

  /// Clusters through two levels of trees. Emission is found by bounces alone. Parts without an
  /// attribute that others have are as without it.
  static Scene build(const ClusterScene& clusters, const Shading& shading,
                     const BuildOptions& options = {});

  /// The masks that a structure must be built with for rays to see through what is not opaque: bit
  /// 0 for opaque triangles, bit 1 for the others. Empty where all are opaque.
  static std::vector<uint32_t> masks(const MeshView& mesh, std::span<const Material> materials);

  /// Other structures over the same triangles give the same picture in another time.
  void replace_structure(std::unique_ptr<TriangleQueries> structure);
  const TriangleQueries& structure() const;
  Aabb bounds() const;
  uint32_t triangle_count() const;
  uint32_t light_count() const;  ///< emissive triangles
  /// Triangles of all instances, and bytes that rays touch (of structures only BVHs are counted).
  uint64_t instanced_triangles() const;
  uint64_t bytes() const;

  struct Data;
  const Data& data() const { return *data_; }

 private:
  std::unique_ptr<Data> data_;
};

/// The direction from which a camera looks at a mesh, in degrees about its up direction.
struct Viewpoint {
  float azimuth = 35.0f;    ///< from the +Z axis towards +X (where up is +Y)
  float elevation = 15.0f;  ///< above the horizon, -89..89
  float fov_y = 0.6108652f;
  float margin = 0.06f;  ///< of the picture left free at the tightest side, 0..0.9
};

/// The camera from which the mesh just fills the picture. `up` is the scene's.
UMBEL_API Camera fit_camera(const MeshView& mesh, const Vec3& up, uint32_t width, uint32_t height,
                            const Viewpoint& viewpoint = {});

/// fit_camera, or, if the middle of the scene is a room, a camera inside with a long view.
UMBEL_API Camera auto_camera(const Scene& scene, uint32_t width, uint32_t height,
                             const Viewpoint& viewpoint = {});

struct Settings {
  uint32_t width = 1024, height = 768;  ///< 1..32768 each, 2^28 pixels in all
  uint32_t samples = 64;                ///< paths a pixel, 1..2^24
  uint32_t seed = 1;
  uint32_t max_bounces = 32;    ///< 0: what the camera sees, lit directly; ..1024
  uint32_t roulette_from = 2;   ///< bounces before Russian roulette begins
  uint32_t shadow_samples = 2;  ///< 0 (light is found by bounces alone), 1 or 2 a hit
  float clamp = 0.0f;  ///< most radiance that one indirect sample adds (less noise, but darker
                       ///< highlights); 0: no limit, and the mean is exact
};

/// What was traced.
struct Statistics {
  uint64_t primary = 0;    ///< rays from the camera
  uint64_t bounce = 0;     ///< rays from surfaces that go on
  uint64_t shadow = 0;     ///< rays to lights
  uint64_t continued = 0;  ///< rays started again behind what is not opaque
  double seconds = 0.0;    ///< of tracing, without building
  uint64_t rays() const { return primary + bounce + shadow + continued; }
};

/// Linear RGB, row by row from the top.
struct Image {
  uint32_t width = 0, height = 0;
  std::vector<Vec3> pixels;
};

/// A picture that grows: the sums of the samples so far.
struct Film {
  uint32_t width = 0, height = 0;
  uint32_t samples = 0;     ///< in every pixel's sum
  std::vector<Vec3d> sums;  ///< width * height; a sum of floats would lose light
  Statistics statistics;
  Image image() const;  ///< the means
};

/// Adds settings.samples to every pixel of a film, which is empty or has the settings' size. Adding
/// 4 and 12 samples gives the same bytes as adding 16, for any number of threads. When it throws
/// (kCancelled, or kInvalidArgument for settings or a camera out of range) the film is as before.
UMBEL_API void accumulate(const Scene& scene, const Camera& camera, const Settings& settings,
                          Film& film, const BuildOptions& options = {});

/// What a denoiser wants to know beside a picture, of the same size.
struct Features {
  Image
      albedo;  ///< colours of the surfaces seen, each in [0, 1]; of the sky its radiance, at most 1
  Image normal;  ///< their shading normals in the world; zero for the sky
};

/// Means over settings.samples of the paths that accumulate traces first: of their first surfaces.
/// Same bytes for any number of threads. Throws as accumulate does.
UMBEL_API Features features(const Scene& scene, const Camera& camera, const Settings& settings,
                            const BuildOptions& options = {});

struct Picture {
  Image image;
  Statistics statistics;
};

/// The whole picture at once.
UMBEL_API Picture render(const Scene& scene, const Camera& camera, const Settings& settings = {},
                         const BuildOptions& options = {});

/// How many boxes the ray through the middle of each pixel pierces, row by row from the top: what a
/// heatmap of overlapping clusters shows. The camera's lens does not count. A box that is empty
/// (its least corner above its greatest) or NaN is pierced by none. Throws as accumulate does for
/// the camera and the size.
UMBEL_API std::vector<uint32_t> boxes_per_pixel(std::span<const Aabb> boxes, const Camera& camera,
                                                uint32_t width, uint32_t height,
                                                const BuildOptions& options = {});

}  // namespace umbel::trace
