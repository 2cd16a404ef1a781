#include "lod/simplify/collapse/collapse_rules.hpp"

#include <algorithm>
#include <array>

#include "base/simd/float4.hpp"

namespace umbel::lod {

bool CollapseRules::keep_surface(uint32_t p, uint32_t target) {
  link_.forget_loop();
  limiting_factor_ = LimitingFactor::kTopology;
  if (!link_.holds(p, target)) return false;
  limiting_factor_ = LimitingFactor::kFlip;
  return mesh_.input().allow_flips || keeps_orientation(p, target);
}

bool CollapseRules::keep_seams(uint32_t p, uint32_t target) {
  limiting_factor_ = LimitingFactor::kSeams;
  return !mesh_.has_wedges() || wedges_.find(p, target);
}

// Four triangles at once, as `flips`. Areas are scaled so that the fourth powers of lengths fit
// floats.
bool CollapseRules::keeps_orientation(uint32_t p, uint32_t target) const {
  const auto link = mesh_.link(p);
  const float *from = mesh_.coordinates(p), *to = mesh_.coordinates(target);
  const Float4 zero = splat(0.0f), unit = splat(mesh_.area_unit());
  const Float4 least = splat(static_cast<float>(kLeastCosine * kLeastCosine));
  for (size_t begin = 0; begin < link.size(); begin += 4) {
    std::array<LinkEdge, 4> four;
    uint32_t stays = 0;
    for (size_t i = 0; i < 4; ++i) {
      four[i] = link[std::min(begin + i, link.size() - 1)];
      stays |= uint32_t{four[i].next != target && four[i].prev != target} << i;
    }
    const auto next = [&](size_t i) { return load4(mesh_.coordinates(four[i].next)); };
    const auto prev = [&](size_t i) { return load4(mesh_.coordinates(four[i].prev)); };
    Float4 nx = next(0), ny = next(1), nz = next(2), n3 = next(3);
    transpose(nx, ny, nz, n3);
    Float4 sx = prev(0), sy = prev(1), sz = prev(2), s3 = prev(3);
    transpose(sx, sy, sz, s3);
    sx = sx - nx, sy = sy - ny, sz = sz - nz;
    const auto normal = [&](const float* at) {
      const Float4 x = nx - splat(at[0]), y = ny - splat(at[1]);
      const Float4 z = nz - splat(at[2]);
      return std::array{(y * sz - z * sy) * unit, (z * sx - x * sz) * unit,
                        (x * sy - y * sx) * unit};
    };
    const auto dot4 = [](const std::array<Float4, 3>& a, const std::array<Float4, 3>& b) {
      return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    };
    const auto before = normal(from), after = normal(to);
    const Float4 turn = dot4(before, after), size = dot4(after, after);
    const Float4 old_size = dot4(before, before);
    const uint32_t turns_little =
        ~at_most(turn, zero) & at_most(least * size * old_size, turn * turn);
    const uint32_t is_fine = ~at_most(size, zero) & (at_most(old_size, zero) | turns_little);
    if ((stays & ~is_fine) != 0) return false;
  }
  return true;
}

}  // namespace umbel::lod
