// Sky and sun. The formulas and their constants are those of the appendices of Preetham, Shirley
// & Smits 1999; the sun's colour is the transmittance of Rayleigh scattering and aerosols at three
// wavelengths.
#include "trace/sky.hpp"

#include <array>

namespace umbel::trace {
namespace {

constexpr double kUnit = 40.0;         // kcd/m2 that become a radiance of 1
constexpr double kSunOutside = 128.0;  // klx above the atmosphere
const double kLowest = std::sin(3.0 * std::numbers::pi / 180.0);

struct Spot {
  double cos_zenith;
  double gamma;  // angle to the sun
};

/// Perez's distribution of luminance and chromaticity with its five coefficients.
double perez(const std::array<double, 5>& c, const Spot& at) {
  const double cos_gamma = std::cos(at.gamma);
  return (1 + c[0] * std::exp(c[1] / std::max(at.cos_zenith, 0.01))) *
         (1 + c[2] * std::exp(c[3] * at.gamma) + c[4] * cos_gamma * cos_gamma);
}

struct ClearSky {
  std::array<double, 5> luminance, x, y;
  double zenith_luminance, zenith_x, zenith_y;
  double sun_zenith;

  ClearSky(double t, double sun_zenith_angle) : sun_zenith(sun_zenith_angle) {
    luminance = {0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251,
                 0.1206 * t - 2.5771, -0.0670 * t + 0.3703};
    x = {-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989,
         -0.0033 * t + 0.0452};
    y = {-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537,
         -0.0109 * t + 0.0529};
    const double s = sun_zenith, s2 = s * s, s3 = s2 * s;
    const double chi = (4.0 / 9.0 - t / 120.0) * (std::numbers::pi - 2 * s);
    zenith_luminance = std::max(0.0, (4.0453 * t - 4.9710) * std::tan(chi) - 0.2155 * t + 2.4192);
    zenith_x = (0.00166 * s3 - 0.00375 * s2 + 0.00209 * s) * t * t +
               (-0.02903 * s3 + 0.06377 * s2 - 0.03202 * s + 0.00394) * t + 0.11693 * s3 -
               0.21196 * s2 + 0.06052 * s + 0.25886;
    zenith_y = (0.00275 * s3 - 0.00610 * s2 + 0.00317 * s) * t * t +
               (-0.04214 * s3 + 0.08970 * s2 - 0.04153 * s + 0.00516) * t + 0.15346 * s3 -
               0.26756 * s2 + 0.06670 * s + 0.26688;
  }

  /// Linear sRGB in kcd/m2.
  Vec3 at(const Spot& spot) const {
    const Spot zenith{1.0, sun_zenith};
    const double big_y = zenith_luminance * perez(luminance, spot) / perez(luminance, zenith);
    const double cx = zenith_x * perez(x, spot) / perez(x, zenith);
    const double cy = zenith_y * perez(y, spot) / perez(y, zenith);
    const double big_x = big_y * cx / cy, big_z = big_y * (1 - cx - cy) / cy;
    const auto positive = [](double v) { return static_cast<float>(std::max(v, 0.0)); };
    return {positive(3.2404542 * big_x - 1.5371385 * big_y - 0.4985314 * big_z),
            positive(-0.9692660 * big_x + 1.8760108 * big_y + 0.0415560 * big_z),
            positive(0.0556434 * big_x - 0.2040259 * big_y + 1.0572252 * big_z)};
  }
};

/// The direction to the sun, lifted above the horizon: the model has no night.
Vec3 sun_of(const Environment& environment, const Vec3& up) {
  const Vec3 given = normalized(environment.sun_direction, up);
  const double height = dot(given, up);
  if (height >= kLowest) return given;
  const Vec3 along = normalized(given - up * static_cast<float>(height), basis_around(up).x);
  return normalized(along * static_cast<float>(std::sqrt(1 - kLowest * kLowest)) +
                        up * static_cast<float>(kLowest),
                    up);
}

/// Illuminance at a right angle to the sun, in klx, in linear sRGB.
Vec3 sun_illuminance(double cos_zenith, double turbidity) {
  const double degrees = std::acos(std::clamp(cos_zenith, -1.0, 1.0)) * 180 / std::numbers::pi;
  const double mass = 1 / (cos_zenith + 0.15 * std::pow(93.885 - degrees, -1.253));
  const double beta = 0.04608365822050 * turbidity - 0.04586025928522;
  const auto channel = [&](double micrometres) {
    const double rayleigh = std::exp(-0.008735 * std::pow(micrometres, -4.08) * mass);
    const double aerosols = std::exp(-beta * std::pow(micrometres, -1.3) * mass);
    return static_cast<float>(kSunOutside * rayleigh * aerosols);
  };
  return {channel(0.610), channel(0.550), channel(0.465)};
}

}  // namespace

Sky::Sky(const Environment& environment) {
  if (environment.kind == Environment::Kind::kConstant) {
    constant_ = true;
    color_ = environment.color;
    const double weight = luminance(color_);
    choices_ = AliasTable(std::span(&weight, 1));
    return;
  }
  const Vec3 up = normalized(environment.up, {0, 1, 0});
  basis_ = basis_around(up);
  const Vec3 sun = basis_.to_local(sun_of(environment, up));
  const ClearSky clear(environment.turbidity, std::acos(std::clamp(sun.z, -1.0f, 1.0f)));
  const float scale = static_cast<float>(environment.sky_strength / kUnit);
  Vec3 irradiance = sun_illuminance(sun.z, environment.turbidity) *
                    static_cast<float>(sun.z * environment.sun_strength / kUnit);
  constexpr float kCell = 2.0f * kPi / kGround;
  texels_.resize(kGround + 1);
  for (uint32_t row = 0; row < kRows; ++row) {
    const float z = (static_cast<float>(row) + 0.5f) / kRows;
    const float r = std::sqrt(1.0f - z * z);
    for (uint32_t column = 0; column < kColumns; ++column) {
      const float phi = 2.0f * kPi * (static_cast<float>(column) + 0.5f) / kColumns;
      const Vec3 d{r * std::cos(phi), r * std::sin(phi), z};
      const double gamma = std::acos(std::clamp(dot(d, sun), -1.0f, 1.0f));
      const Vec3 color = clear.at({z, gamma}) * scale;
      texels_[row * kColumns + column] = color;
      irradiance += color * (z * kCell);
    }
  }
  texels_[kGround] = irradiance * environment.ground_albedo * (1.0f / kPi);

  std::vector<double> weights(texels_.size());
  std::transform(texels_.begin(), texels_.end(), weights.begin(),
                 [](const Vec3& c) { return double{luminance(c)} * kCell; });
  weights[kGround] *= kGround;
  choices_ = AliasTable(weights);
  density_scale_ = static_cast<float>(1.0 / std::max(choices_.total(), 1e-300));
}

float Sky::column_of(const Vec3& local) {
  const float phi = std::atan2(local.y, local.x);
  return (phi < 0.0f ? phi + 2.0f * kPi : phi) * (kColumns / (2.0f * kPi));
}

Vec3 Sky::radiance(const Vec3& direction) const {
  if (constant_) return color_;
  if (texels_.empty()) return {0, 0, 0};
  const Vec3 local = basis_.to_local(direction);
  return local.z < 0.0f ? texels_[kGround] : interpolated(column_of(local), local.z * kRows);
}

Vec3 Sky::interpolated(float column, float row) const {
  const float x = column - 0.5f, floor_x = std::floor(x);
  // Sky and ground are not mixed: the horizon is sharp.
  const float y = std::clamp(row - 0.5f, 0.0f, float{kRows - 1});
  const uint32_t y0 = static_cast<uint32_t>(y), y1 = std::min(y0 + 1, kRows - 1);
  const uint32_t x0 = static_cast<uint32_t>(floor_x + kColumns) % kColumns;
  const uint32_t x1 = (x0 + 1) % kColumns;
  const float tx = x - floor_x, ty = y - static_cast<float>(y0);
  const auto at = [&](uint32_t cx, uint32_t cy) { return texels_[cy * kColumns + cx]; };
  return lerp(lerp(at(x0, y0), at(x1, y0), tx), lerp(at(x0, y1), at(x1, y1), tx), ty);
}

LightSample Sky::sample(const Vec2& u) const {
  const auto direction = [](float z, float turn) {
    const float r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * turn;
    return Vec3{r * std::cos(phi), r * std::sin(phi), z};
  };
  if (constant_) return {direction(1.0f - 2.0f * u.x, u.y), color_, 1.0f / (4.0f * kPi)};
  const AliasTable::Choice choice = choices_.choose(u.x);
  const float density = density_of(choice.index);
  if (choice.index == kGround)
    return {basis_.to_world(direction(-choice.rest, u.y)), texels_[kGround], density};
  const uint32_t whole_row = choice.index / kColumns, whole_column = choice.index % kColumns;
  const float row = static_cast<float>(whole_row) + choice.rest;
  const float column = static_cast<float>(whole_column) + u.y;
  return {basis_.to_world(direction(row / kRows, column / kColumns)), interpolated(column, row),
          density};
}

float Sky::density(const Vec3& direction) const {
  if (is_black()) return 0.0f;
  if (constant_) return 1.0f / (4.0f * kPi);
  const Vec3 local = basis_.to_local(direction);
  if (local.z < 0.0f) return density_of(kGround);
  const uint32_t row = std::min(static_cast<uint32_t>(local.z * kRows), kRows - 1);
  return density_of(row * kColumns + static_cast<uint32_t>(column_of(local)) % kColumns);
}

Sun::Sun(const Environment& environment) {
  if (environment.kind == Environment::Kind::kConstant || environment.sun_strength <= 0.0f) return;
  const Vec3 up = normalized(environment.up, {0, 1, 0});
  basis_ = basis_around(sun_of(environment, up));
  // 1 - cos written so that small angles keep their digits.
  const float half = std::sin(environment.sun_radius / 2.0f);
  cap_ = 2.0f * half * half;
  density_ = 1.0f / (2.0f * kPi * cap_);
  radiance_ = sun_illuminance(dot(basis_.z, up), environment.turbidity) *
              (environment.sun_strength * density_ / static_cast<float>(kUnit));
}

LightSample Sun::sample(const Vec2& u) const {
  const Vec2 disc = on_disc(u);
  // Height is uniform within a cap, and so is the squared radius within a disc.
  const float depth = (disc.x * disc.x + disc.y * disc.y) * cap_;
  const float scale = std::sqrt(cap_ * (2.0f - depth));
  return {basis_.to_world({disc.x * scale, disc.y * scale, 1.0f - depth}), radiance_, density_};
}

}  // namespace umbel::trace
