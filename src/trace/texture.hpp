// Textures as bytes, decoded by a table and filtered bilinearly.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "umbel/trace.hpp"

namespace umbel::trace {

class Texture {
 public:
  explicit Texture(const TextureView& view);

  Vec4 lookup(const Vec2& uv) const;
  /// The mean of all texels.
  const Vec4& mean() const { return mean_; }

 private:
  Vec4 texel(int64_t x, int64_t y) const;

  // Bytes and not floats: textures are large, and a table of 256 floats stays in the cache.
  std::vector<uint8_t> texels_;
  uint32_t width_, height_;
  bool srgb_, nearest_;
  Wrap wrap_u_, wrap_v_;
  Vec4 mean_{0, 0, 0, 0};
};

/// uv as a use of a texture transforms it.
inline Vec2 transformed(const TextureUse& use, const Vec2& uv) {
  const Vec2 s{uv.x * use.scale.x, uv.y * use.scale.y};
  if (use.rotation == 0.0f) return {s.x + use.offset.x, s.y + use.offset.y};
  const float c = std::cos(use.rotation), n = std::sin(use.rotation);
  return {c * s.x + n * s.y + use.offset.x, c * s.y - n * s.x + use.offset.y};
}

}  // namespace umbel::trace
