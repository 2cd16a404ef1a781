// Light from outside the scene: a sky, as a table of radiance, and a sun, as a disc.
#pragma once

#include <numbers>
#include <vector>

#include "trace/alias_table.hpp"
#include "trace/vector.hpp"
#include "umbel/trace.hpp"

namespace umbel::trace {

/// A direction towards light, what comes from there, and its probability density per steradian.
struct LightSample {
  Vec3 direction;
  Vec3 radiance;
  float density;
};

/// A clear sky (Preetham, Shirley & Smits, "A Practical Analytic Model for Daylight", 1999) with
/// the ground below it, or one constant colour. The upper half is tabled over cells of equal solid
/// angle, few enough to stay in a core's cache.
class Sky {
 public:
  Sky() = default;
  explicit Sky(const Environment& environment);

  bool is_black() const { return choices_.empty(); }
  Vec3 radiance(const Vec3& direction) const;
  LightSample sample(const Vec2& u) const;
  float density(const Vec3& direction) const;
  /// Luminance summed over all directions.
  double power() const { return (constant_ ? 4.0 * std::numbers::pi : 1.0) * choices_.total(); }

 private:
  static constexpr uint32_t kColumns = 128, kRows = 64;
  static constexpr uint32_t kGround = kColumns * kRows;  ///< the choice below the horizon
  static float column_of(const Vec3& local);
  Vec3 interpolated(float column, float row) const;
  float density_of(uint32_t choice) const { return luminance(texels_[choice]) * density_scale_; }

  bool constant_ = false;
  Vec3 color_{0, 0, 0};
  Basis basis_{};             ///< z is up
  std::vector<Vec3> texels_;  ///< rows from the horizon to the zenith, then the ground
  float density_scale_ = 0.0f;
  AliasTable choices_;
};

/// A disc of constant radiance, infinitely far away.
class Sun {
 public:
  Sun() = default;
  explicit Sun(const Environment& environment);

  bool is_black() const { return trace::is_black(radiance_); }
  Vec3 radiance(const Vec3& direction) const {
    // The chord, because cosines of small angles have few digits.
    const Vec3 chord = direction - basis_.z;
    return dot(chord, chord) <= 2.0f * cap_ ? radiance_ : Vec3{0, 0, 0};
  }
  LightSample sample(const Vec2& u) const;
  float density() const { return density_; }  ///< within the disc
  /// Luminance summed over the disc.
  double power() const { return is_black() ? 0.0 : double{luminance(radiance_)} / density_; }

 private:
  Basis basis_{};
  float cap_ = -1.0f;  ///< 1 - cosine of the disc's radius
  float density_ = 0.0f;
  Vec3 radiance_{0, 0, 0};
};

}  // namespace umbel::trace
