#include "lod/simplify/collapse/attribute_quadrics.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/math.hpp"
#include "base/simd/float4.hpp"

namespace umbel::lod {
namespace {

float sum_of(Float4 lanes) {
  std::array<float, 4> x;
  store4(x.data(), lanes);
  return (x[0] + x[1]) + (x[2] + x[3]);
}

}  // namespace

void AttributeQuadrics::build(const CollapseInput& input) {
  weights_ = input.attribute_weights;
  count_ = static_cast<uint32_t>(weights_.size());
  if (count_ == 0) return;
  const size_t vertices = input.position_of.size();
  stride_ = (count_ + 3) / 4 * 4;
  values_.assign(vertices * stride_, 0.0f);
  for (size_t v = 0; v < vertices; ++v)
    for (uint32_t k = 0; k < count_; ++k)
      values_of(v)[k] = input.attributes[v * count_ + k] * weights_[k];
  quadrics_.assign(vertices, Quadric{});
  gradients_.assign(4 * vertices * stride_, 0.0f);
  for (const Triangle& t : input.triangles) add_triangle(input, t);
}

void AttributeQuadrics::add_triangle(const CollapseInput& input, const Triangle& t) {
  const Vec3& origin = input.positions[t[0]];
  const Vec3 e1 = input.positions[t[1]] - origin, e2 = input.positions[t[2]] - origin;
  const float d11 = dot(e1, e1), d12 = dot(e1, e2), d22 = dot(e2, e2);
  const float determinant = d11 * d22 - d12 * d12;
  const float area = 0.5f * length(cross(e1, e2));
  for (uint32_t v : t) quadrics_[v].weight += area;
  if (!(determinant > 1e-6f * d11 * d22)) return;
  const Vec3 gu = (e1 * d22 - e2 * d12) * (1.0f / determinant);
  const Vec3 gv = (e2 * d11 - e1 * d12) * (1.0f / determinant);
  const Float4 ux = splat(gu.x), uy = splat(gu.y), uz = splat(gu.z);
  const Float4 vx = splat(gv.x), vy = splat(gv.y), vz = splat(gv.z);
  const Float4 weight = splat(area);
  Float4 xx = splat(0.0f), yy = xx, zz = xx, xy = xx, xz = xx, yz = xx;
  for (uint32_t k = 0; k < stride_; k += 4) {
    const Float4 s0 = load4(values_of(t[0]) + k);
    const Float4 s1 = load4(values_of(t[1]) + k) - s0;
    const Float4 s2 = load4(values_of(t[2]) + k) - s0;
    const Float4 x = ux * s1 + vx * s2, y = uy * s1 + vy * s2, z = uz * s1 + vz * s2;
    const Float4 wx = weight * x, wy = weight * y, wz = weight * z;
    xx = xx + wx * x, yy = yy + wy * y, zz = zz + wz * z;
    xy = xy + wx * y, xz = xz + wx * z, yz = yz + wy * z;
    for (uint32_t v : t) {
      float* out = gradients_of(v) + k;
      store4(out, load4(out) + wx);
      store4(out + stride_, load4(out + stride_) + wy);
      store4(out + 2 * stride_, load4(out + 2 * stride_) + wz);
    }
  }
  Quadric sum{};
  sum.xx = sum_of(xx), sum.yy = sum_of(yy), sum.zz = sum_of(zz);
  sum.xy = sum_of(xy), sum.xz = sum_of(xz), sum.yz = sum_of(yz);
  for (uint32_t v : t) add(quadrics_[v], sum);
}

float AttributeQuadrics::cost(uint32_t from, uint32_t to, const Vec3& d) const {
  const Quadric& q = quadrics_[from];
  const float *a = values_of(from), *b = values_of(to), *g = gradients_of(from);
  const Float4 dx = splat(d.x), dy = splat(d.y), dz = splat(d.z);
  Float4 products = splat(0.0f), squares = products;
  for (uint32_t k = 0; k < stride_; k += 4) {
    const Float4 difference = load4(b + k) - load4(a + k);
    const float* at = g + k;
    const Float4 mean = load4(at) * dx + load4(at + stride_) * dy + load4(at + 2 * stride_) * dz +
                        load4(at + 3 * stride_);
    products = products + difference * mean;
    squares = squares + difference * difference;
  }
  const float sum = sum_of(splat(q.weight) * squares - splat(2.0f) * products);
  return std::max(value_at(q, d) + sum, 0.0f);
}

void AttributeQuadrics::merge(uint32_t from, uint32_t to, const Vec3& d) {
  const Quadric& q = quadrics_[from];
  Quadric& sum = quadrics_[to];
  add_moved(sum, q, d, cost(from, to, d));
  const float *a = values_of(from), *b = values_of(to), *g = gradients_of(from);
  float* out = gradients_of(to);
  for (uint32_t k = 0; k < count_; ++k) {
    const float difference = b[k] - a[k];
    const float x = g[k], y = g[stride_ + k], z = g[2 * stride_ + k], mean = g[3 * stride_ + k];
    sum.x -= difference * x, sum.y -= difference * y, sum.z -= difference * z;
    out[k] += x, out[stride_ + k] += y, out[2 * stride_ + k] += z;
    out[3 * stride_ + k] += mean + x * d.x + y * d.y + z * d.z - q.weight * difference;
  }
}

// The sum of squared differences is least where its derivative by the value is 0.
bool AttributeQuadrics::refit(uint32_t vertex, std::span<float> values) const {
  if (count_ == 0 || !(quadrics_[vertex].weight > 0.0f)) return false;
  bool moved = false;
  for (uint32_t k = 0; k < count_; ++k) {
    const float difference =
        gradients_of(vertex)[3 * stride_ + k] / (quadrics_[vertex].weight * weights_[k]);
    if (!std::isfinite(difference) || difference == 0.0f) continue;
    values[k] += difference;
    moved = true;
  }
  return moved;
}

}  // namespace umbel::lod
