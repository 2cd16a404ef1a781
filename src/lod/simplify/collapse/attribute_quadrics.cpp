#include "lod/simplify/collapse/attribute_quadrics.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/math.hpp"

namespace umbel::lod {
namespace {

float sum_of(Float4 lanes) {
  std::array<float, 4> x;
  store4(x.data(), lanes);
  return (x[0] + x[1]) + (x[2] + x[3]);
}

}  // namespace

void AttributeQuadrics::build(const CollapseInput& input) {
  find_columns(input);
  if (count_ == 0) return;
  const size_t vertices = input.position_of.size(), width = input.attribute_weights.size();
  stride_ = (count_ + 3) / 4 * 4;
  values_.assign(vertices * stride_, 0.0f);
  for (size_t v = 0; v < vertices; ++v)
    for (uint32_t k = 0; k < count_; ++k)
      values_of(v)[k] = input.attributes[v * width + columns_[k]] * weights_[k];
  quadrics_.assign(vertices, Quadric{});
  gradients_.assign(4 * vertices * stride_, 0.0f);
  for (const Triangle& t : input.triangles) add_triangle(input, t);
}

// What is the same everywhere, or has no weight, costs nothing.
void AttributeQuadrics::find_columns(const CollapseInput& input) {
  const size_t width = input.attribute_weights.size(), vertices = input.position_of.size();
  columns_.clear();
  weights_.clear();
  for (uint32_t k = 0; k < width; ++k) {
    if (input.attribute_weights[k] == 0.0f) continue;
    const float* const values = input.attributes.data() + k;
    size_t v = 1;
    while (v < vertices && values[v * width] == values[0]) ++v;
    if (v >= vertices) continue;
    columns_.push_back(k);
    weights_.push_back(input.attribute_weights[k]);
  }
  count_ = static_cast<uint32_t>(columns_.size());
}

void AttributeQuadrics::add_triangle(const CollapseInput& input, const Triangle& t) {
  const Vec3& origin = input.positions[t[0]];
  const Vec3 e1 = input.positions[t[1]] - origin, e2 = input.positions[t[2]] - origin;
  const float d11 = dot(e1, e1), d12 = dot(e1, e2), d22 = dot(e2, e2);
  const float determinant = d11 * d22 - d12 * d12;
  const float area = 0.5f * length(cross(e1, e2));
  if (!(determinant > 1e-6f * d11 * d22)) {
    for (uint32_t v : t) quadrics_[v].weight += area;
    return;
  }
  const Vec3 gu = (e1 * d22 - e2 * d12) * (1.0f / determinant);
  const Vec3 gv = (e2 * d11 - e1 * d12) * (1.0f / determinant);
  const Float4 ux = splat(gu.x), uy = splat(gu.y), uz = splat(gu.z);
  const Float4 vx = splat(gv.x), vy = splat(gv.y), vz = splat(gv.z);
  const Float4 weight = splat(area);
  Float4 xx = splat(0.0f), yy = xx, zz = xx, xy = xx, xz = xx, yz = xx;
  // Stores of four floats may change any member, as far as the compiler knows.
  const uint32_t stride = stride_;
  const std::array<const float*, 3> values{values_of(t[0]), values_of(t[1]), values_of(t[2])};
  const std::array<float*, 3> gradients{gradients_of(t[0]), gradients_of(t[1]), gradients_of(t[2])};
  for (uint32_t k = 0; k < stride; k += 4) {
    const Float4 s0 = load4(values[0] + k);
    const Float4 s1 = load4(values[1] + k) - s0;
    const Float4 s2 = load4(values[2] + k) - s0;
    const Float4 x = ux * s1 + vx * s2, y = uy * s1 + vy * s2, z = uz * s1 + vz * s2;
    const Float4 wx = weight * x, wy = weight * y, wz = weight * z;
    xx = xx + wx * x, yy = yy + wy * y, zz = zz + wz * z;
    xy = xy + wx * y, xz = xz + wx * z, yz = yz + wy * z;
    for (float* const of_vertex : gradients) {
      float* const out = of_vertex + k;
      store4(out, load4(out) + wx);
      store4(out + stride, load4(out + stride) + wy);
      store4(out + 2 * stride, load4(out + 2 * stride) + wz);
    }
  }
  // All else in the quadric is 0.
  Float4 none = splat(0.0f), none_either = none;
  transpose(xx, yy, zz, xy);
  transpose(xz, yz, none, none_either);
  const Float4 low = (xx + yy) + (zz + xy);
  Float4 high = (xz + yz) + (none + none_either);
  high[2] = area;
  for (uint32_t v : t) {
    Quadric& q = quadrics_[v];
    store4(&q.xx, load4(&q.xx) + low);
    store4(&q.xz, load4(&q.xz) + high);
  }
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

AttributeQuadrics::MoveCosts::MoveCosts(const AttributeQuadrics& all, uint32_t from, const Vec3& d)
    : all_(all), here_(all.values_of(from)), weight_(splat(all.quadrics_[from].weight)) {
  const float* const g = all.gradients_of(from);
  const Float4 dx = splat(d.x), dy = splat(d.y), dz = splat(d.z);
  const uint32_t stride = all.stride_;
  for (uint32_t k = 0; k < stride; k += 4)
    means_[k / 4] = load4(g + k) * dx + load4(g + stride + k) * dy +
                    load4(g + 2 * stride + k) * dz + load4(g + 3 * stride + k);
  of_position_ = value_at(all.quadrics_[from], d);
}

float AttributeQuadrics::MoveCosts::operator()(uint32_t to) const {
  const float* const there = all_.values_of(to);
  Float4 products = splat(0.0f), squares = products;
  for (uint32_t k = 0; k < all_.stride_; k += 4) {
    const Float4 difference = load4(there + k) - load4(here_ + k);
    products = products + difference * means_[k / 4];
    squares = squares + difference * difference;
  }
  const float sum = sum_of(weight_ * squares - splat(2.0f) * products);
  return std::max(of_position_ + sum, 0.0f);
}

Float4 AttributeQuadrics::costs(uint32_t from, const std::array<uint32_t, 4>& to, Float4 dx,
                                Float4 dy, Float4 dz) const {
  const Quadric& q = quadrics_[from];
  const float *a = values_of(from), *g = gradients_of(from);
  const Float4 weight = splat(q.weight), two = splat(2.0f);
  std::array<Float4, 4> sums{splat(0.0f), splat(0.0f), splat(0.0f), splat(0.0f)};
  for (uint32_t k = 0; k < stride_; k += 4) {
    const Float4 here = load4(a + k), mean = load4(g + 3 * stride_ + k);
    const Float4 gx = load4(g + k), gy = load4(g + stride_ + k), gz = load4(g + 2 * stride_ + k);
    for (size_t i = 0; i < 4; ++i) {
      const Float4 difference = load4(values_of(to[i]) + k) - here;
      const Float4 there = gx * splat(dx[i]) + gy * splat(dy[i]) + gz * splat(dz[i]) + mean;
      sums[i] = sums[i] + difference * (weight * difference - two * there);
    }
  }
  transpose(sums[0], sums[1], sums[2], sums[3]);
  const Float4 sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  const auto row = [&](float x, float y, float z, float constant) {
    return splat(x) * dx + splat(y) * dy + splat(z) * dz + splat(2.0f * constant);
  };
  const Float4 value = splat(q.c) + row(q.xx, q.xy, q.xz, q.x) * dx +
                       row(q.xy, q.yy, q.yz, q.y) * dy + row(q.xz, q.yz, q.zz, q.z) * dz;
  // In this order max keeps what is not a number.
  return max4(splat(0.0f), value + sum);
}

void AttributeQuadrics::merge(uint32_t from, uint32_t to, const Vec3& d, float cost) {
  const Quadric& q = quadrics_[from];
  Quadric& sum = quadrics_[to];
  add_moved(sum, q, d, cost);
  const float *a = values_of(from), *b = values_of(to), *g = gradients_of(from);
  float* out = gradients_of(to);
  Vec3 linear{sum.x, sum.y, sum.z};
  const float weight = q.weight;
  const uint32_t stride = stride_;
  for (uint32_t k = 0; k < count_; ++k) {
    const float difference = b[k] - a[k];
    const float x = g[k], y = g[stride + k], z = g[2 * stride + k], mean = g[3 * stride + k];
    linear.x -= difference * x, linear.y -= difference * y, linear.z -= difference * z;
    out[k] += x, out[stride + k] += y, out[2 * stride + k] += z;
    out[3 * stride + k] += mean + x * d.x + y * d.y + z * d.z - weight * difference;
  }
  sum.x = linear.x, sum.y = linear.y, sum.z = linear.z;
}

// The sum of squared differences is least where its derivative by the value is 0.
bool AttributeQuadrics::refit(uint32_t vertex, std::span<float> values) const {
  if (count_ == 0 || !(quadrics_[vertex].weight > 0.0f)) return false;
  bool moved = false;
  for (uint32_t k = 0; k < count_; ++k) {
    const float difference =
        gradients_of(vertex)[3 * stride_ + k] / (quadrics_[vertex].weight * weights_[k]);
    if (!std::isfinite(difference) || difference == 0.0f) continue;
    values[columns_[k]] += difference;
    moved = true;
  }
  return moved;
}

}  // namespace umbel::lod
