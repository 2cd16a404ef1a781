#include "lod/simplify/collapse/collapse.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace umbel::lod {
namespace {

// Beyond so many times the largest squared error so far, a limited collapse is postponed.
constexpr float kMostRise = 16.0f;
// So many times the target is near enough.
constexpr double kNear = 1.1;
// Ranks within this factor count as the same: about the width of a bucket of the queue.
constexpr float kSameRank = 1.0625f;

// Of two moves of a position, what stops the one that passes more tests.
LimitingFactor last_of(LimitingFactor a, LimitingFactor b) {
  constexpr std::array kTests = {LimitingFactor::kTopology, LimitingFactor::kFlip,
                                 LimitingFactor::kSeams, LimitingFactor::kCost};
  const auto find = [&](LimitingFactor x) { return std::find(kTests.begin(), kTests.end(), x); };
  return find(a) < find(b) ? b : a;
}

}  // namespace

using Kind = CollapseMesh::Kind;

float EdgeCollapser::error() const { return std::sqrt(costs_.largest_squared_error()); }
float EdgeCollapser::attribute_error() const {
  return std::sqrt(costs_.largest_squared_attribute_error());
}

void EdgeCollapser::run(const CollapseInput& input, size_t target) {
  load(input);
  fill_queue();
  target_ = target;
  collapse_all();
}

void EdgeCollapser::resume(std::span<const uint32_t> component_of,
                           std::span<const float> component_radii) {
  may_pause_ = is_paused_ = false;
  components_.load(component_of, component_radii);
  const uint32_t positions = static_cast<uint32_t>(mesh_.position_count());
  queue_.extend(positions + components_.count());
  for (uint32_t c = 0; c < components_.count(); ++c)
    if (components_.is_removable(c)) queue_.set(positions + c, components_.rank(c));
  collapse_all();
}

void EdgeCollapser::collapse_all() {
  const CollapseInput& input = mesh_.input();
  const auto enough = [&] {
    return is_unlimited_to_the_end_ ? std::max(target_, input.unlimited_until) : target_;
  };
  while (!is_paused_ && mesh_.triangle_count() > enough()) {
    const size_t left = mesh_.triangle_count();
    if (queue_.empty()) {
      if (may_pause_ && left > input.pause_until) {
        is_paused_ = true;
      } else {
        if (is_unlimited_to_the_end_ || left <= input.unlimited_until) break;
        is_unlimited_to_the_end_ = true;
        enqueue_postponed();
      }
      continue;
    }
    const bool is_above = left > input.limit_below;
    if (is_above) {
      early_error_ = costs_.largest_squared_error();
      cost_limit_ = kMostRise * early_error_;
    }
    is_unlimited_ = is_unlimited_to_the_end_ || is_above;
    if (left > input.keep_attributes_below)
      attribute_limit_ = std::max(attribute_limit_, kMostRise * costs_.largest_attribute_loss());
    process(queue_.pop());
  }
  if (!is_paused_) mesh_.copy_triangles(result_);
}

void EdgeCollapser::load(const CollapseInput& input) {
  mesh_.load(input);
  costs_.build();
  attributes_.build(input);
  link_.reset();
  loop_.reset();
  locked_edges_.clear();
  postponed_.clear();
  removed_radius_ = cost_limit_ = early_error_ = 0.0f;
  is_unlimited_to_the_end_ = is_paused_ = has_moved_non_manifold_ = false;
  may_pause_ = std::isfinite(input.pause_above);
  pause_above_ = input.pause_above * mesh_.extent();
  pause_above_ *= pause_above_;
  attribute_limit_ = input.attribute_loss * mesh_.extent();
  attribute_limit_ *= attribute_limit_;
  limiting_factors_.assign(mesh_.position_count(), LimitingFactor::kCost);
  choices_.resize(mesh_.position_count());
  states_.assign(mesh_.position_count(), State::kCurrent);
  ranked_again_.assign(mesh_.has_wedges() ? mesh_.position_count() : 0, kNone);
}

void EdgeCollapser::fill_queue() {
  const uint32_t positions = static_cast<uint32_t>(mesh_.position_count());
  queue_.reset(positions);
  for (uint32_t p = 0; p < positions; ++p)
    if (!mesh_.is_fixed(p)) enqueue_best(p);
}

// What the queue gives.
void EdgeCollapser::process(uint32_t p) {
  if (p >= mesh_.position_count())
    return remove_component(p - static_cast<uint32_t>(mesh_.position_count()));
  if (states_[p] == State::kStale) return enqueue_best(p);
  link_.mark(p);
  const uint32_t target = choices_[p].target;
  const bool legal = rules_.allow(p, target);
  const bool by_loop =
      !legal && states_[p] == State::kLoop && link_.has_loop() && loop_.find(p, target);
  if (!legal && !by_loop) return enqueue_best_legal(p);
  if (legal && mesh_.has_wedges() && was_ranked_too_low(p)) return;
  if (!is_unlimited_ || may_pause_) {
    const float error = costs_.squared_error(p, target);
    if (!is_unlimited_ && !(error <= cost_limit_)) {
      limiting_factors_[p] = LimitingFactor::kCost;
      return postponed_.push_back(p);
    }
    if (may_pause_ && !(error <= pause_above_)) {
      is_paused_ = true;
      return queue_.set(p, choices_[p].rank);
    }
  }
  if (legal && loses_attributes(p, target)) {
    limiting_factors_[p] = LimitingFactor::kCost;
    return;
  }
  if (legal)
    collapse(p, target);
  else
    collapse_loop();
}

// What the vertices become depends on triangles that may have changed. Then p is ranked again, but
// only once for one mesh: where large attributes cancel out, the two ways to the same rank round
// differently.
bool EdgeCollapser::was_ranked_too_low(uint32_t p) {
  const float rank = costs_.rank(p, choices_[p].target);
  if (!(rank > kSameRank * choices_[p].rank)) return false;
  const auto left = static_cast<uint32_t>(mesh_.triangle_count());
  if (ranked_again_[p] != left) {
    ranked_again_[p] = left;
    enqueue_best(p);
  } else {
    choices_[p].rank = rank;
    queue_.set(p, rank);
  }
  return true;
}

// A vertex may go a small way and yet take a large triangle's texture coordinates across a seam.
bool EdgeCollapser::loses_attributes(uint32_t p, uint32_t target) {
  return mesh_.triangle_count() <= mesh_.input().keep_attributes_below &&
         !(costs_.squared_attribute_error(p, target) <= attribute_limit_);
}

void EdgeCollapser::enqueue_postponed() {
  for (uint32_t p : postponed_)
    if (!queue_.contains(p) && !mesh_.is_fixed(p) && mesh_.rings().size(p) > 0) enqueue_best(p);
}

void EdgeCollapser::enqueue_best(uint32_t p) {
  const Choice best = costs_.cheapest(p);
  if (best.target != kNone) return choose(p, best);
  limiting_factors_[p] = LimitingFactor::kSeams;
  queue_.remove(p);
}

// Once the best is found illegal. Topology and flips are looked at before attributes, which cost
// more.
void EdgeCollapser::enqueue_best_legal(uint32_t p) {
  LimitingFactor& limit = limiting_factors_[p] = rules_.limiting_factor();
  const uint32_t illegal = link_.has_loop() ? kNone : choices_[p].target;
  candidates_.clear();
  mesh_.for_each_target(p, [&](uint32_t c, uint32_t target, bool after) {
    if (target != illegal)
      candidates_.push_back({{costs_.rank_of_position(p, target), target, c, after}});
  });
  Choice loop{std::numeric_limits<float>::infinity(), kNone};
  while (!candidates_.empty()) {
    Candidate& first = first_candidate();
    const uint32_t target = first.move.target;
    const float rank = first.move.rank;
    if (!(rank < loop.rank)) break;
    if (!first.is_ranked && is_possible(p, first)) continue;
    const bool is_legal = first.is_ranked && !first.has_loop && rules_.keep_seams(p, target);
    const bool is_loop = first.is_ranked && first.has_loop && loop_.find(p, target);
    if (is_legal) {
      choose(p, {rank, target});
      states_[p] = State::kSecond;
      return;
    }
    limit = last_of(limit, rules_.limiting_factor());
    first = candidates_.back();
    candidates_.pop_back();
    if (!is_loop) continue;
    const float rank_of_loop = loop_.rank();
    if (rank_of_loop < loop.rank) loop = {rank_of_loop, target};
  }
  if (loop.target == kNone) return;
  choose(p, loop);
  states_[p] = State::kLoop;
}

// The cheapest, of equals that of the lowest target. Attributes only add to what positions cost, so
// they are looked at where that comes first.
EdgeCollapser::Candidate& EdgeCollapser::first_candidate() {
  const auto comes_first = [](const Candidate& a, const Candidate& b) {
    if (a.move.rank != b.move.rank) return a.move.rank < b.move.rank;
    return a.is_ranked != b.is_ranked ? b.is_ranked : a.move.target < b.move.target;
  };
  return *std::min_element(candidates_.begin(), candidates_.end(), comes_first);
}

// Whether the candidate is legal but for seams, or may be as a loop. If so, it gets its rank.
bool EdgeCollapser::is_possible(uint32_t p, Candidate& candidate) {
  const bool keeps_surface = rules_.keep_surface(p, candidate.move.target);
  if (!keeps_surface && !link_.has_loop()) return false;
  candidate.move.rank = costs_.choice(p, candidate.move).rank;
  candidate.is_ranked = true;
  candidate.has_loop = !keeps_surface;
  return true;
}

// `target` is a new neighbour of p. At a border only some neighbours are where it may move to.
void EdgeCollapser::offer(uint32_t p, uint32_t target) {
  const float least = costs_.rank_of_position(p, target);
  if (!(least < choices_[p].rank)) return;
  if (attributes_.is_empty() && mesh_.kind(p) == Kind::kInterior) return choose(p, {least, target});
  mesh_.for_each_target(p, [&](uint32_t c, uint32_t q, bool after) {
    if (q != target) return;
    const Choice candidate = costs_.choice(p, {least, q, c, after});
    if (candidate.rank < choices_[p].rank) choose(p, candidate);
  });
}

void EdgeCollapser::choose(uint32_t p, const Choice& choice) {
  choices_[p] = choice;
  states_[p] = State::kCurrent;
  queue_.set(p, choice.rank);
}

// Right after the rules have allowed it.
void EdgeCollapser::collapse(uint32_t p, uint32_t target) {
  const bool non_manifold = mesh_.moves_non_manifold(p);
  const bool at_border = mesh_.kind(p) == Kind::kBorder;
  has_moved_non_manifold_ |= non_manifold;
  if (!non_manifold) link_.list(p, target);
  if (mesh_.input().locked[target]) record_locked_edges(target);
  costs_.merge(p, target);
  move_ring(p, target);
  const auto neighbours = link_.neighbours();
  if (non_manifold) {
    for (uint32_t x : neighbours) mesh_.find_kind(x);
    mesh_.find_kind(target);
  }
  // A quadric that grew and a target that went make every rank but that of the new neighbour
  // higher, so what is in the queue may wait with its old rank until its turn comes.
  for (size_t i = 0; i < neighbours.size(); ++i) {
    const uint32_t x = neighbours[i];
    if (mesh_.is_fixed(x)) {
      queue_.remove(x);  // it may have lost its last triangle
      continue;
    }
    const bool is_opposite = i < link_.opposites();
    // At a border, the edge from a third corner to the target may have become one of the border,
    // and where the two triangles at the edge have one third corner, there may be none any more.
    // A border has few places to go to: the best may be legal now.
    const bool is_second = mesh_.kind(x) != Kind::kInterior &&
                           (states_[x] == State::kSecond || states_[x] == State::kLoop);
    if (non_manifold || !queue_.contains(x) || (is_opposite && at_border) || is_second) {
      enqueue_best(x);
    } else {
      if (choices_[x].target == p || (is_opposite && choices_[x].target == target))
        states_[x] = State::kStale;
      if (!is_opposite) offer(x, target);
    }
  }
  if (mesh_.is_fixed(target))
    queue_.remove(target);
  else if (queue_.contains(target))
    states_[target] = State::kStale;
  else
    enqueue_best(target);
}

// The one that was found last.
void EdgeCollapser::collapse_loop() {
  has_moved_non_manifold_ = true;
  const auto loop = loop_.positions();
  const uint32_t target = loop[0];
  std::vector<uint32_t> around = {target};
  for (size_t i = 1; i < loop.size(); ++i) {
    const uint32_t p = loop[i];
    link_.list_any(p, target);
    loop_.map_wedges(i);
    costs_.merge(p, target);
    around.insert(around.end(), link_.neighbours().begin(), link_.neighbours().end());
    move_ring(p, target);
    queue_.remove(p);
  }
  for (uint32_t x : around) mesh_.find_kind(x);
  for (uint32_t x : around)
    if (mesh_.is_fixed(x))
      queue_.remove(x);
    else
      enqueue_best(x);
}

// After the link condition has listed the neighbours of p.
void EdgeCollapser::move_ring(uint32_t p, uint32_t target) {
  const bool has_wedges = mesh_.has_wedges();
  mesh_.collapse(p, target, link_.neighbours(), link_.opposites(),
                 [&](uint32_t vertex) { return has_wedges ? wedges_.new_vertex(vertex) : target; });
}

void EdgeCollapser::record_locked_edges(uint32_t target) {
  const auto& components = mesh_.input().non_manifold_component;
  for (uint32_t x : link_.neighbours().subspan(link_.opposites())) {
    if (!mesh_.input().locked[x]) continue;
    if (components[x] != kNone && components[x] == components[target]) continue;
    locked_edges_.push_back({std::min(x, target), std::max(x, target)});
  }
}

// Unless it has fewer triangles by now than its rank says, then later.
void EdgeCollapser::remove_component(uint32_t component) {
  if (!components_.recount(component)) {
    queue_.set(static_cast<uint32_t>(mesh_.position_count()) + component,
               components_.rank(component));
    return;
  }
  const float radius = components_.radius(component);
  if (mesh_.triangle_count() < target_ + components_.triangles_left(component) ||
      (!is_unlimited_ && radius * radius > cost_limit_))
    return;
  removed_radius_ = std::max(removed_radius_, radius);
  for (uint32_t t : components_.triangles(component)) {
    if (mesh_.is_removed(t)) continue;
    mesh_.remove_triangle(t);
    for (uint32_t p : mesh_.positions_of(t)) queue_.remove(p);
  }
}

bool EdgeCollapser::refit(uint32_t vertex, std::span<float> values) const {
  const uint32_t p = mesh_.input().position_of[vertex];
  return mesh_.kind(p) == Kind::kInterior && !mesh_.has_wedges(p) && costs_.stands_for_others(p) &&
         attributes_.refit(vertex, values);
}

bool EdgeCollapser::was_forced() const {
  const bool is_short = mesh_.triangle_count() > kNear * static_cast<double>(target_);
  if (!is_short && !(costs_.largest_squared_error() > kMostRise * early_error_)) return false;
  const LimitingFactor limit = limiting_factor();
  return limit == LimitingFactor::kTopology || limit == LimitingFactor::kFlip;
}

LimitingFactor EdgeCollapser::limiting_factor() const {
  std::array<size_t, kLimitingFactors> counts{};
  for (uint32_t p = 0; p < mesh_.position_count(); ++p) {
    if (mesh_.rings().size(p) == 0) continue;
    const LimitingFactor limit = mesh_.input().locked[p] ? LimitingFactor::kLocked
                                 : mesh_.is_fixed(p)     ? LimitingFactor::kNonManifold
                                                         : limiting_factors_[p];
    ++counts[static_cast<size_t>(limit)];
  }
  return static_cast<LimitingFactor>(std::max_element(counts.begin(), counts.end()) -
                                     counts.begin());
}

}  // namespace umbel::lod
