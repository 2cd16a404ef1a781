// Costs of the collapses of EdgeCollapser.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/simd/float4.hpp"
#include "lod/simplify/collapse/collapse.hpp"
#include "lod/simplify/collapse/quadric.hpp"

namespace umbel::lod {
namespace {

// Where the surface is flat, all collapses cost nothing: short edges go first.
constexpr float kShape = 1e-4f;
// A rim (border of the mesh, seam of attributes) is held by planes that stand on it.
constexpr float kBorderWeight = 3.0f, kSeamWeight = 1.0f;
// Of what attributes lose, squared, in the error that is told: they decide on what goes first.
constexpr float kToldAttributes = 0.0625f;

// Ranks of moves of one position, without attributes.
class RanksOfMoves {
 public:
  RanksOfMoves(const Quadric& q, const float* from)
      : xx_(Float4::all(q.xx)),
        yy_(Float4::all(q.yy)),
        zz_(Float4::all(q.zz)),
        xy_(Float4::all(q.xy)),
        xz_(Float4::all(q.xz)),
        yz_(Float4::all(q.yz)),
        x2_(Float4::all(2.0f * q.x)),
        y2_(Float4::all(2.0f * q.y)),
        z2_(Float4::all(2.0f * q.z)),
        c_(Float4::all(q.c)),
        shape_(Float4::all(kShape * q.weight)),
        scale_(Float4::all(q.scale)),
        from_(Float4::load(from)) {}

  // To the four points where `to(i)` points.
  template <typename To>
  std::array<float, 4> operator()(const To& to) const {
    Float4 dx = Float4::load(to(0)) - from_, dy = Float4::load(to(1)) - from_;
    Float4 dz = Float4::load(to(2)) - from_, d3 = Float4::load(to(3)) - from_;
    transpose(dx, dy, dz, d3);
    const Float4 mx = xx_ * dx + xy_ * dy + xz_ * dz, my = xy_ * dx + yy_ * dy + yz_ * dz;
    const Float4 mz = xz_ * dx + yz_ * dy + zz_ * dz;
    const Float4 value = c_ + (mx + x2_) * dx + (my + y2_) * dy + (mz + z2_) * dz;
    // In this order max keeps what is not a number, which then is never the least.
    const Float4 sum = max(Float4::all(0.0f), value);
    std::array<float, 4> ranks;
    ((sum + shape_ * (dx * dx + dy * dy + dz * dz)) * scale_).store(ranks.data());
    return ranks;
  }

 private:
  Float4 xx_, yy_, zz_, xy_, xz_, yz_, x2_, y2_, z2_, c_, shape_, scale_, from_;
};

float sum_of(Float4 lanes) {
  std::array<float, 4> x;
  lanes.store(x.data());
  return (x[0] + x[1]) + (x[2] + x[3]);
}

}  // namespace

void EdgeCollapser::build_quadrics() {
  quadrics_.assign(points_.size(), Quadric{});
  for (size_t t = 0; t < input_.triangles.size(); t += 4) add_planes(t);
  for (uint32_t p = 0; p < points_.size(); ++p) {
    if (kinds_[p] != Kind::kFixed && (kinds_[p] != Kind::kInterior || wedge_counts_[p] > 1))
      add_boundary_quadrics(p);
    settle_scale(p);
  }
}

// Of four triangles at once, by their areas: as add_plane with the normal of the length 1.
void EdgeCollapser::add_planes(size_t first) {
  const size_t count = std::min<size_t>(4, input_.triangles.size() - first);
  std::array<Triangle, 4> four;
  for (size_t i = 0; i < 4; ++i)
    four[i] = positions_of(input_.triangles[first + std::min(i, count - 1)]);
  const auto corner = [&](size_t k) {
    const auto at = [&](size_t i) { return Float4::load(&points_[four[i][k]].x); };
    std::array p{at(0), at(1), at(2), at(3)};
    transpose(p[0], p[1], p[2], p[3]);
    return p;
  };
  const auto a = corner(0), b = corner(1), c = corner(2);
  const Float4 ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
  const Float4 vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
  const Float4 x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
  std::array<float, 4> sizes, factors;
  (x * x + y * y + z * z).store(sizes.data());
  for (size_t i = 0; i < 4; ++i) {
    const float size = std::sqrt(sizes[i]);
    sizes[i] = 0.5f * size;
    factors[i] = size > 0.0f ? 0.5f / size : 0.0f;
    area_ += i < count ? double{sizes[i]} : 0.0;
  }
  const Float4 factor = Float4::load(factors.data());
  const Float4 fx = x * factor, fy = y * factor;
  std::array low{fx * x, fy * y, z * factor * z, fx * y};
  std::array high{fx * z, fy * z, Float4::load(sizes.data()), Float4::all(0.0f)};
  transpose(low[0], low[1], low[2], low[3]);
  transpose(high[0], high[1], high[2], high[3]);
  // All else in the quadric of a plane through its origin is 0.
  for (size_t i = 0; i < count; ++i)
    for (uint32_t v : four[i]) {
      Quadric& q = quadrics_[v];
      (Float4::load(&q.xx) + low[i]).store(&q.xx);
      (Float4::load(&q.xz) + high[i]).store(&q.xz);
    }
}

// Between the integral of the squared distance, which keeps means low but lets small details go by
// any distance, and its mean, which keeps the largest distance low.
float EdgeCollapser::scale_of(float weight) {
  return weight > 0.0f ? 1.0f / std::sqrt(weight) : 0.0f;
}

void EdgeCollapser::settle_scale(uint32_t p) { quadrics_[p].scale = scale_of(quadrics_[p].weight); }

void EdgeCollapser::add_boundary_quadrics(uint32_t p) {
  const auto add = [&](uint32_t corner, uint32_t other, float weight) {
    const Triangle q = positions_of(triangles_[corner / 3]);
    const Vec3 n = cross(point(q[1]) - point(q[0]), point(q[2]) - point(q[0]));
    const Vec3 edge = point(other) - point(p);
    const Vec3 m = cross(edge, n);
    const float size = length(m);
    if (!(size > 0.0f)) return;
    const float weighted = weight * dot(edge, edge);
    add_plane(quadrics_[p], m * (1.0f / size), weighted);
    quadrics_[p].weight += weighted;
  };
  const auto link = ring(p);
  const auto count = [&](uint32_t x, uint32_t LinkEdge::* side) {
    return std::count_if(link.begin(), link.end(), [&](const LinkEdge& s) { return s.*side == x; });
  };
  const bool is_closed = kinds_[p] == Kind::kInterior;  // two triangles at every edge
  for (size_t i = 0; i < link.size(); ++i) {
    const auto [n, q] = link[i];
    const uint32_t c = corner(p, i);
    const auto after = is_closed ? 1 : count(n, &LinkEdge::next);
    const auto before = is_closed ? 1 : count(n, &LinkEdge::prev);
    if (!is_closed && count(q, &LinkEdge::next) != count(q, &LinkEdge::prev))
      add(c, q, kBorderWeight);
    if (after != before) {
      add(c, n, kBorderWeight);
    } else if (after == 1) {
      const uint32_t opposite = corner_before(p, n);
      const uint32_t here = vertex(opposite), there = vertex(prev(opposite));
      if (!same_material(here, vertex(c)) || input_.position_of[vertex(next(opposite))] == q) {
        add(c, n, kBorderWeight);
      } else if (rule(p) != SeamRule::kIgnore && (here != vertex(c) || there != vertex(next(c)))) {
        add(c, n, kSeamWeight);
        add(opposite, n, kSeamWeight);
      }
    }
  }
}

// Within a triangle an attribute is a linear function of the point; its quadric is the squared
// difference from that, integrated over the triangle. A difference d over an area A so costs d^2 A.
// It counts as a distance of d times the root of A: on a curved surface that is what goes with a
// normal that is off by d, at any scale.
void EdgeCollapser::build_attribute_quadrics() {
  const uint32_t n = attribute_count_;
  if (n == 0) return;
  const size_t count = input_.position_of.size();
  stride_ = (n + 3) / 4 * 4;
  values_.assign(count * stride_, 0.0f);
  for (size_t v = 0; v < count; ++v)
    for (uint32_t k = 0; k < n; ++k)
      values_of(v)[k] = input_.attributes[v * n + k] * input_.attribute_weights[k];
  attribute_quadrics_.assign(count, Quadric{});
  gradients_.assign(4 * count * stride_, 0.0f);
  for (const Triangle& t : input_.triangles) {
    const Vec3& origin = input_.positions[t[0]];
    const Vec3 e1 = input_.positions[t[1]] - origin, e2 = input_.positions[t[2]] - origin;
    const float d11 = dot(e1, e1), d12 = dot(e1, e2), d22 = dot(e2, e2);
    const float determinant = d11 * d22 - d12 * d12;
    const float area = 0.5f * length(cross(e1, e2));
    for (uint32_t v : t) attribute_quadrics_[v].weight += area;
    if (!(determinant > 1e-6f * d11 * d22)) continue;
    const Vec3 gu = (e1 * d22 - e2 * d12) * (1.0f / determinant);
    const Vec3 gv = (e2 * d11 - e1 * d12) * (1.0f / determinant);
    const Float4 ux = Float4::all(gu.x), uy = Float4::all(gu.y), uz = Float4::all(gu.z);
    const Float4 vx = Float4::all(gv.x), vy = Float4::all(gv.y), vz = Float4::all(gv.z);
    const Float4 weight = Float4::all(area);
    Float4 xx = Float4::all(0.0f), yy = xx, zz = xx, xy = xx, xz = xx, yz = xx;
    for (uint32_t k = 0; k < stride_; k += 4) {
      const Float4 s0 = Float4::load(values_of(t[0]) + k);
      const Float4 s1 = Float4::load(values_of(t[1]) + k) - s0;
      const Float4 s2 = Float4::load(values_of(t[2]) + k) - s0;
      const Float4 x = ux * s1 + vx * s2, y = uy * s1 + vy * s2, z = uz * s1 + vz * s2;
      const Float4 wx = weight * x, wy = weight * y, wz = weight * z;
      xx = xx + wx * x, yy = yy + wy * y, zz = zz + wz * z;
      xy = xy + wx * y, xz = xz + wx * z, yz = yz + wy * z;
      for (uint32_t v : t) {
        float* out = gradients_of(v) + k;
        (Float4::load(out) + wx).store(out);
        (Float4::load(out + stride_) + wy).store(out + stride_);
        (Float4::load(out + 2 * stride_) + wz).store(out + 2 * stride_);
      }
    }
    Quadric sum{};
    sum.xx = sum_of(xx), sum.yy = sum_of(yy), sum.zz = sum_of(zz);
    sum.xy = sum_of(xy), sum.xz = sum_of(xz), sum.yz = sum_of(yz);
    for (uint32_t v : t) add(attribute_quadrics_[v], sum);
  }
}

// The corner at p of the triangle in which q comes before p, or kNone.
uint32_t EdgeCollapser::corner_before(uint32_t p, uint32_t q) const {
  const auto link = ring(p);
  for (size_t i = 0; i < link.size(); ++i)
    if (link[i].prev == q) return corner(p, i);
  return kNone;
}

float EdgeCollapser::attribute_cost(uint32_t from, uint32_t to, const Vec3& d) const {
  const Quadric& q = attribute_quadrics_[from];
  const float *a = values_of(from), *b = values_of(to), *g = gradients_of(from);
  const Float4 dx = Float4::all(d.x), dy = Float4::all(d.y), dz = Float4::all(d.z);
  Float4 products = Float4::all(0.0f), squares = products;
  for (uint32_t k = 0; k < stride_; k += 4) {
    const Float4 difference = Float4::load(b + k) - Float4::load(a + k);
    const float* at = g + k;
    const Float4 mean = Float4::load(at) * dx + Float4::load(at + stride_) * dy +
                        Float4::load(at + 2 * stride_) * dz + Float4::load(at + 3 * stride_);
    products = products + difference * mean;
    squares = squares + difference * difference;
  }
  const float sum = sum_of(Float4::all(q.weight) * squares - Float4::all(2.0f) * products);
  return std::max(value_at(q, d) + sum, 0.0f);
}

// The sum of squared differences is least where its derivative by the value is 0.
bool EdgeCollapser::refit(uint32_t vertex, std::span<float> values) const {
  const uint32_t p = input_.position_of[vertex];
  const float weight = attribute_count_ > 0 ? attribute_quadrics_[vertex].weight : 0.0f;
  if (kinds_[p] != Kind::kInterior || wedge_counts_[p] != 1 || drifts_[p] == 0.0f ||
      !(weight > 0.0f))
    return false;
  bool moved = false;
  for (uint32_t k = 0; k < attribute_count_; ++k) {
    const float unit = input_.attribute_weights[k];
    const float difference = gradients_of(vertex)[3 * stride_ + k] / (weight * unit);
    if (!std::isfinite(difference) || difference == 0.0f) continue;
    values[k] += difference;
    moved = true;
  }
  return moved;
}

EdgeCollapser::Choice EdgeCollapser::position_choice(uint32_t p, uint32_t target) const {
  const Vec3 d = point(target) - point(p);
  const Quadric& q = quadrics_[p];
  const float sum = std::max(value_at(q, d), 0.0f);
  return {(sum + kShape * q.weight * dot(d, d)) * q.scale, target};
}

// As position_choice for all targets, four at once.
EdgeCollapser::Choice EdgeCollapser::cheapest_position(uint32_t p) const {
  const RanksOfMoves ranks_of(quadrics_[p], &points_[p].x);
  const auto link = ring(p);
  Choice best{std::numeric_limits<float>::infinity(), kNone};
  for (size_t begin = 0; begin < link.size(); begin += 4) {
    std::array<uint32_t, 4> targets;
    for (size_t i = 0; i < 4; ++i) targets[i] = link[std::min(begin + i, link.size() - 1)].next;
    const std::array<float, 4> ranks = ranks_of([&](size_t i) { return &points_[targets[i]].x; });
    for (size_t i = 0; i < 4; ++i)
      if (ranks[i] < best.rank) best = {ranks[i], targets[i]};
  }
  return best;
}

EdgeCollapser::Choice EdgeCollapser::choice(uint32_t p, const Move& move) {
  const uint32_t target = move.target;
  const bool several = has_wedges_ && wedge_counts_[p] > 1;
  if (several && !map_wedges(p, target)) return {std::numeric_limits<float>::infinity(), target};
  if (attribute_count_ == 0) return {move.least, target};
  const Vec3 d = point(target) - point(p);
  const uint32_t c = move.corner;
  const float sum = several ? wedge_cost(d)
                            : attribute_cost(vertex(c), vertex(move.after ? next(c) : prev(c)), d);
  return {move.least + sum * quadrics_[p].weight * quadrics_[p].scale, target};
}

// Of all positions that p may move to; attributes only add to what positions cost.
EdgeCollapser::Choice EdgeCollapser::cheapest(uint32_t p) {
  moves_.clear();
  for_each_target(p, [&](uint32_t c, uint32_t target, bool after) {
    moves_.push_back({0.0f, target, c, after});
  });
  const RanksOfMoves ranks_of(quadrics_[p], &points_[p].x);
  size_t first = 0;
  for (size_t begin = 0; begin < moves_.size(); begin += 4) {
    const auto at = [&](size_t i) { return std::min(begin + i, moves_.size() - 1); };
    const std::array<float, 4> ranks =
        ranks_of([&](size_t i) { return &points_[moves_[at(i)].target].x; });
    for (size_t i = begin; i < std::min(begin + 4, moves_.size()); ++i) {
      moves_[i].least = ranks[i - begin];
      if (moves_[i].least < moves_[first].least) first = i;
    }
  }
  if (!moves_.empty()) std::swap(moves_[0], moves_[first]);
  Choice best{std::numeric_limits<float>::infinity(), kNone};
  for (const Move& move : moves_) {
    if (!(move.least < best.rank)) continue;
    const Choice candidate = choice(p, move);
    if (candidate.rank < best.rank) best = candidate;
  }
  return best;
}

// The squared distance that a legal collapse adds to the error.
float EdgeCollapser::cost_of(uint32_t p, uint32_t target) const {
  const Vec3 d = point(target) - point(p);
  const float drift = drifts_[p] + length(d), weight = quadrics_[p].weight;
  if (!(weight > 0.0f)) return 0.0f;
  return std::min(std::max(value_at(quadrics_[p], d), 0.0f) / weight, drift * drift);
}

// Adds p's to the target's, and what the collapse costs to the error.
void EdgeCollapser::merge_quadrics(uint32_t p, uint32_t target) {
  const Vec3 d = point(target) - point(p);
  const bool merges = kinds_[target] != Kind::kFixed;
  const float value = std::max(value_at(quadrics_[p], d), 0.0f);
  float attributes = 0.0f;
  if (attribute_count_ > 0) {
    if (!has_wedges_) wedge_map_.assign({{p, target, true}});
    attributes = wedge_cost(d);
    if (merges)
      for (const WedgeMove& move : wedge_map_) merge_attributes(move.from, move.to, d);
  }
  // A point of the surface moves no farther than the vertices of its triangle.
  const float drift = drifts_[p] + length(d), weight = quadrics_[p].weight;
  drifts_[target] = std::max(drifts_[target], drift);
  if (weight > 0.0f) {
    worst_ = std::max(worst_, std::min(value / weight, drift * drift));
    worst_attributes_ =
        std::max(worst_attributes_, std::min(kToldAttributes * attributes, drift * drift));
  }
  if (!merges) return;
  add_moved(quadrics_[target], quadrics_[p], d, value);
  settle_scale(target);
}

void EdgeCollapser::merge_attributes(uint32_t from, uint32_t to, const Vec3& d) {
  const uint32_t n = attribute_count_;
  const Quadric& q = attribute_quadrics_[from];
  Quadric& sum = attribute_quadrics_[to];
  add_moved(sum, q, d, attribute_cost(from, to, d));
  const float *a = values_of(from), *b = values_of(to), *g = gradients_of(from);
  float* out = gradients_of(to);
  for (uint32_t k = 0; k < n; ++k) {
    const float difference = b[k] - a[k];
    const float x = g[k], y = g[stride_ + k], z = g[2 * stride_ + k], mean = g[3 * stride_ + k];
    sum.x -= difference * x, sum.y -= difference * y, sum.z -= difference * z;
    out[k] += x, out[stride_ + k] += y, out[2 * stride_ + k] += z;
    out[3 * stride_ + k] += mean + x * d.x + y * d.y + z * d.z - q.weight * difference;
  }
}

}  // namespace umbel::lod
