// A path tracer over triangle_queries.hpp: pictures of meshes, and the rays that compare
// structures.
//
//   const trace::Scene scene = trace::Scene::build(mesh.view(), look);
//   const trace::Camera camera = trace::auto_camera(scene, 1024, 768);
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

#include "umbel/lod.hpp"
#include "umbel/mesh.hpp"
#include "umbel/trace_material.hpp"
#include "umbel/triangle_bvh.hpp"
#include "umbel/types.hpp"

namespace umbel::trace {

/// Where a picture is taken from. Rays go through the pixels of a plane perpendicular to
/// target - position; `up` points to the picture's top.
struct Camera {
  Vec3 position{0, 0, 1};
  Vec3 target{0, 0, 0};
  Vec3 up{0, 1, 0};
  float fov_y = 0.6981317f;     ///< vertical field of view in radians, in (0, pi)
  float lens_radius = 0.0f;     ///< of a thin lens, in the mesh's unit; 0: a pinhole, all sharp
  float focus_distance = 0.0f;  ///< where the lens is sharp; 0: at the target
};

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

/// How a mesh looks: what its material indices mean, and the light on it.
struct Look {
  std::span<const Material> materials;  ///< empty: one Lambert material of albedo 0.75
  std::span<const TextureView> textures;
  Environment environment;
};

/// Clusters of cuts and where they stand, in any number of places.
struct ClusterPart {
  lod::ClusterGeometry geometry;
  uint32_t material = 0;
};
/// Which rays meet a cluster: those from the camera, or those that bounce and look for light.
enum RayKinds : uint32_t { kCameraRays = 1, kOtherRays = 2, kAllRays = 3 };
struct PlacedCluster {
  uint32_t part, transform;
  uint32_t rays = kAllRays;
};
struct ClusterScene {
  std::vector<ClusterPart> parts;
  std::vector<PlacedCluster> placed;
  /// Three rows of four, from the part's space to the world; invertible.
  std::vector<std::array<float, 12>> transforms;
  /// Where other rays meet a coarser cut than the camera's: how far the two are apart at most, over
  /// the distance to the camera. Other rays begin so far from where they come from.
  float gap = 0;
};

/// A mesh ready to be rendered. It keeps copies of all that it needs.
class UMBEL_API Scene {
 public:
  Scene();  ///< no triangles: pictures show the sky
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  /// Throws kInvalidMesh for an invalid mesh and kInvalidArgument for a look that does not fit it
  /// or is out of range.
  static Scene build(const MeshView& mesh, const Look& look = {}, const BvhConfig& config = {},
                     const BuildOptions& options = {});
  /// The same over any structure of the same triangles, built with `masks` of the same look.
  static Scene build(const MeshView& mesh, const Look& look,
                     std::unique_ptr<TriangleQueries> structure, const BuildOptions& options = {});

  /// Clusters through two levels of trees. Emission is found by bounces alone. Attributes that only
  /// some parts have are left out.
  static Scene build(const ClusterScene& clusters, const Look& look,
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
  /// Triangles as placed, and bytes of what rays touch (of structures only hierarchies are
  /// counted).
  uint64_t placed_triangles() const;
  uint64_t bytes() const;

  struct Data;
  const Data& data() const { return *data_; }

 private:
  std::unique_ptr<Data> data_;
};

/// A direction to look from for auto_camera, in degrees about Environment::up.
struct Viewpoint {
  float azimuth = 35.0f;    ///< from the +Z axis towards +X (where up is +Y)
  float elevation = 15.0f;  ///< above the horizon, -89..89
  float fov_y = 0.6108652f;
  float margin = 0.06f;  ///< of the picture left free at the tightest side, 0..0.9
};

/// The camera from which the mesh just fills the picture.
UMBEL_API Camera frame(const MeshView& mesh, const Vec3& up, uint32_t width, uint32_t height,
                       const Viewpoint& viewpoint = {});

/// `frame`, or where the middle of the scene is a room, a place inside with a long view.
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
  uint32_t samples = 0;    ///< in every pixel's sum
  std::vector<Vec3> sums;  ///< width * height
  Statistics statistics;
  Image image() const;  ///< the means
};

/// Adds settings.samples to every pixel of a film, which is empty or has the settings' size. Adding
/// 4 and 12 samples gives the same bytes as adding 16, for any number of threads. When it throws
/// (kCancelled, or kInvalidArgument for settings or a camera out of range) the film is as before.
UMBEL_API void accumulate(const Scene& scene, const Camera& camera, const Settings& settings,
                          Film& film, const BuildOptions& options = {});

struct Picture {
  Image image;
  Statistics statistics;
};

/// The whole picture at once.
UMBEL_API Picture render(const Scene& scene, const Camera& camera, const Settings& settings = {},
                         const BuildOptions& options = {});

}  // namespace umbel::trace
