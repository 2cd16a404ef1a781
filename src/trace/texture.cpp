#include "trace/texture.hpp"

#include <algorithm>
#include <array>

namespace umbel::trace {
namespace {

const std::array<float, 256>& decode(bool srgb) {
  static const auto tables = [] {
    std::array<std::array<float, 256>, 2> t{};
    for (uint32_t i = 0; i < 256; ++i) {
      const float v = static_cast<float>(i) / 255.0f;
      t[0][i] = v;
      t[1][i] = v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
    }
    return t;
  }();
  return tables[srgb ? 1 : 0];
}

/// A texel's index, wrapped into [0, size).
int64_t wrapped(int64_t i, int64_t size, Wrap wrap) {
  if (wrap == Wrap::kClamp) return std::clamp<int64_t>(i, 0, size - 1);
  if (wrap == Wrap::kRepeat) {
    const int64_t r = i % size;
    return r < 0 ? r + size : r;
  }
  int64_t r = i % (2 * size);
  if (r < 0) r += 2 * size;
  return r < size ? r : 2 * size - 1 - r;
}

Vec4 mixed(const Vec4& a, const Vec4& b, float t) {
  const float s = 1.0f - t;
  return {a.x * s + b.x * t, a.y * s + b.y * t, a.z * s + b.z * t, a.w * s + b.w * t};
}

// Beyond these a float's steps are larger than a texture. NaN, of coordinates whose mean is no
// float, is somewhere too.
float in_reach(float x) { return x > -1e6f ? std::min(x, 1e6f) : -1e6f; }

}  // namespace

Texture::Texture(const TextureView& view)
    : texels_(view.texels.begin(), view.texels.end()),
      width_(view.width),
      height_(view.height),
      srgb_(view.srgb),
      nearest_(view.nearest),
      wrap_u_(view.wrap_u),
      wrap_v_(view.wrap_v) {
  std::array<double, 4> sum{};
  for (uint32_t y = 0; y < height_; ++y) {
    for (uint32_t x = 0; x < width_; ++x) {
      const Vec4 t = texel(x, y);
      sum[0] += t.x, sum[1] += t.y, sum[2] += t.z, sum[3] += t.w;
    }
  }
  const double n = double{static_cast<float>(width_)} * height_;
  mean_ = {static_cast<float>(sum[0] / n), static_cast<float>(sum[1] / n),
           static_cast<float>(sum[2] / n), static_cast<float>(sum[3] / n)};
}

Vec4 Texture::texel(int64_t x, int64_t y) const {
  const auto& color = decode(srgb_);
  const size_t row = static_cast<size_t>(wrapped(y, height_, wrap_v_));
  const size_t column = static_cast<size_t>(wrapped(x, width_, wrap_u_));
  const uint8_t* p = &texels_[4 * (row * width_ + column)];
  return {color[p[0]], color[p[1]], color[p[2]], static_cast<float>(p[3]) * (1.0f / 255.0f)};
}

Vec4 Texture::lookup(const Vec2& uv) const {
  const float u = in_reach(uv.x), v = in_reach(uv.y);
  if (nearest_)
    return texel(static_cast<int64_t>(std::floor(u * static_cast<float>(width_))),
                 static_cast<int64_t>(std::floor(v * static_cast<float>(height_))));
  const float x = u * static_cast<float>(width_) - 0.5f;
  const float y = v * static_cast<float>(height_) - 0.5f;
  const float fx = std::floor(x), fy = std::floor(y);
  const auto x0 = static_cast<int64_t>(fx), y0 = static_cast<int64_t>(fy);
  return mixed(mixed(texel(x0, y0), texel(x0 + 1, y0), x - fx),
               mixed(texel(x0, y0 + 1), texel(x0 + 1, y0 + 1), x - fx), y - fy);
}

}  // namespace umbel::trace
