// Renders tiles in parallel, and the samples of a pixel in order, so that neither the number of
// threads nor the number of calls changes a bit of the picture.
#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "base/refuse.hpp"
#include "base/shared_progress.hpp"
#include "trace/camera.hpp"
#include "trace/path.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {
namespace {

constexpr uint32_t kTile = 16;
constexpr uint32_t kPathsBetweenReports = 1u << 16;  // at most, of a tile

void check(const Settings& s) {
  constexpr uint32_t kMostSamples = 1u << 24;
  check_picture_size(s.width, s.height);
  require(s.samples >= 1 && s.samples <= kMostSamples,
          "samples is " + std::to_string(s.samples) + ", but must be from 1 to 16777216");
  require(s.max_bounces <= 1024,
          "max_bounces is " + std::to_string(s.max_bounces) + ", but must be at most 1024");
  require(s.shadow_samples <= 2,
          "shadow_samples is " + std::to_string(s.shadow_samples) + ", but must be 0, 1 or 2");
  require(s.clamp >= 0.0f && std::isfinite(s.clamp),
          "clamp is " + printed(s.clamp) + ", but must be 0 or more and finite");
}

void check(const Film& film, const Settings& s) {
  const bool empty = film.sums.empty() && film.samples == 0;
  require(empty || (film.width == s.width && film.height == s.height &&
                    film.sums.size() == size_t(s.width) * s.height),
          "the film is not of the settings' size");
  require(film.samples <= (1u << 24) - s.samples, "the film has too many samples");
}

/// An offset from the pixel's centre, for a tent filter two pixels wide.
float tent(float u) {
  return u < 0.5f ? std::sqrt(2.0f * u) - 1.0f : 1.0f - std::sqrt(2.0f - 2.0f * u);
}

struct Tiles {
  uint32_t across, down;
  explicit Tiles(const Settings& s)
      : across((s.width + kTile - 1) / kTile), down((s.height + kTile - 1) / kTile) {}
  size_t count() const { return size_t(across) * down; }
};

class Renderer {
 public:
  Renderer(const Scene& scene, const Camera& camera, const Settings& settings, const Film& film)
      : settings_(settings),
        camera_(camera, settings.width, settings.height),
        first_(film.samples),
        tiles_(settings),
        context_{scene.data(), settings_, plan_shadows(scene.data(), settings.shadow_samples)} {}

  /// Adds to `sums`; gives what was traced.
  Statistics run(std::vector<Vec3d>& sums, Progress& progress) {
    std::vector<Statistics> counts(tiles_.count());
    for_each_sample(progress, [&](size_t tile, size_t pixel, const Ray& ray, const Sampler& s) {
      sums[pixel] += trace_path(context_, ray, s, counts[tile]);
    });
    Statistics total;
    for (const Statistics& c : counts) {
      total.primary += c.primary;
      total.bounce += c.bounce;
      total.shadow += c.shadow;
      total.continued += c.continued;
    }
    return total;
  }

  /// The same for albedo and normal.
  void run(std::vector<Vec3d>& albedo, std::vector<Vec3d>& normal, Progress& progress) {
    for_each_sample(progress, [&](size_t, size_t pixel, const Ray& ray, const Sampler& s) {
      const FirstHit hit = trace_first_hit(context_, ray, s);
      albedo[pixel] += hit.albedo;
      normal[pixel] += hit.normal;
    });
  }

 private:
  /// Calls sample(tile, pixel, ray, sampler), of each pixel in order.
  template <typename Sample>
  void for_each_sample(Progress& progress, const Sample& sample) const {
    const uint64_t total = uint64_t{settings_.samples} * settings_.width * settings_.height;
    SharedProgress traced(progress, "tracing", 0, 1, total);
    parallel_for(tiles_.count(), 1, [&](size_t tile) {
      if (traced.is_stopped()) return;
      const uint32_t left = static_cast<uint32_t>(tile % tiles_.across) * kTile;
      const uint32_t top = static_cast<uint32_t>(tile / tiles_.across) * kTile;
      uint32_t uncounted = 0;
      for (uint32_t y = top; y < std::min(top + kTile, settings_.height); ++y) {
        for (uint32_t x = left; x < std::min(left + kTile, settings_.width); ++x) {
          const uint32_t pixel = y * settings_.width + x;
          for (uint32_t i = 0; i < settings_.samples; ++i) {
            const Sampler sampler(settings_.seed, pixel, first_ + i);
            sample(tile, pixel, ray_of(x, y, sampler), sampler);
            if (++uncounted < kPathsBetweenReports) continue;
            traced.add(std::exchange(uncounted, 0));
            if (traced.is_stopped()) return;
          }
        }
      }
      traced.add(uncounted);
    });
    traced.finish();
  }

  Ray ray_of(uint32_t x, uint32_t y, const Sampler& sampler) const {
    const Vec2 u = sampler.point(kPixelDimension);
    return camera_.ray(static_cast<float>(x) + 0.5f + tent(u.x),
                       static_cast<float>(y) + 0.5f + tent(u.y), sampler.point(kLensDimension));
  }

  Settings settings_;
  RayCamera camera_;
  uint32_t first_;
  Tiles tiles_;
  PathContext context_;
};

std::vector<Vec3> means(const std::vector<Vec3d>& sums, uint32_t samples) {
  const double scale = samples > 0 ? 1.0 / samples : 0.0;
  std::vector<Vec3> result(sums.size());
  std::ranges::transform(sums, result.begin(),
                         [=](const Vec3d& sum) { return relative_to({0, 0, 0}, sum * scale); });
  return result;
}

}  // namespace

Image Film::image() const { return {width, height, means(sums, samples)}; }

void accumulate(const Scene& scene, const Camera& camera, const Settings& settings, Film& film,
                const BuildOptions& options) {
  check(settings);
  check(film, settings);
  Progress progress(options);
  Renderer renderer(scene, camera, settings, film);
  std::vector<Vec3d> sums = film.sums;
  sums.resize(size_t(settings.width) * settings.height, Vec3d{0, 0, 0});
  Statistics traced;
  const auto began = std::chrono::steady_clock::now();
  with_threads(options.threads, [&] { traced = renderer.run(sums, progress); });
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  film.width = settings.width;
  film.height = settings.height;
  film.samples += settings.samples;
  film.sums = std::move(sums);
  film.statistics.primary += traced.primary;
  film.statistics.bounce += traced.bounce;
  film.statistics.shadow += traced.shadow;
  film.statistics.continued += traced.continued;
  film.statistics.seconds += took.count();
}

Features features(const Scene& scene, const Camera& camera, const Settings& settings,
                  const BuildOptions& options) {
  check(settings);
  Progress progress(options);
  std::vector<Vec3d> albedo(size_t(settings.width) * settings.height, Vec3d{0, 0, 0});
  std::vector<Vec3d> normal = albedo;
  Renderer renderer(scene, camera, settings, {});
  with_threads(options.threads, [&] { renderer.run(albedo, normal, progress); });
  return {{settings.width, settings.height, means(albedo, settings.samples)},
          {settings.width, settings.height, means(normal, settings.samples)}};
}

Picture render(const Scene& scene, const Camera& camera, const Settings& settings,
               const BuildOptions& options) {
  Film film;
  accumulate(scene, camera, settings, film, options);
  return {film.image(), film.statistics};
}

}  // namespace umbel::trace
