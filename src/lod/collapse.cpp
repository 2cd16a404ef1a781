#include "lod/collapse.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/math.hpp"

namespace umbel::lod {
namespace {

// Where the surface is flat, all collapses cost nothing: short edges go first.
constexpr float kShape = 1e-4f;
// A rim (border of the mesh, seam of attributes) is held by planes that stand on it.
constexpr float kBorderWeight = 10.0f, kSeamWeight = 1.0f;
// The cosine by which a triangle may turn in one collapse.
constexpr double kLeastCosine = 0.25;

template <typename Quadric>
void add_plane(Quadric& q, const Vec3& n, float weight) {
  q.xx += weight * n.x * n.x;
  q.yy += weight * n.y * n.y;
  q.zz += weight * n.z * n.z;
  q.xy += weight * n.x * n.y;
  q.xz += weight * n.x * n.z;
  q.yz += weight * n.y * n.z;
}

template <typename Quadric>
Vec3 times(const Quadric& q, const Vec3& d) {
  return {q.xx * d.x + q.xy * d.y + q.xz * d.z, q.xy * d.x + q.yy * d.y + q.yz * d.z,
          q.xz * d.x + q.yz * d.y + q.zz * d.z};
}

template <typename Quadric>
inline float value_at(const Quadric& q, const Vec3& d) {
  const Vec3 m = times(q, d);
  return q.c + (m.x + 2.0f * q.x) * d.x + (m.y + 2.0f * q.y) * d.y + (m.z + 2.0f * q.z) * d.z;
}

// Adds `q`, whose origin becomes the point `d` away, where its value is `value`.
template <typename Quadric>
void add_moved(Quadric& sum, const Quadric& q, const Vec3& d, float value) {
  const Vec3 m = times(q, d);
  sum.xx += q.xx, sum.yy += q.yy, sum.zz += q.zz;
  sum.xy += q.xy, sum.xz += q.xz, sum.yz += q.yz;
  sum.x += q.x + m.x, sum.y += q.y + m.y, sum.z += q.z + m.z;
  sum.c += value;
  sum.weight += q.weight;
}

}  // namespace

float EdgeCollapser::error() const { return std::sqrt(worst_); }

void EdgeCollapser::run(const CollapseInput& input, size_t target) {
  load(input);
  build_rings();
  find_kinds();
  build_quadrics();
  build_attribute_quadrics();
  queue_.reset(points_.size());
  for (uint32_t p = 0; p < points_.size(); ++p)
    if (kinds_[p] != Kind::kFixed) enqueue_best(p);
  while (live_ > target && !queue_.empty()) {
    const uint32_t p = queue_.pop();
    if (std::exchange(stale_[p], 0)) {
      enqueue_best(p);
      continue;
    }
    const Choice choice = choices_[p];
    if (is_legal(p, choice.target)) {
      note_error(p, choice);
      collapse(p, choice.target);
    } else {
      enqueue_best_legal(p);
    }
  }
  result_.clear();
  for (uint32_t t = 0; t < dead_.size(); ++t)
    if (!dead_[t]) {
      const uint32_t* v = &vertices()[size_t{4} * t];
      result_.push_back({v[0], v[1], v[2]});
    }
}

// A point of the surface moves no farther than the vertices of its triangle.
void EdgeCollapser::note_error(uint32_t p, const Choice& choice) {
  const float drift = drifts_[p] + length(points_[choice.target] - points_[p]);
  drifts_[choice.target] = std::max(drifts_[choice.target], drift);
  const float weight = quadrics_[p].weight;
  if (weight > 0.0f) worst_ = std::max(worst_, std::min(choice.cost / weight, drift * drift));
}

void EdgeCollapser::load(const CollapseInput& input) {
  input_ = input;
  has_wedges_ = input.locked.size() != input.position_of.size();
  attribute_count_ = static_cast<uint32_t>(input.attribute_weights.size());
  worst_ = 0.0f;
  chords_.clear();
  live_ = input.triangles.size();
  dead_.assign(live_, 0);
  points_.resize(input.locked.size());
  for (size_t v = 0; v < input.position_of.size(); ++v)
    points_[input.position_of[v]] = input.positions[v];
  corner_position_.resize(4 * live_);
  if (has_wedges_) corner_vertex_.resize(4 * live_);
  wedge_counts_.assign(points_.size(), 0);
  wedge_seen_.assign(has_wedges_ ? input.position_of.size() : 0, 0);
  for (size_t t = 0; t < live_; ++t)
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t v = input.triangles[t][k], p = input.position_of[v];
      corner_position_[4 * t + k] = p;
      if (!has_wedges_) continue;
      corner_vertex_[4 * t + k] = v;
      if (!std::exchange(wedge_seen_[v], 1) && wedge_counts_[p] < 3) ++wedge_counts_[p];
    }
  choices_.resize(points_.size());
  stale_.assign(points_.size(), 0);
  drifts_.assign(points_.size(), 0.0f);
  marks_.assign(points_.size(), 0);
  stamp_ = 0;
}

void EdgeCollapser::build_rings() {
  ring_of_.assign(points_.size(), {0, 0});
  for (size_t t = 0; t < live_; ++t)
    for (size_t k = 0; k < 3; ++k) ++ring_of_[corner_position_[4 * t + k]].count;
  uint32_t offset = 0;
  for (Ring& r : ring_of_) {
    r.offset = offset;
    offset += std::exchange(r.count, 0);
  }
  rings_.resize(offset);
  for (uint32_t t = 0; t < live_; ++t)
    for (uint32_t k = 0; k < 3; ++k) {
      Ring& r = ring_of_[corner_position_[4 * t + k]];
      rings_[r.offset + r.count++] = 4 * t + k;
    }
}

void EdgeCollapser::find_kinds() {
  kinds_.resize(points_.size());
  slots_.resize(points_.size());
  for (uint32_t p = 0; p < points_.size(); ++p)
    kinds_[p] = input_.locked[p] ? Kind::kFixed : kind_of(p);
}

// Interior: its triangles form one closed fan. Border: one open fan. Anything else stays.
EdgeCollapser::Kind EdgeCollapser::kind_of(uint32_t p) {
  const auto corners = ring(p);
  if (corners.empty() || wedge_counts_[p] > 2) return Kind::kFixed;
  const uint32_t is_next = ++stamp_;
  for (uint32_t c : corners) {
    const uint32_t n = corner_position_[next(c)];
    if (marks_[n] == is_next) return Kind::kFixed;
    marks_[n] = is_next;
    slots_[n] = c;
  }
  // The fan turns from each triangle to the one that begins where this one ends.
  uint32_t first = corners[0], ends = 0;
  for (uint32_t c : corners)
    if (marks_[corner_position_[prev(c)]] != is_next) ++ends;
  if (ends > 1) return Kind::kFixed;
  if (ends == 1) {
    const uint32_t is_prev = ++stamp_;
    for (uint32_t c : corners) marks_[corner_position_[prev(c)]] = is_prev;
    for (uint32_t c : corners)
      if (marks_[corner_position_[next(c)]] != is_prev) first = c;
    const uint32_t again = ++stamp_;
    for (uint32_t c : corners) marks_[corner_position_[next(c)]] = again;
  }
  const uint32_t known = stamp_;
  size_t steps = 1;
  for (uint32_t c = first; steps <= corners.size(); ++steps) {
    const uint32_t q = corner_position_[prev(c)];
    if (marks_[q] != known) break;
    c = slots_[q];
    if (c == first) break;
  }
  if (steps != corners.size()) return Kind::kFixed;
  if (ends == 0) return Kind::kInterior;
  return wedge_counts_[p] > 1 ? Kind::kFixed : Kind::kBorder;
}

void EdgeCollapser::build_quadrics() {
  quadrics_.assign(points_.size(), Quadric{});
  for (size_t t = 0; t < live_; ++t) {
    const uint32_t* p = &corner_position_[4 * t];
    const Vec3 n = cross(points_[p[1]] - points_[p[0]], points_[p[2]] - points_[p[0]]);
    const float size = length(n);
    if (!(size > 0.0f)) continue;
    for (int k = 0; k < 3; ++k) {
      add_plane(quadrics_[p[k]], n, 0.5f / size);
      quadrics_[p[k]].weight += 0.5f * size;
    }
  }
  scales_.resize(points_.size());
  for (uint32_t p = 0; p < points_.size(); ++p) settle_scale(p);
  for (uint32_t p = 0; p < points_.size(); ++p)
    if (kinds_[p] == Kind::kBorder || (kinds_[p] == Kind::kInterior && wedge_counts_[p] > 1))
      add_rim_quadrics(p);
}

// Between the integral of the squared distance, which keeps means low but lets small details go by
// any distance, and its mean, which keeps the largest distance low.
void EdgeCollapser::settle_scale(uint32_t p) {
  const float weight = quadrics_[p].weight;
  scales_[p] = weight > 0.0f ? 1.0f / std::sqrt(weight) : 0.0f;
}

void EdgeCollapser::add_rim_quadrics(uint32_t p) {
  const auto add = [&](uint32_t corner, uint32_t other, float weight) {
    const uint32_t* q = &corner_position_[corner & ~3u];
    const Vec3 n = cross(points_[q[1]] - points_[q[0]], points_[q[2]] - points_[q[0]]);
    const Vec3 edge = points_[other] - points_[p];
    const Vec3 m = cross(edge, n);
    const float size = length(m);
    if (size > 0.0f) add_plane(quadrics_[p], m * (1.0f / size), weight * dot(edge, edge));
  };
  for_each_target(p, [&](uint32_t c, uint32_t q, bool) {
    if (kinds_[p] == Kind::kBorder) {
      add(c, q, kBorderWeight);
    } else {
      const uint32_t opposite = corner_before(p, q);
      if (opposite != kNone && vertices()[opposite] != vertices()[c]) {
        add(c, q, kSeamWeight);
        add(opposite, q, kSeamWeight);
      }
    }
  });
}

// Within a triangle an attribute is a linear function of the point; its quadric is the squared
// difference from that.
void EdgeCollapser::build_attribute_quadrics() {
  const uint32_t n = attribute_count_;
  if (n == 0) return;
  const size_t count = input_.position_of.size();
  Aabb box;
  for (const Vec3& p : points_) extend(box, p);
  const Vec3 d = box.max - box.min;
  const float extent = std::max({d.x, d.y, d.z});
  values_.resize(count * n);
  for (size_t i = 0; i < values_.size(); ++i)
    values_[i] = input_.attributes[i] * input_.attribute_weights[i % n] * extent;
  attribute_quadrics_.assign(count, Quadric{});
  gradients_.assign(4 * count * n, 0.0f);
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
    Quadric sum{};
    for (uint32_t k = 0; k < n; ++k) {
      const float s0 = values_[size_t{t[0]} * n + k];
      const float s1 = values_[size_t{t[1]} * n + k] - s0, s2 = values_[size_t{t[2]} * n + k] - s0;
      const Vec3 g = gu * s1 + gv * s2;
      add_plane(sum, g, area);
      for (uint32_t v : t) {
        float* out = &gradients_[4 * (size_t{v} * n + k)];
        out[0] += area * g.x, out[1] += area * g.y, out[2] += area * g.z;
      }
    }
    for (uint32_t v : t) add_moved(attribute_quadrics_[v], sum, Vec3{0, 0, 0}, 0.0f);
  }
}

// The corner at p of the triangle in which q comes before p, or kNone.
uint32_t EdgeCollapser::corner_before(uint32_t p, uint32_t q) const {
  for (uint32_t c : ring(p))
    if (corner_position_[prev(c)] == q) return c;
  return kNone;
}

// Calls visit(corner at p, target, whether the target comes after p there) for the neighbours
// that p may move to: all from the interior, along the border from there.
template <typename Visit>
void EdgeCollapser::for_each_target(uint32_t p, const Visit& visit) const {
  const auto corners = ring(p);
  if (kinds_[p] == Kind::kInterior) {
    for (uint32_t c : corners) visit(c, corner_position_[next(c)], true);
    return;
  }
  for (uint32_t c : corners) {
    const uint32_t n = corner_position_[next(c)], q = corner_position_[prev(c)];
    const auto has = [&](uint32_t other, bool after) {
      return std::any_of(corners.begin(), corners.end(), [&](uint32_t o) {
        return corner_position_[after ? next(o) : prev(o)] == other;
      });
    };
    if (!has(n, false)) visit(c, n, true);
    if (!has(q, true)) visit(c, q, false);
  }
}

float EdgeCollapser::attribute_cost(uint32_t from, uint32_t to, const Vec3& d) const {
  const uint32_t n = attribute_count_;
  const Quadric& q = attribute_quadrics_[from];
  const float* a = &values_[size_t{from} * n];
  const float* b = &values_[size_t{to} * n];
  const float* g = &gradients_[4 * size_t{from} * n];
  float cost = value_at(q, d), squares = 0.0f;
  for (uint32_t k = 0; k < n; ++k, g += 4) {
    const float difference = b[k] - a[k];
    cost -= 2.0f * difference * (g[0] * d.x + g[1] * d.y + g[2] * d.z + g[3]);
    squares += difference * difference;
  }
  return cost + q.weight * squares;
}

inline EdgeCollapser::Choice EdgeCollapser::position_cost(uint32_t p, uint32_t target) const {
  const Vec3 d = points_[target] - points_[p];
  const Quadric& q = quadrics_[p];
  const float sum = std::max(value_at(q, d), 0.0f);
  return {(sum + kShape * q.weight * dot(d, d)) * scales_[p], sum, target};
}

EdgeCollapser::Choice EdgeCollapser::cost(uint32_t p, uint32_t corner, uint32_t target,
                                          bool after) const {
  Choice choice = position_cost(p, target);
  if (attribute_count_ == 0) return choice;
  // No attribute looks worse than a surface that is off by the length of the edge.
  const Vec3 d = points_[target] - points_[p];
  const auto add = [&](uint32_t from, uint32_t to) {
    const float most = attribute_quadrics_[from].weight * dot(d, d);
    const float more = std::clamp(attribute_cost(from, to, d), 0.0f, most);
    choice.cost += more;
    choice.rank += more * scales_[p];
  };
  add(vertices()[corner], vertices()[after ? next(corner) : prev(corner)]);
  if (has_wedges_ && wedge_counts_[p] > 1) {
    const uint32_t other = corner_before(p, target);
    if (other != kNone) add(vertices()[other], vertices()[prev(other)]);
  }
  return choice;
}

void EdgeCollapser::enqueue_best(uint32_t p) {
  Choice best{std::numeric_limits<float>::infinity(), 0.0f, kNone};
  for_each_target(p, [&](uint32_t c, uint32_t target, bool after) {
    const Choice choice = cost(p, c, target, after);
    if (choice.rank < best.rank) best = choice;
  });
  if (best.target != kNone)
    choose(p, best);
  else
    queue_.remove(p);
}

// Once the best is found illegal.
void EdgeCollapser::enqueue_best_legal(uint32_t p) {
  candidates_.clear();
  for_each_target(p, [&](uint32_t c, uint32_t target, bool after) {
    candidates_.push_back(cost(p, c, target, after));
  });
  std::sort(candidates_.begin(), candidates_.end(), [](const Choice& a, const Choice& b) {
    return a.rank != b.rank ? a.rank < b.rank : a.target < b.target;
  });
  for (const Choice& choice : candidates_) {
    if (!(choice.rank < std::numeric_limits<float>::infinity())) break;
    if (choice.target == choices_[p].target || !is_legal(p, choice.target)) continue;
    choose(p, choice);
    return;
  }
}

// `target` is a new neighbour of p.
void EdgeCollapser::offer(uint32_t p, uint32_t target) {
  if (attribute_count_ == 0) {
    const Choice choice = position_cost(p, target);
    if (choice.rank < choices_[p].rank) choose(p, choice);
    return;
  }
  for_each_target(p, [&](uint32_t c, uint32_t q, bool after) {
    if (q != target) return;
    const Choice choice = cost(p, c, q, after);
    if (choice.rank < choices_[p].rank) choose(p, choice);
  });
}

void EdgeCollapser::choose(uint32_t p, const Choice& choice) {
  choices_[p] = choice;
  stale_[p] = 0;
  queue_.set(p, choice.rank);
}

bool EdgeCollapser::is_legal(uint32_t p, uint32_t target) {
  return keeps_link(p, target) && keeps_facing(p, target) &&
         (!has_wedges_ || map_wedges(p, target));
}

// Leaves the other neighbours of p in neighbours_, the third corners at the edge first.
bool EdgeCollapser::keeps_link(uint32_t p, uint32_t target) {
  neighbours_.clear();
  const uint32_t is_neighbour = ++stamp_, is_opposite = ++stamp_;
  size_t opposites = 0;
  for (uint32_t c : ring(p)) {
    const uint32_t n = corner_position_[next(c)], q = corner_position_[prev(c)];
    if (n != target && q != target) continue;
    const uint32_t o = n == target ? q : n;
    marks_[o] = is_opposite;
    neighbours_.push_back(o);
    ++opposites;
  }
  for (uint32_t c : ring(p))
    for (uint32_t x : {corner_position_[next(c)], corner_position_[prev(c)]}) {
      if (x == target || marks_[x] >= is_neighbour) continue;
      marks_[x] = is_neighbour;
      neighbours_.push_back(x);
    }
  const uint32_t around = ring_of_[p].count;
  // The last triangle of a component stays, and so does one whose place another takes.
  if (around == 1 && ring_of_[target].count == 1) return false;
  for (uint32_t c : ring(target)) {
    const uint32_t n = corner_position_[next(c)], q = corner_position_[prev(c)];
    if (marks_[n] == is_neighbour || marks_[q] == is_neighbour) return false;
    if (around == 3 && opposites == 2 && marks_[n] == is_opposite && marks_[q] == is_opposite)
      return false;
  }
  if (!input_.chords && input_.locked[target])
    return std::none_of(neighbours_.begin() + opposites, neighbours_.end(),
                        [&](uint32_t x) { return input_.locked[x] != 0; });
  return true;
}

bool EdgeCollapser::keeps_facing(uint32_t p, uint32_t target) const {
  const Vec3 from = points_[p], to = points_[target];
  for (uint32_t c : ring(p)) {
    const uint32_t n = corner_position_[next(c)], q = corner_position_[prev(c)];
    if (n == target || q == target) continue;
    const Vec3 side = points_[q] - points_[n];
    const Vec3 before = cross(points_[n] - from, side), after = cross(points_[n] - to, side);
    const double turn = dot(before, after), size = double{dot(after, after)};
    const double old_size = double{dot(before, before)};
    if (!(size > 0.0)) return false;
    if (old_size > 0.0 &&
        !(turn > 0.0 && turn * turn >= kLeastCosine * kLeastCosine * size * old_size))
      return false;
  }
  return true;
}

// What each vertex at p becomes; false unless the triangles at the edge say it for all.
bool EdgeCollapser::map_wedges(uint32_t p, uint32_t target) {
  wedge_map_count_ = 0;
  for (uint32_t c : ring(p)) {
    const bool after = corner_position_[next(c)] == target;
    if (!after && corner_position_[prev(c)] != target) continue;
    const uint32_t from = corner_vertex_[c], to = corner_vertex_[after ? next(c) : prev(c)];
    if (wedge_map_count_ == 1 && wedge_map_[0].first == from) {
      if (wedge_map_[0].second != to) return false;
    } else if (wedge_map_count_ < 2) {
      wedge_map_[wedge_map_count_++] = {from, to};
    } else {
      return false;
    }
  }
  return wedge_map_count_ == wedge_counts_[p];
}

// `keeps_link` has just left the neighbours of p.
void EdgeCollapser::collapse(uint32_t p, uint32_t target) {
  if (input_.locked[target]) note_chords(target);
  merge_quadrics(p, target);
  const Ring old = ring_of_[p], kept = ring_of_[target];
  const uint32_t offset = static_cast<uint32_t>(rings_.size());
  for (uint32_t i = 0; i < old.count; ++i) {
    const uint32_t c = rings_[old.offset + i];
    const uint32_t n = corner_position_[next(c)], q = corner_position_[prev(c)];
    if (n == target || q == target) {
      dead_[c >> 2] = 1;
      --live_;
      remove_corner(n == target ? q : n, c >> 2);
      continue;
    }
    corner_position_[c] = target;
    if (has_wedges_) {
      const uint32_t v = corner_vertex_[c];
      corner_vertex_[c] = wedge_map_[v == wedge_map_[0].first ? 0 : 1].second;
    }
    rings_.push_back(c);
  }
  for (uint32_t i = 0; i < kept.count; ++i) {
    const uint32_t c = rings_[kept.offset + i];
    if (!dead_[c >> 2]) rings_.push_back(c);
  }
  ring_of_[p].count = 0;
  ring_of_[target] = {offset, static_cast<uint32_t>(rings_.size()) - offset};

  // A quadric that grew and a target that went make every rank but that of the new neighbour
  // higher, so what is in the queue may wait with its old rank until its turn comes.
  for (uint32_t x : neighbours_) {
    if (kinds_[x] == Kind::kFixed) continue;
    if (!queue_.contains(x) || kinds_[x] == Kind::kBorder) {
      enqueue_best(x);
    } else {
      if (choices_[x].target == p) stale_[x] = 1;
      offer(x, target);
    }
  }
  if (kinds_[target] == Kind::kFixed) return;
  if (queue_.contains(target))
    stale_[target] = 1;
  else
    enqueue_best(target);
}

void EdgeCollapser::note_chords(uint32_t target) {
  for (uint32_t x : neighbours_) {
    if (!input_.locked[x] || marks_[x] == stamp_) continue;  // stamp_: it was a neighbour before
    if (input_.component[x] != kNone && input_.component[x] == input_.component[target]) continue;
    chords_.push_back({std::min(x, target), std::max(x, target)});
  }
}

void EdgeCollapser::remove_corner(uint32_t p, uint32_t triangle) {
  Ring& r = ring_of_[p];
  for (uint32_t i = 0; i < r.count; ++i)
    if (rings_[r.offset + i] >> 2 == triangle) {
      rings_[r.offset + i] = rings_[r.offset + --r.count];
      return;
    }
}

void EdgeCollapser::merge_quadrics(uint32_t p, uint32_t target) {
  if (kinds_[target] == Kind::kFixed) return;
  const Vec3 d = points_[target] - points_[p];
  add_moved(quadrics_[target], quadrics_[p], d, std::max(value_at(quadrics_[p], d), 0.0f));
  settle_scale(target);
  if (attribute_count_ == 0) return;
  const auto merge = [&](uint32_t from, uint32_t to) {
    const uint32_t n = attribute_count_;
    const Quadric& q = attribute_quadrics_[from];
    Quadric& sum = attribute_quadrics_[to];
    add_moved(sum, q, d, std::max(attribute_cost(from, to, d), 0.0f));
    for (uint32_t k = 0; k < n; ++k) {
      const float difference = values_[size_t{to} * n + k] - values_[size_t{from} * n + k];
      const float* g = &gradients_[4 * (size_t{from} * n + k)];
      float* out = &gradients_[4 * (size_t{to} * n + k)];
      sum.x -= difference * g[0], sum.y -= difference * g[1], sum.z -= difference * g[2];
      for (int i = 0; i < 3; ++i) out[i] += g[i];
      out[3] += g[3] + g[0] * d.x + g[1] * d.y + g[2] * d.z - q.weight * difference;
    }
  };
  if (!has_wedges_) return merge(p, target);
  for (uint32_t i = 0; i < wedge_map_count_; ++i) merge(wedge_map_[i].first, wedge_map_[i].second);
}

}  // namespace umbel::lod
