// Path tracing (Kajiya 1986) with next-event estimation and Russian roulette (Arvo & Kirk 1990).
// Light that shadow rays and bounces both find is weighted by the power heuristic (Veach 1997).
#include "trace/path.hpp"

#include <limits>
#include <numbers>
#include <vector>

#include "bvh/tree/node_area.hpp"
#include "trace/layers.hpp"
#include "trace/surface.hpp"

namespace umbel::trace {
namespace {

constexpr uint32_t kMostLayers = 1u << 16;  // of what is not opaque, before a ray is stopped

/// The dimensions of one bounce.
enum Dimension : uint32_t {
  kScatter,
  kLobe,
  kShadow,
  kLight = kShadow + 2,
  kThrough = kLight + 2,
  kDimensions
};

float power_weight(float own, float other) {
  if (!(other > 0.0f)) return 1.0f;
  if (!(own > 0.0f)) return 0.0f;
  const float ratio = other / own;
  return 1.0f / (1.0f + ratio * ratio);
}

class Path {
 public:
  Path(const PathContext& context, const Sampler& sampler, Statistics& counts)
      : context_(context), scene_(context.scene), sampler_(sampler), counts_(counts) {}

  Vec3 follow(Ray ray) {
    eye_ = ray.origin;
    for (uint32_t bounce = 0;; ++bounce) {
      dimension_ = kFirstBounceDimension + bounce * kDimensions;
      const SceneHit hit = bounce == 0 ? first_hit(ray, kCameraRays, counts_.primary)
                                       : first_hit(ray, kOtherRays, counts_.bounce);
      if (!hit.hit()) {
        add_background(ray.direction, bounce);
        return light_;
      }
      const Surface surface = surface_at(scene_, hit, ray.direction);
      if (scene_.absorbs) absorb(surface.material, surface.behind, hit.t);
      add_emission(surface, ray.direction, hit.t, bounce);
      // The ray after the last bounce brings what the bounce was weighted for, and no more.
      const MaterialKind& kind = scene_.kinds[surface.material];
      if (bounce > context_.settings.max_bounces || kind.unlit) return light_;
      const Basis basis = basis_around(surface.shading);
      const bool goes_on =
          kind.layered ? layered_step(surface, basis, hit, bounce, ray)
                       : step(surface, basis, Bsdf(surface.color, basis.to_local(-ray.direction)),
                              bounce, ray);
      if (!goes_on) return light_;
    }
  }

  FirstHit first(Ray ray) {
    dimension_ = kFirstBounceDimension;
    const SceneHit hit = first_hit(ray, kCameraRays, counts_.primary);
    if (!hit.hit()) return {min(scene_.sky.radiance(ray.direction), {1, 1, 1}), {0, 0, 0}};
    const Surface surface = surface_at(scene_, hit, ray.direction);
    // Light that goes on through a body or off a lamp is not coloured by its surface.
    const Material& material = scene_.materials[surface.material];
    const bool is_clear = material.transmission >= 0.5f || scene_.kinds[surface.material].unlit;
    const Vec3 albedo = is_clear ? Vec3{1, 1, 1} : surface.color.base + surface.emission;
    return {min(albedo, {1, 1, 1}), surface.shading};
  }

 private:
  template <typename B>
  bool step(const Surface& surface, const Basis& basis, const B& bsdf, uint32_t bounce, Ray& ray) {
    add_direct(surface, basis, bsdf, bounce);
    return scatter(surface, basis, bsdf, bounce, ray);
  }

  /// Not inlined, so that it takes no registers from paths without layers.
  [[gnu::noinline]] bool layered_step(const Surface& surface, const Basis& basis,
                                      const SceneHit& hit, uint32_t bounce, Ray& ray) {
    const SurfaceLayers layers = layers_at(scene_, hit, surface, basis, ray.direction);
    const LayeredBsdf bsdf(surface.color, layers, basis.to_local(-ray.direction));
    return step(surface, basis, bsdf, bounce, ray);
  }

  /// Takes what the body that a ray has come through up to `t` keeps: the one of the surface that
  /// it meets from inside, or the one that it entered.
  void absorb(uint32_t material, bool behind, float t) {
    const bool inside = behind && scene_.materials[material].body;
    const uint32_t body = inside ? material : body_;
    if (body != kNone) throughput_ = throughput_ * absorbed(body, t - crossed_);
    crossed_ = 0.0f;
  }

  Vec3 absorbed(uint32_t body, float distance) const {
    const Vec3 depth = scene_.kinds[body].absorption * distance;
    return {std::exp(-depth.x), std::exp(-depth.y), std::exp(-depth.z)};
  }

  /// Goes into a body or out of it at t, without being bent.
  void change_body(const Passage& passage, const SceneHit& hit) {
    const uint32_t material = scene_.triangles[hit.primitive].material;
    if (scene_.absorbs) absorb(material, passage.leaves_body, hit.t);
    crossed_ = hit.t;
    body_ = passage.enters_body ? material : kNone;
  }

  /// The nearest hit at which light does not pass straight through.
  SceneHit first_hit(const Ray& ray, RayKinds kind, uint64_t& counter) {
    ++counter;
    const SceneHit hit = scene_.intersect(ray, {}, kind);
    return scene_.see_through ? look_through(ray, hit, kind) : hit;
  }

  /// The nearest opaque hit, at which the search ends, is found separately.
  [[gnu::noinline]] SceneHit look_through(Ray ray, SceneHit hit, RayKinds kind) {
    SceneHit opaque;
    ahead_.clear();
    for (uint32_t layer = 0; hit.hit(); ++layer) {
      const Passage passage = passage_at(scene_, hit, ray.direction);
      if (passage.stop >= 1.0f || layer == kMostLayers) return hit;
      const uint32_t seed = combine(dimension_ + kThrough, layer);
      if (passage.stop > 0.0f && sampler_.point(seed).x < passage.stop) {
        throughput_ = throughput_ * passage.weight;
        return hit;
      }
      const float on = 1.0f - passage.stop;
      const Vec3& through = passage.through;
      throughput_ = throughput_ * Vec3{through.x / on, through.y / on, through.z / on};
      if (passage.enters_body || passage.leaves_body) change_body(passage, hit);
      if (layer == 0) {
        ++counts_.continued;
        opaque = scene_.intersect(ray, {.mask = kOpaqueBit}, kind);
        ray.t_max = opaque.t;
      }
      hit = next_layer(ray, hit, kind);
      if (opaque.precedes(hit)) hit = opaque;
    }
    return hit;
  }

  /// What is not opaque behind a hit or in its plane.
  SceneHit next_layer(const Ray& ray, const SceneHit& hit, RayKinds kind) {
    ++counts_.continued;
    return scene_.next(ray, hit, {.mask = kSeeThroughBit}, kind, ahead_);
  }

  /// The transmittance along a ray that starts in a body, or in none.
  Vec3 visibility(const Ray& ray, uint32_t body) {
    ++counts_.shadow;
    if (scene_.see_through) return visibility_through(ray, body);
    return scene_.occluded(ray) ? Vec3{0, 0, 0} : absorbed_to_end(ray, body, 0.0f);
  }

  /// The transmittance of the rest of a ray that meets nothing more: its light may be in the body.
  Vec3 absorbed_to_end(const Ray& ray, uint32_t body, float crossed) const {
    if (!scene_.absorbs || body == kNone || !std::isfinite(ray.t_max)) return {1, 1, 1};
    return absorbed(body, ray.t_max - crossed);
  }

  [[gnu::noinline]] Vec3 visibility_through(const Ray& ray, uint32_t body) {
    const Vec3 none{0, 0, 0};
    if (scene_.occluded(ray, {.mask = kOpaqueBit})) return none;
    Vec3 through{1, 1, 1};
    float crossed = 0.0f;
    ++counts_.continued;
    ahead_.clear();
    SceneHit hit = scene_.intersect(ray, {.mask = kSeeThroughBit}, kOtherRays);
    for (uint32_t layer = 0; layer < kMostLayers; ++layer) {
      if (!hit.hit()) return through * absorbed_to_end(ray, body, crossed);
      const Passage passage = passage_at(scene_, hit, ray.direction);
      through = through * passage.through;
      if (is_black(through)) return none;
      if (passage.leaves_body || passage.enters_body) {
        const uint32_t material = scene_.triangles[hit.primitive].material;
        // Where bodies touch, the next may be entered before the last is left.
        if (passage.leaves_body) body = material;
        if (body != kNone) through = through * absorbed(body, hit.t - crossed);
        body = passage.enters_body ? material : kNone;
        crossed = hit.t;
      }
      hit = next_layer(ray, hit, kOtherRays);
    }
    return none;
  }

  void add(Vec3 radiance, bool indirect) {
    const float limit = context_.settings.clamp;
    if (indirect && limit > 0.0f) {
      const float brightness = max_component(radiance);
      if (brightness > limit) radiance = radiance * (limit / brightness);
    }
    // Overflow in one sample must not spoil the pixel's sum.
    if (is_finite(radiance)) light_ += radiance;
  }

  void add_background(const Vec3& direction, uint32_t bounce) {
    Vec3 sky = scene_.sky.radiance(direction), sun = scene_.sun.radiance(direction);
    if (bounce > 0) {
      sky = sky *
            power_weight(density_, context_.plan.expected[kSky] * scene_.sky.density(direction));
      sun = sun * power_weight(density_, context_.plan.expected[kSun] * scene_.sun.density());
    }
    add(throughput_ * (sky + sun), bounce > 1);
  }

  void add_emission(const Surface& surface, const Vec3& direction, float distance,
                    uint32_t bounce) {
    if (is_black(surface.emission)) return;
    float weight = 1.0f;
    if (bounce > 0) {
      const float cosine = std::abs(dot(surface.face, direction));
      const float by_area = scene_.light_density[surface.material];
      const float far = distance * scene_.light_scale;
      const float by_angle = by_area * far * far / std::max(cosine, 1e-6f);
      weight = power_weight(density_, context_.plan.expected[kTriangles] * by_angle);
    }
    add(throughput_ * surface.emission * weight, bounce > 1);
  }

  /// Direct light from sun, sky and triangles, by shadow rays.
  template <typename B>
  void add_direct(const Surface& surface, const Basis& basis, const B& bsdf, uint32_t bounce) {
    const ShadowPlan& plan = context_.plan;
    for (uint32_t i = 0; i < plan.rays; ++i) {
      Vec2 u = sampler_.point(dimension_ + kShadow + i);
      const LightKind kind = choose_kind(plan.chances[i], u.x);
      float distance = std::numeric_limits<float>::infinity();
      LightSample sample;
      if (kind == kSun) {
        sample = scene_.sun.sample(u);
      } else if (kind == kSky) {
        sample = scene_.sky.sample(u);
      } else {
        const float choice = sampler_.point(dimension_ + kLight + i).x;
        sample = sample_triangle(surface.point, choice, u, distance);
      }
      sample.density *= plan.expected[kind];
      add_shadowed(surface, basis, bsdf, sample, distance, bounce);
    }
  }

  /// Chooses a kind by its probability; rescales the random number to be used again.
  static LightKind choose_kind(const std::array<float, kLightKinds>& chances, float& u) {
    uint32_t kind = 0;
    float low = 0.0f, high = 0.0f;
    for (uint32_t k = 0; k < kLightKinds && u >= high; ++k) {
      if (!(chances[k] > 0.0f)) continue;
      kind = k;
      low = high;
      high += chances[k];
    }
    u = std::clamp((u - low) / chances[kind], 0.0f, 0x1.fffffep-1f);
    return static_cast<LightKind>(kind);
  }

  LightSample sample_triangle(const Vec3& from, float choice, const Vec2& p, float& distance) {
    const uint32_t triangle = scene_.lights[scene_.light_choices.choose(choice).index];
    const TriangleRecord& record = scene_.triangles[triangle];
    // A uniform point (Turk 1990).
    const float root = std::sqrt(p.x);
    const float u = root * (1.0f - p.y), v = root * p.y;
    const Vec3 &a = scene_.positions[record.corners[0]], &b = scene_.positions[record.corners[1]],
               &c = scene_.positions[record.corners[2]];
    const Vec3 point = a * (1.0f - u - v) + b * u + c * v;
    const Vec3 way = (point - from) * scene_.light_scale;
    const float far = length(way);
    const Vec3 direction = normalized(way, {0, 0, 0});
    const Vec3 face =
        normalized(cross(normalized(b - a, {0, 0, 0}), normalized(c - a, {0, 0, 0})), {0, 0, 0});
    const float cosine = std::abs(dot(face, direction));
    if (!(far > 0.0f) || !(cosine > 0.0f)) return {direction, {0, 0, 0}, 0.0f};
    // Stops short of the light, so that it does not shadow itself.
    distance = far * (1.0f - 1e-4f) / scene_.light_scale;
    return {direction, emission_at(scene_, triangle, u, v),
            scene_.light_density[record.material] * far * far / cosine};
  }

  /// The body that a ray from a surface is in.
  template <typename B>
  uint32_t body_beyond(const Surface& surface, const Vec3& local) const {
    if (!B::kTransmits || local.z >= 0.0f || !scene_.materials[surface.material].body) return body_;
    return surface.behind ? kNone : surface.material;
  }

  /// A shading normal may ask for light that is on the other side of the triangle.
  template <typename B>
  static bool on_same_side(const Surface& surface, const Vec3& direction, const Vec3& local) {
    const float side = dot(direction, surface.face);
    return B::kTransmits ? side * local.z > 0.0f : side > 0.0f;
  }

  template <typename B>
  void add_shadowed(const Surface& surface, const Basis& basis, const B& bsdf,
                    const LightSample& sample, float distance, uint32_t bounce) {
    if (!(sample.density > 0.0f) || is_black(sample.radiance)) return;
    const Vec3 local = basis.to_local(sample.direction);
    if (!on_same_side<B>(surface, sample.direction, local)) return;
    const BsdfValue value = bsdf.evaluate(local);
    if (is_black(value.value)) return;
    const float weight = power_weight(sample.density, value.density) / sample.density;
    const Vec3 light = throughput_ * value.value * sample.radiance * weight;
    Ray ray = ray_from(surface, sample.direction);
    ray.t_max = distance;
    const Vec3 through = visibility(ray, body_beyond<B>(surface, local));
    if (!is_black(through)) add(light * through, bounce > 0);
  }

  /// Samples the next direction of the path; false if it ends.
  template <typename B>
  bool scatter(const Surface& surface, const Basis& basis, const B& bsdf, uint32_t bounce,
               Ray& ray) {
    const Vec2 lobe = sampler_.point(dimension_ + kLobe);
    const BsdfSample sample = bsdf.sample(sampler_.point(dimension_ + kScatter), lobe.x);
    if (!(sample.density > 0.0f)) return false;
    const Vec3 direction = basis.to_world(sample.direction);
    if (!on_same_side<B>(surface, direction, sample.direction)) return false;
    body_ = body_beyond<B>(surface, sample.direction);
    throughput_ = throughput_ * sample.weight;
    if (bounce + 1 >= context_.settings.roulette_from) {
      const float survival = std::min(max_component(throughput_), 0.95f);
      if (!(lobe.y < survival)) return false;
      throughput_ = throughput_ * (1.0f / survival);
    }
    density_ = sample.density;
    ray = ray_from(surface, direction);
    return true;
  }

  /// It begins beyond what a coarser form of the surface, which it may meet, is away from this one.
  Ray ray_from(const Surface& surface, const Vec3& direction) const {
    Ray ray;
    ray.origin = surface.origin(direction);
    ray.direction = direction;
    if (scene_.gap > 0.0f) ray.t_min = scene_.gap * length(surface.point - eye_);
    return ray;
  }

  const PathContext& context_;
  const Scene::Data& scene_;
  const Sampler& sampler_;
  Statistics& counts_;
  Vec3 eye_{0, 0, 0};
  uint32_t dimension_ = 0;
  uint32_t body_ = kNone;        ///< the material of the body that the path is in
  std::vector<SceneHit> ahead_;  ///< see Scene::Data::next
  float crossed_ = 0.0f;         ///< where along the ray it last went into a body or out of one
  float density_ = 0.0f;         ///< of the last scattering
  Vec3 throughput_{1, 1, 1};
  Vec3 light_{0, 0, 0};
};

constexpr double kLeastShare = 0.125;  // power says little about what a lamp lights from nearby

/// How much light of each kind meets the scene, roughly.
std::array<double, kLightKinds> powers_of(const Scene::Data& scene) {
  // A quarter of the surface is a convex body's mean shadow (Cauchy).
  const double shadow = std::max(0.5 * bvh::half_area<Aabb>(scene.bounds), 1e-300);
  return {scene.sun.power() * shadow, scene.sky.power() * shadow,
          2.0 * std::numbers::pi * scene.light_choices.total()};
}

/// Leaves no kind more than one ray as long as others can take the rest.
void cap(std::array<double, kLightKinds>& counts) {
  for (uint32_t round = 0; round < kLightKinds; ++round) {
    double excess = 0.0, others = 0.0;
    for (double& count : counts) {
      if (count < 1.0) others += count;
      if (count > 1.0) excess += count - 1.0;
    }
    if (!(excess > 0.0) || !(others > 0.0)) return;
    for (double& count : counts) count = count < 1.0 ? count * (1.0 + excess / others) : 1.0;
  }
}

}  // namespace

ShadowPlan plan_shadows(const Scene::Data& scene, uint32_t shadow_samples) {
  std::array<double, kLightKinds> counts = powers_of(scene);
  const double power = counts[kSun] + counts[kSky] + counts[kTriangles];
  ShadowPlan plan;
  if (shadow_samples == 0 || scene.triangles.empty() || !(power > 0.0)) return plan;
  plan.rays = shadow_samples;
  double sum = 0.0;
  for (double& count : counts)
    if (count > 0.0) sum += count = std::max(count / power, kLeastShare);
  for (double& count : counts) count *= plan.rays / sum;
  cap(counts);
  // Ray i takes what lies between i and i + 1 where the counts stand side by side.
  double low = 0.0;
  for (uint32_t k = 0; k < kLightKinds; low += counts[k++]) {
    plan.expected[k] = static_cast<float>(counts[k]);
    for (uint32_t i = 0; i < plan.rays; ++i) {
      const double overlap = std::min(low + counts[k], i + 1.0) - std::max<double>(low, i);
      // What rounding leaves is no chance: its light would not be weighted for it.
      if (overlap > 1e-6) plan.chances[i][k] = static_cast<float>(overlap);
    }
  }
  return plan;
}

FirstHit trace_first_hit(const PathContext& context, Ray ray, const Sampler& sampler) {
  Statistics counts;
  return Path(context, sampler, counts).first(ray);
}

Vec3 trace_path(const PathContext& context, Ray ray, const Sampler& sampler, Statistics& counts) {
  return Path(context, sampler, counts).follow(ray);
}

}  // namespace umbel::trace
