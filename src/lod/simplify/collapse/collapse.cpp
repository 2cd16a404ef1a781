#include "lod/simplify/collapse/collapse.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "base/math.hpp"
#include "base/simd/float4.hpp"
#include "lod/simplify/collapse/quadric.hpp"

namespace umbel::lod {
namespace {

// Where collapses begin to cost a multiple of what they did, as squared distances.
constexpr float kMostRise = 16.0f;

constexpr float kUnlimited = std::numeric_limits<float>::infinity();

typedef uint32_t Word4 __attribute__((vector_size(16)));

}  // namespace

float EdgeCollapser::error() const { return std::sqrt(worst_); }
float EdgeCollapser::attribute_error() const { return std::sqrt(worst_attributes_); }

void EdgeCollapser::run(const CollapseInput& input, size_t target) {
  load(input);
  build_rings();
  find_kinds();
  build_quadrics();
  build_attribute_quadrics();
  load_parts();
  queue_.reset(points_.size() + input.part_radii.size());
  enqueue_parts();
  for (uint32_t p = 0; p < points_.size(); ++p)
    if (kinds_[p] != Kind::kFixed) enqueue_best(p);
  float cost_limit = 0.0f;
  bool unlimited = false;
  postponed_.clear();
  while (live_ > (unlimited ? std::max(target, input.unlimited_until) : target)) {
    if (queue_.empty()) {
      if (unlimited || live_ <= input.unlimited_until) break;
      unlimited = true;
      enqueue_postponed();
      continue;
    }
    if (live_ > input.limit_below) cost_limit = kMostRise * worst_;
    const bool is_unlimited = unlimited || live_ > input.limit_below;
    const uint32_t p = queue_.pop();
    if (p >= points_.size()) {
      leave_out(p - static_cast<uint32_t>(points_.size()), target,
                is_unlimited ? kUnlimited : cost_limit);
      continue;
    }
    if (states_[p] == State::kStale) {
      enqueue_best(p);
      continue;
    }
    mark_neighbours(p);
    const uint32_t target = choices_[p].target;
    const bool legal = is_legal(p, target);
    const bool by_loop = !legal && states_[p] == State::kLoop && has_loop_ && find_loop(p, target);
    if (!legal && !by_loop)
      enqueue_best_legal(p);
    else if (!is_unlimited && !(cost_of(p, target) <= cost_limit))
      postponed_.push_back(p);
    else if (legal)
      collapse(p, target);
    else
      collapse_loop();
  }
  finish();
}

void EdgeCollapser::enqueue_postponed() {
  for (uint32_t p : postponed_)
    if (!queue_.contains(p) && kinds_[p] != Kind::kFixed && ring_of_[p].count > 0) enqueue_best(p);
}

void EdgeCollapser::load(const CollapseInput& input) {
  input_ = input;
  area_ = 0.0;
  has_wedges_ = input.locked.size() != input.position_of.size();
  attribute_count_ = static_cast<uint32_t>(input.attribute_weights.size());
  worst_ = worst_attributes_ = 0.0f;
  locked_edges_.clear();
  triangles_.assign(input.triangles.begin(), input.triangles.end());
  live_ = triangles_.size();
  dead_.assign(live_, 0);
  const size_t count = input.locked.size();
  points_.resize(count);
  for (size_t v = 0; v < input.position_of.size(); ++v) {
    const Vec3& p = input.positions[v];
    points_[input.position_of[v]] = {p.x, p.y, p.z, 0.0f};
  }
  Aabb box;
  for (const Point& p : points_) extend(box, Vec3{p.x, p.y, p.z});
  const Vec3 d = box.max - box.min;
  extent_ = std::max({d.x, d.y, d.z});
  const float unit = extent_ > 0.0f ? std::ldexp(1.0f, 13 - std::ilogb(extent_)) : 1.0f;
  area_unit_ = unit * unit;
  wedge_counts_.assign(count, 1);
  if (has_wedges_) count_wedges();
  choices_.resize(count);
  states_.assign(count, State::kCurrent);
  drifts_.assign(count, 0.0f);
  marks_.assign(count, 0);
  slots_.resize(count);
  stamp_ = 0;
}

void EdgeCollapser::build_rings() {
  ring_of_.assign(points_.size(), {0, 0});
  for (const Triangle& t : triangles_)
    for (uint32_t p : positions_of(t)) ++ring_of_[p].count;
  uint32_t offset = 0;
  for (Ring& r : ring_of_) {
    r.offset = offset;
    offset += blocks(std::exchange(r.count, 0));
  }
  link_end_ = offset;
  if (link_.size() <= offset) make_room(offset + offset / 2);
  const auto add = [&](uint32_t p, uint32_t n, uint32_t q, uint32_t corner) {
    Ring& r = ring_of_[p];
    const uint32_t slot = r.offset + r.count++;
    link_[slot] = {n, q};
    corners_[slot] = corner;
  };
  for (uint32_t t = 0; t < triangles_.size(); ++t) {
    const auto [a, b, c] = positions_of(triangles_[t]);
    add(a, b, c, 3 * t);
    add(b, c, a, 3 * t + 1);
    add(c, a, b, 3 * t + 2);
  }
}

void EdgeCollapser::find_kinds() {
  kinds_.resize(points_.size());
  for (uint32_t p = 0; p < points_.size(); ++p) kinds_[p] = kind_of(p);
}

// Interior: its triangles form one closed fan. Border: one open fan.
EdgeCollapser::Kind EdgeCollapser::kind_of(uint32_t p) {
  const auto link = ring(p);
  if (link.empty() || input_.locked[p]) return Kind::kFixed;
  const Kind other = input_.non_manifold ? Kind::kNonManifold : Kind::kFixed;
  const uint32_t is_next = ++stamp_;
  for (uint32_t i = 0; i < link.size(); ++i) {
    const uint32_t n = link[i].next;
    if (marks_[n] == is_next) return other;
    marks_[n] = is_next;
    slots_[n] = i;
  }
  // The fan turns from each triangle to the one that begins where this one ends.
  uint32_t first = 0, ends = 0;
  for (const LinkEdge& s : link) ends += marks_[s.prev] != is_next;
  if (ends > 1) return other;
  if (ends == 1) {
    const auto begins = [&](const LinkEdge& s) {
      return std::none_of(link.begin(), link.end(),
                          [&](const LinkEdge& o) { return o.prev == s.next; });
    };
    while (!begins(link[first])) ++first;
  }
  // Where two triangles end alike the walk may come to a circle without the first.
  size_t steps = 1;
  for (uint32_t i = first; steps <= link.size() && marks_[link[i].prev] == is_next; ++steps) {
    i = slots_[link[i].prev];
    if (i == first) break;
  }
  if (steps != link.size()) return other;
  return ends == 0 ? Kind::kInterior : Kind::kBorder;
}

void EdgeCollapser::enqueue_best(uint32_t p) {
  const bool by_position = attribute_count_ == 0 && kinds_[p] == Kind::kInterior;
  const Choice best = by_position ? cheapest_position(p) : cheapest(p);
  if (best.target != kNone)
    choose(p, best);
  else
    queue_.remove(p);
}

// Once the best is found illegal.
void EdgeCollapser::enqueue_best_legal(uint32_t p) {
  candidates_.clear();
  for_each_target(p, [&](uint32_t c, uint32_t target, bool after) {
    candidates_.push_back(choice(p, {position_choice(p, target).rank, target, c, after}));
  });
  std::sort(candidates_.begin(), candidates_.end(), [](const Choice& a, const Choice& b) {
    return a.rank != b.rank ? a.rank < b.rank : a.target < b.target;
  });
  const uint32_t illegal = has_loop_ ? kNone : choices_[p].target;
  Choice loop{std::numeric_limits<float>::infinity(), kNone};
  for (const Choice& candidate : candidates_) {
    if (!(candidate.rank < loop.rank)) break;
    if (candidate.target == illegal) continue;
    if (is_legal(p, candidate.target)) return choose(p, candidate);
    if (!has_loop_ || !find_loop(p, candidate.target)) continue;
    const float rank = rank_of_loop();
    if (rank < loop.rank) loop = {rank, candidate.target};
  }
  if (loop.target == kNone) return;
  choose(p, loop);
  states_[p] = State::kLoop;
}

// `target` is a new neighbour of p.
void EdgeCollapser::offer(uint32_t p, uint32_t target) {
  const Choice least = position_choice(p, target);
  if (!(least.rank < choices_[p].rank)) return;
  if (attribute_count_ == 0) return choose(p, least);
  for_each_target(p, [&](uint32_t c, uint32_t q, bool after) {
    if (q != target) return;
    const Choice candidate = choice(p, {least.rank, q, c, after});
    if (candidate.rank < choices_[p].rank) choose(p, candidate);
  });
}

void EdgeCollapser::choose(uint32_t p, const Choice& choice) {
  choices_[p] = choice;
  states_[p] = State::kCurrent;
  queue_.set(p, choice.rank);
}

bool EdgeCollapser::is_legal(uint32_t p, uint32_t target) {
  has_loop_ = false;
  if (moves_non_manifold(p) ? !keeps_non_manifold_link(p, target) : !keeps_link(p, target))
    return false;
  if (!input_.allow_flips && !keeps_orientation(p, target)) return false;
  return !has_wedges_ || map_wedges(p, target);
}

// For `keeps_link`, with stamp_.
void EdgeCollapser::mark_neighbours(uint32_t p) {
  const uint32_t stamp = ++stamp_;
  uint32_t* const marks = marks_.data();
  for (const LinkEdge& s : ring(p)) marks[s.next] = stamp;
  if (kinds_[p] != Kind::kInterior)
    for (const LinkEdge& s : ring(p)) marks[s.prev] = stamp;
}

// Those at the edge from a regular position: one or two.
void EdgeCollapser::find_opposites(uint32_t p, uint32_t target) {
  uint32_t found[3] = {kNone, kNone, kNone};  // the last for what is not at the edge
  size_t count = 0;
  for (const LinkEdge& s : ring(p)) {
    found[count] = s.next == target ? s.prev : s.next;
    count += s.next == target || s.prev == target;
  }
  opposites_ = count;
  opposite_ = {found[0], found[count == 2]};
}

// After `mark_neighbours`: only the third corners at the edge are neighbours of both ends.
bool EdgeCollapser::keeps_link(uint32_t p, uint32_t target) {
  find_opposites(p, target);
  const auto [a, b] = opposite_;
  const uint32_t around = ring_of_[p].count;
  // The last triangles of a component stay, and so does one whose place another takes.
  if (around == opposites_ && ring_of_[target].count == around) return false;
  const uint32_t* const marks = marks_.data();
  bool shared = false;
  for (const LinkEdge& s : ring(target))
    shared |= marks[s.next] == stamp_ && s.next != a && s.next != b;
  if (kinds_[target] != Kind::kInterior)
    for (const LinkEdge& s : ring(target))
      shared |= marks[s.prev] == stamp_ && s.prev != a && s.prev != b;
  has_loop_ = shared;
  if (shared) return false;
  if (around == 3 && opposites_ == 2)
    for (const LinkEdge& s : ring(target))
      if (std::minmax(s.next, s.prev) == std::minmax(a, b)) return false;
  if (!input_.locked[target]) return true;
  list_neighbours(p, target);
  return keeps_locked_edges(target);
}

// Of a regular position, the third corners at the edge first. What comes next cannot be foretold,
// so hardly anything branches on it.
void EdgeCollapser::list_neighbours(uint32_t p, uint32_t target) {
  const auto link = ring(p);
  if (neighbour_room_.size() < 2 * link.size() + 1) neighbour_room_.resize(4 * link.size() + 1);
  uint32_t* const list = neighbour_room_.data();
  const auto [a, b] = opposite_;
  list[0] = a, list[1] = b;
  size_t count = opposites_;
  uint32_t last = kNone;  // of an open fan, what no triangle starts with
  for (const LinkEdge& s : link) {
    const uint32_t x = s.next;
    list[count] = x;
    count += x != target && x != a && x != b;
  }
  if (kinds_[p] != Kind::kInterior) {
    for (const LinkEdge& s : link)
      if (std::none_of(link.begin(), link.end(),
                       [&](const LinkEdge& o) { return o.next == s.prev; }))
        last = s.prev;
    if (last != kNone && last != target && last != a && last != b) list[count++] = last;
  }
  neighbours_ = {list, count};
}

// An edge that comes to have four triangles must be allowed by the source: its ends are in one
// component of non-manifold edges. So must be those that have an odd number already.
bool EdgeCollapser::keeps_non_manifold_link(uint32_t p, uint32_t target) {
  const uint32_t component = input_.component[target];
  if (input_.component[p] != kNone && input_.component[p] != component) return false;
  const uint32_t is_other = list_all_neighbours(p, target);
  for (const LinkEdge& s : ring(target))
    for (uint32_t x : {s.next, s.prev})
      has_loop_ |=
          marks_[x] == is_other && (component == kNone || input_.component[x] != component);
  return !has_loop_ && keeps_locked_edges(target);
}

// Of any position, the third corners at the edge first. Returns what the others are marked with.
uint32_t EdgeCollapser::list_all_neighbours(uint32_t p, uint32_t target) {
  const uint32_t is_opposite = ++stamp_, is_other = ++stamp_;
  const size_t most = 2 * size_t{ring_of_[p].count};
  if (neighbour_room_.size() < most) neighbour_room_.resize(2 * most);
  size_t count = 0;
  const auto add = [&](uint32_t x, uint32_t mark) {
    if (x == target || marks_[x] >= is_opposite) return;
    marks_[x] = mark;
    neighbour_room_[count++] = x;
  };
  for (const LinkEdge& s : ring(p))
    if (s.next == target || s.prev == target) add(s.next == target ? s.prev : s.next, is_opposite);
  opposites_ = count;
  for (const LinkEdge& s : ring(p)) add(s.next, is_other), add(s.prev, is_other);
  neighbours_ = {neighbour_room_.data(), count};
  return is_other;
}

// Of the new edges at the target those between locked positions may be legal or not.
bool EdgeCollapser::keeps_locked_edges(uint32_t target) const {
  if (!input_.locked[target]) return true;
  return std::none_of(neighbours_.begin() + opposites_, neighbours_.end(), [&](uint32_t x) {
    if (!input_.locked[x]) return false;
    const auto& ids = input_.position_ids;
    return !input_.locked_edges || (input_.taken && input_.taken->contains({ids[x], ids[target]}));
  });
}

// Four triangles at once. Areas are scaled so that the fourth powers of lengths fit floats.
bool EdgeCollapser::keeps_orientation(uint32_t p, uint32_t target) const {
  const auto link = ring(p);
  const Point &from = points_[p], &to = points_[target];
  const Float4 zero = Float4::all(0.0f), unit = Float4::all(area_unit_);
  const Float4 least = Float4::all(static_cast<float>(kLeastCosine * kLeastCosine));
  for (size_t begin = 0; begin < link.size(); begin += 4) {
    std::array<LinkEdge, 4> four;
    uint32_t stays = 0;
    for (size_t i = 0; i < 4; ++i) {
      four[i] = link[std::min(begin + i, link.size() - 1)];
      stays |= uint32_t{four[i].next != target && four[i].prev != target} << i;
    }
    const auto next = [&](size_t i) { return Float4::load(&points_[four[i].next].x); };
    const auto prev = [&](size_t i) { return Float4::load(&points_[four[i].prev].x); };
    Float4 nx = next(0), ny = next(1), nz = next(2), n3 = next(3);
    transpose(nx, ny, nz, n3);
    Float4 sx = prev(0), sy = prev(1), sz = prev(2), s3 = prev(3);
    transpose(sx, sy, sz, s3);
    sx = sx - nx, sy = sy - ny, sz = sz - nz;
    const auto normal = [&](const Point& at) {
      const Float4 x = nx - Float4::all(at.x), y = ny - Float4::all(at.y);
      const Float4 z = nz - Float4::all(at.z);
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

// Right after `is_legal`.
void EdgeCollapser::collapse(uint32_t p, uint32_t target) {
  const bool non_manifold = moves_non_manifold(p);
  if (!non_manifold) list_neighbours(p, target);
  if (input_.locked[target]) record_locked_edges(target);
  merge_quadrics(p, target);
  move_ring(p, target);
  if (non_manifold) {
    for (uint32_t x : neighbours_) kinds_[x] = kind_of(x);
    kinds_[target] = kind_of(target);
  }
  // A quadric that grew and a target that went make every rank but that of the new neighbour
  // higher, so what is in the queue may wait with its old rank until its turn comes.
  for (size_t i = 0; i < neighbours_.size(); ++i) {
    const uint32_t x = neighbours_[i];
    if (kinds_[x] == Kind::kFixed) {
      queue_.remove(x);  // it may have lost its last triangle
      continue;
    }
    if (non_manifold || !queue_.contains(x) || kinds_[x] != Kind::kInterior) {
      enqueue_best(x);
    } else {
      if (choices_[x].target == p) states_[x] = State::kStale;
      if (i >= opposites_) offer(x, target);
    }
  }
  if (kinds_[target] == Kind::kFixed)
    queue_.remove(target);
  else if (queue_.contains(target))
    states_[target] = State::kStale;
  else
    enqueue_best(target);
}

// Gives p's triangles to the target, but for those at the edge.
void EdgeCollapser::move_ring(uint32_t p, uint32_t target) {
  const Ring old = ring_of_[p], kept = ring_of_[target];
  const uint32_t offset = link_end_;
  make_room(offset + blocks(old.count + kept.count));
  LinkEdge* const link = link_.data();
  uint32_t* const corners = corners_.data();
  uint32_t end = offset;
  for (uint32_t i = old.offset; i < old.offset + old.count; ++i) {
    const LinkEdge s = link[i];
    const uint32_t c = corners[i];
    if (s.next == target || s.prev == target) {
      dead_[c / 3] = 1;
      --live_;
      continue;
    }
    uint32_t& v = vertex(c);
    v = has_wedges_ ? mapped(v) : target;
    link[end] = s;
    corners[end++] = c;
  }
  for (uint32_t i = kept.offset; i < kept.offset + kept.count; ++i) {
    const LinkEdge s = link[i];
    link[end] = s;
    corners[end] = corners[i];
    end += s.next != p && s.prev != p;
  }
  ring_of_[p].count = 0;
  ring_of_[target] = {offset, end - offset};
  link_end_ = offset + blocks(end - offset);
  for (uint32_t x : neighbours_) rename(x, p, target);
  for (size_t i = 0; i < opposites_; ++i) remove_folded(neighbours_[i]);
}

// For link up to `end`, and one more.
void EdgeCollapser::make_room(uint32_t end) {
  if (end < link_.size()) return;
  link_.resize(2 * size_t{end} + 1);
  corners_.resize(link_.size());
}

// In the ring of a neighbour, whole blocks at a time: what is behind the ring's end does not count.
void EdgeCollapser::rename(uint32_t at, uint32_t p, uint32_t target) {
  const Ring r = ring_of_[at];
  uint32_t* const words = &link_[r.offset].next;
  const Word4 from{p, p, p, p}, to{target, target, target, target};
  for (uint32_t i = 0; i < 2 * r.count; i += 4) {
    Word4 word;
    memcpy(&word, words + i, sizeof word);
    const Word4 is_p = word == from;
    word = (word & ~is_p) | (to & is_p);
    memcpy(words + i, &word, sizeof word);
  }
}

// From the ring of a third corner at the edge.
void EdgeCollapser::remove_folded(uint32_t at) {
  Ring& r = ring_of_[at];
  for (uint32_t i = r.offset; i < r.offset + r.count;) {
    if (link_[i].next != link_[i].prev) {
      ++i;
      continue;
    }
    const uint32_t last = r.offset + --r.count;
    link_[i] = link_[last];
    corners_[i] = corners_[last];
  }
}

void EdgeCollapser::record_locked_edges(uint32_t target) {
  for (size_t i = opposites_; i < neighbours_.size(); ++i) {
    const uint32_t x = neighbours_[i];
    if (!input_.locked[x]) continue;
    if (input_.component[x] != kNone && input_.component[x] == input_.component[target]) continue;
    locked_edges_.push_back({std::min(x, target), std::max(x, target)});
  }
}

void EdgeCollapser::finish() {
  // Which are left cannot be foretold, so nothing branches on it.
  result_.resize(triangles_.size());
  size_t count = 0;
  for (size_t t = 0; t < triangles_.size(); ++t) {
    result_[count] = triangles_[t];
    count += dead_[t] == 0;
  }
  result_.resize(count);
}

}  // namespace umbel::lod
