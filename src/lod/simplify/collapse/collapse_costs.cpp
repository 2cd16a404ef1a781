#include "lod/simplify/collapse/collapse_costs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "base/math.hpp"
#include "base/simd/float4.hpp"

namespace umbel::lod {
namespace {

// Boundaries of the mesh and seams of attributes are held by planes that stand on them.
constexpr float kBorderWeight = 3.0f, kSeamWeight = 1.0f;
// Of what attributes lose, squared, in the error: their whole cost decides on the order only.
constexpr float kAttributesInError = 0.0625f;

using Kind = CollapseMesh::Kind;

// Ranks of moves of one position, without attributes.
class RanksOfMoves {
 public:
  RanksOfMoves(const Quadric& q, const float* from)
      : xx_(splat(q.xx)),
        yy_(splat(q.yy)),
        zz_(splat(q.zz)),
        xy_(splat(q.xy)),
        xz_(splat(q.xz)),
        yz_(splat(q.yz)),
        x2_(splat(2.0f * q.x)),
        y2_(splat(2.0f * q.y)),
        z2_(splat(2.0f * q.z)),
        c_(splat(q.c)),
        shape_(splat(CollapseCosts::kShape * q.weight)),
        scale_(splat(q.scale)),
        from_(load4(from)) {}

  // To the four points where `to(i)` points.
  template <typename To>
  std::array<float, 4> operator()(const To& to) const {
    Float4 dx = load4(to(0)) - from_, dy = load4(to(1)) - from_;
    Float4 dz = load4(to(2)) - from_, d3 = load4(to(3)) - from_;
    transpose(dx, dy, dz, d3);
    const Float4 mx = xx_ * dx + xy_ * dy + xz_ * dz, my = xy_ * dx + yy_ * dy + yz_ * dz;
    const Float4 mz = xz_ * dx + yz_ * dy + zz_ * dz;
    const Float4 value = c_ + (mx + x2_) * dx + (my + y2_) * dy + (mz + z2_) * dz;
    // In this order max keeps what is not a number, which then is never the least.
    const Float4 sum = max4(splat(0.0f), value);
    std::array<float, 4> ranks;
    store4(ranks.data(), (sum + shape_ * (dx * dx + dy * dy + dz * dz)) * scale_);
    return ranks;
  }

 private:
  Float4 xx_, yy_, zz_, xy_, xz_, yz_, x2_, y2_, z2_, c_, shape_, scale_, from_;
};

}  // namespace

void CollapseCosts::build() {
  const size_t count = mesh_.position_count();
  area_ = 0.0;
  largest_ = largest_of_attributes_ = largest_attribute_loss_ = 0.0f;
  displacements_.assign(count, 0.0f);
  slots_.resize(count);
  next_slots_.resize(count);
  quadrics_.assign(count, Quadric{});
  for (size_t t = 0; t < mesh_.input().triangles.size(); t += 4) add_planes(t);
  for (uint32_t p = 0; p < count; ++p) {
    if (!mesh_.is_fixed(p) && (mesh_.kind(p) != Kind::kInterior || mesh_.has_wedges(p)))
      add_boundary_quadrics(p);
    quadrics_[p].scale = scale_of(quadrics_[p].weight);
  }
}

// Of four triangles at once, by their areas: as add_plane with the normal of the length 1.
void CollapseCosts::add_planes(size_t first) {
  const auto& triangles = mesh_.input().triangles;
  const size_t count = std::min<size_t>(4, triangles.size() - first);
  std::array<Triangle, 4> four;
  for (size_t i = 0; i < 4; ++i)
    four[i] = mesh_.positions_of(triangles[first + std::min(i, count - 1)]);
  const auto corner = [&](size_t k) {
    const auto at = [&](size_t i) { return load4(mesh_.coordinates(four[i][k])); };
    std::array p{at(0), at(1), at(2), at(3)};
    transpose(p[0], p[1], p[2], p[3]);
    return p;
  };
  const auto a = corner(0), b = corner(1), c = corner(2);
  const Float4 ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
  const Float4 vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
  const Float4 x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
  std::array<float, 4> sizes, factors;
  store4(sizes.data(), x * x + y * y + z * z);
  for (size_t i = 0; i < 4; ++i) {
    const float size = std::sqrt(sizes[i]);
    sizes[i] = 0.5f * size;
    factors[i] = size > 0.0f ? 0.5f / size : 0.0f;
    area_ += i < count ? double{sizes[i]} : 0.0;
  }
  const Float4 factor = load4(factors.data());
  const Float4 fx = x * factor, fy = y * factor;
  std::array low{fx * x, fy * y, z * factor * z, fx * y};
  std::array high{fx * z, fy * z, load4(sizes.data()), splat(0.0f)};
  transpose(low[0], low[1], low[2], low[3]);
  transpose(high[0], high[1], high[2], high[3]);
  // All else in the quadric of a plane through its origin is 0.
  Quadric* const quadrics = quadrics_.data();
  for (size_t i = 0; i < count; ++i)
    for (uint32_t v : four[i]) {
      Quadric& q = quadrics[v];
      store4(&q.xx, load4(&q.xx) + low[i]);
      store4(&q.xz, load4(&q.xz) + high[i]);
    }
}

float CollapseCosts::scale_of(float weight) {
  return weight > 0.0f ? 1.0f / std::sqrt(weight) : 0.0f;
}

void CollapseCosts::add_boundary_quadrics(uint32_t p) {
  const auto add = [&](uint32_t corner, uint32_t other, float weight) {
    const Triangle q = mesh_.positions_of(corner / 3);
    const Vec3 n =
        cross(mesh_.point(q[1]) - mesh_.point(q[0]), mesh_.point(q[2]) - mesh_.point(q[0]));
    const Vec3 edge = mesh_.point(other) - mesh_.point(p);
    const Vec3 m = cross(edge, n);
    const float size = length(m);
    if (!(size > 0.0f)) return;
    const float weighted = weight * dot(edge, edge);
    add_plane(quadrics_[p], m * (1.0f / size), weighted);
    quadrics_[p].weight += weighted;
  };
  const auto link = mesh_.link(p);
  const auto& position_of = mesh_.input().position_of;
  // Around a manifold position each neighbour comes next once at most, and before once.
  const bool is_manifold = mesh_.kind(p) != Kind::kNonManifold;
  if (is_manifold) find_slots(p);
  const auto corner_before = [&](uint32_t x) {
    if (is_manifold) return is_before(p, x) ? mesh_.corner(p, slots_[x]) : kNone;
    for (size_t i = 0; i < link.size(); ++i)
      if (link[i].prev == x) return mesh_.corner(p, i);
    return kNone;
  };
  const auto count = [&](uint32_t x, uint32_t LinkEdge::* side) {
    return std::count_if(link.begin(), link.end(), [&](const LinkEdge& e) { return e.*side == x; });
  };
  for (size_t i = 0; i < link.size(); ++i) {
    const auto [n, q] = link[i];
    const uint32_t c = mesh_.corner(p, i);
    if (is_manifold ? !is_next(p, q) : count(q, &LinkEdge::next) != count(q, &LinkEdge::prev))
      add(c, q, kBorderWeight);
    const auto after = is_manifold ? 1 : count(n, &LinkEdge::next);
    const auto before = is_manifold ? is_before(p, n) : count(n, &LinkEdge::prev);
    if (after != before) {
      add(c, n, kBorderWeight);
    } else if (after == 1) {
      const uint32_t opposite = corner_before(n);
      const uint32_t here = mesh_.vertex(opposite);
      const uint32_t there = mesh_.vertex(previous_corner(opposite));
      if (!mesh_.same_material(here, mesh_.vertex(c)) ||
          position_of[mesh_.vertex(next_corner(opposite))] == q) {
        add(c, n, kBorderWeight);
      } else if (mesh_.rule(p) != SeamRule::kIgnore &&
                 (here != mesh_.vertex(c) || there != mesh_.vertex(next_corner(c)))) {
        add(c, n, kSeamWeight);
        add(opposite, n, kSeamWeight);
      }
    }
  }
}

// Of a manifold position, whose neighbours each come before it in one triangle at most, and after
// it too.
void CollapseCosts::find_slots(uint32_t p) {
  const auto link = mesh_.link(p);
  for (uint32_t i = 0; i < link.size(); ++i) {
    slots_[link[i].prev] = i;
    next_slots_[link[i].next] = i;
  }
}

CollapseCosts::Choice CollapseCosts::cheapest(uint32_t p) {
  return attributes_.is_empty() && mesh_.kind(p) == Kind::kInterior ? cheapest_position(p)
                                                                    : cheapest_with_attributes(p);
}

// As rank_of_position for all targets, four at once.
CollapseCosts::Choice CollapseCosts::cheapest_position(uint32_t p) const {
  const RanksOfMoves ranks_of(quadrics_[p], mesh_.coordinates(p));
  const auto link = mesh_.link(p);
  Choice best{std::numeric_limits<float>::infinity(), kNone};
  for (size_t begin = 0; begin < link.size(); begin += 4) {
    std::array<uint32_t, 4> targets;
    for (size_t i = 0; i < 4; ++i) targets[i] = link[std::min(begin + i, link.size() - 1)].next;
    const std::array<float, 4> ranks =
        ranks_of([&](size_t i) { return mesh_.coordinates(targets[i]); });
    for (size_t i = 0; i < 4; ++i)
      if (ranks[i] < best.rank) best = {ranks[i], targets[i]};
  }
  return best;
}

CollapseCosts::Choice CollapseCosts::choice(uint32_t p, const Move& move) {
  const uint32_t target = move.target, c = move.corner;
  const bool several = mesh_.has_wedges(p);
  if (several && !wedges_.find(p, target)) return {std::numeric_limits<float>::infinity(), target};
  if (attributes_.is_empty()) return {move.rank, target};
  if (several) return {move.rank + rank_of_wedges(p, target), target};
  const uint32_t to = mesh_.vertex(move.after ? next_corner(c) : previous_corner(c));
  const Vec3 d = mesh_.point(target) - mesh_.point(p);
  const float sum = attributes_.cost(mesh_.vertex(c), to, d);
  return {move.rank + sum * quadrics_[p].weight * quadrics_[p].scale, target};
}

// Attributes only add to what positions cost.
CollapseCosts::Choice CollapseCosts::cheapest_with_attributes(uint32_t p) {
  list_moves(p);
  if (moves_.empty()) return {std::numeric_limits<float>::infinity(), kNone};
  Move* const moves = moves_.data();
  const size_t count = moves_.size();
  const RanksOfMoves ranks_of(quadrics_[p], mesh_.coordinates(p));
  size_t first = 0;
  for (size_t begin = 0; begin < count; begin += 4) {
    const auto at = [&](size_t i) { return std::min(begin + i, count - 1); };
    const std::array<float, 4> ranks =
        ranks_of([&](size_t i) { return mesh_.coordinates(moves[at(i)].target); });
    for (size_t i = begin; i < std::min(begin + 4, count); ++i) {
      moves[i].rank = ranks[i - begin];
      if (moves[i].rank < moves[first].rank) first = i;
    }
  }
  std::swap(moves[0], moves[first]);
  if (mesh_.has_wedges(p)) keep_cheapest_moves(mesh_.wedges(p).size());
  if (attributes_.is_empty()) return cheapest_of_moves(p);
  if (!mesh_.has_wedges(p)) return cheapest_of_smooth_moves(p);
  return mesh_.kind(p) == Kind::kInterior ? cheapest_of_wedges(p) : cheapest_of_moves(p);
}

void CollapseCosts::list_moves(uint32_t p) {
  const auto link = mesh_.link(p);
  Move* const room = room_for_moves(2 * link.size());
  size_t count = 0;
  if (mesh_.kind(p) == Kind::kInterior) {
    for (; count < link.size(); ++count)
      room[count] = {0.0f, link[count].next, mesh_.corner(p, count), true};
  } else {
    mesh_.for_each_target(p, [&](uint32_t c, uint32_t target, bool after) {
      room[count++] = {0.0f, target, c, after};
    });
  }
  moves_ = {room, count};
}

CollapseCosts::Move* CollapseCosts::room_for_moves(size_t most) {
  if (room_.size() < most) room_.resize(2 * most);
  return room_.data();
}

// The apex of a cone has one vertex for each triangle, and every move looks at all of them. Where
// that would be too much work, only the moves that cost least without attributes are kept.
void CollapseCosts::keep_cheapest_moves(size_t wedges) {
  constexpr size_t kMostWedges = 4096;  // of all moves
  const size_t most = std::max<size_t>(kMostWedges / wedges, 1);
  if (moves_.size() <= most) return;
  const auto key = [](const Move& move) {
    constexpr float kLast = std::numeric_limits<float>::infinity();
    return std::tuple(move.rank < kLast ? move.rank : kLast, move.target, move.corner, move.after);
  };
  std::partial_sort(moves_.begin(), moves_.begin() + static_cast<std::ptrdiff_t>(most),
                    moves_.end(), [&](const Move& a, const Move& b) { return key(a) < key(b); });
  moves_ = moves_.first(most);
}

CollapseCosts::Choice CollapseCosts::cheapest_of_moves(uint32_t p) {
  Choice best{std::numeric_limits<float>::infinity(), kNone};
  for (const Move& move : moves_) {
    if (!(move.rank < best.rank)) continue;
    const Choice candidate = choice(p, move);
    if (candidate.rank < best.rank) best = candidate;
  }
  return best;
}

// The same where p has several vertices inside the surface. Both triangles at each edge are known,
// and a move is left as soon as some of its vertices cost too much.
CollapseCosts::Choice CollapseCosts::cheapest_of_wedges(uint32_t p) {
  const auto link = mesh_.link(p);
  for (uint32_t i = 0; i < link.size(); ++i) slots_[link[i].prev] = i;
  const float factor = quadrics_[p].weight * quadrics_[p].scale;
  Choice best{std::numeric_limits<float>::infinity(), kNone};
  for (const Move& move : moves_) {
    if (!(move.rank < best.rank)) continue;
    const auto is_too_high = [&](float sum) { return !(move.rank + sum * factor < best.rank); };
    const uint32_t other = mesh_.corner(p, slots_[move.target]);
    const float sum = wedges_.cost_of(p, move.target, move.corner, other, is_too_high);
    const float rank = move.rank + sum * factor;
    if (rank < best.rank) best = {rank, move.target};
  }
  return best;
}

// The same where p has one vertex, for four at once.
CollapseCosts::Choice CollapseCosts::cheapest_of_smooth_moves(uint32_t p) const {
  const uint32_t from = mesh_.vertex(moves_[0].corner);
  const Float4 point = load4(mesh_.coordinates(p));
  const Float4 factor = splat(quadrics_[p].weight * quadrics_[p].scale);
  Choice best{std::numeric_limits<float>::infinity(), kNone};
  for (size_t begin = 0; begin < moves_.size(); begin += 4) {
    const size_t count = std::min<size_t>(4, moves_.size() - begin);
    const Move* const moves = &moves_[begin];
    if (std::none_of(moves, moves + count, [&](const Move& m) { return m.rank < best.rank; }))
      continue;
    std::array<uint32_t, 4> to;
    std::array<Float4, 4> d;
    for (size_t i = 0; i < 4; ++i) {
      const Move& move = moves[std::min(i, count - 1)];
      to[i] = mesh_.vertex(move.after ? next_corner(move.corner) : previous_corner(move.corner));
      d[i] = load4(mesh_.coordinates(move.target)) - point;
    }
    transpose(d[0], d[1], d[2], d[3]);
    std::array<float, 4> ranks;
    store4(ranks.data(), attributes_.costs(from, to, d[0], d[1], d[2]) * factor);
    for (size_t i = 0; i < count; ++i)
      if (moves[i].rank + ranks[i] < best.rank) best = {moves[i].rank + ranks[i], moves[i].target};
  }
  return best;
}

float CollapseCosts::squared_attribute_error(uint32_t p, uint32_t target) {
  if (attributes_.is_empty()) return 0.0f;
  const WedgeMap::Move whole{p, target, true};
  if (!mesh_.has_wedges()) wedges_.set({&whole, 1});
  return kAttributesInError * wedges_.cost(mesh_.point(target) - mesh_.point(p));
}

void CollapseCosts::merge(uint32_t p, uint32_t target) {
  const Vec3 d = mesh_.point(target) - mesh_.point(p);
  const bool merges = !mesh_.is_fixed(target);
  const float value = std::max(value_at(quadrics_[p], d), 0.0f);
  const float attributes = squared_attribute_error(p, target);
  if (merges && !attributes_.is_empty()) wedges_.merge(d, attributes_);
  const float moved = displacements_[p] + length(d), weight = quadrics_[p].weight;
  displacements_[target] = std::max(displacements_[target], moved);
  if (weight > 0.0f) {
    largest_ = std::max(largest_, std::min(value / weight, moved * moved));
    largest_of_attributes_ = std::max(largest_of_attributes_, std::min(attributes, moved * moved));
    largest_attribute_loss_ = std::max(largest_attribute_loss_, attributes);
  }
  if (!merges) return;
  add_moved(quadrics_[target], quadrics_[p], d, value);
  quadrics_[target].scale = scale_of(quadrics_[target].weight);
}

}  // namespace umbel::lod
