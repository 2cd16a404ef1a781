#include "lod/simplify/collapse/loop_collapse.hpp"

#include <algorithm>

namespace umbel::lod {
namespace {

// Positions of a loop, with the target.
constexpr size_t kMostPositions = 8;

}  // namespace

void LoopCollapse::reset() {
  marks_.assign(mesh_.position_count(), 0);
  slots_.resize(mesh_.position_count());
  stamp_ = 0;
}

bool LoopCollapse::find(uint32_t p, uint32_t target) {
  positions_.assign({target});
  moves_.clear();
  ends_.assign({0});
  return add(p) && complete() &&
         std::all_of(positions_.begin() + 1, positions_.end(), [&](uint32_t from) {
           const auto goes = [&](const LinkEdge& e) {
             return contains(e.next) || contains(e.prev);
           };
           return rules_.keeps_orientation_but_for(from, target, goes) && keep_wedges(from);
         });
}

bool LoopCollapse::add(uint32_t p) {
  const auto& components = mesh_.input().non_manifold_component;
  if (positions_.size() == kMostPositions || mesh_.is_fixed(p) ||
      (components[p] != kNone && components[p] != components[positions_[0]]))
    return false;
  positions_.push_back(p);
  return true;
}

bool LoopCollapse::contains(uint32_t p) const {
  return std::find(positions_.begin(), positions_.end(), p) != positions_.end();
}

// Adds those whose edges to several of the loop would become one with too many triangles, or none.
// False where too many would move, or a whole connected component would go.
bool LoopCollapse::complete() {
  const CollapseInput& input = mesh_.input();
  const uint32_t target = positions_[0], component = input.non_manifold_component[target];
  around_.clear();
  stamp_ += 2;  // one less: in the loop
  for (size_t known = 0; known < positions_.size();) {
    for (; known < positions_.size(); ++known) count_around(positions_[known]);
    for (const Neighbour& n : around_) {
      if (marks_[n.position] != stamp_) continue;
      if (input.locked[target] && !n.at_target && input.locked[n.position]) return false;
      if (!n.several || n.triangles == 1 || n.triangles == 2) continue;
      if (component != kNone && component == input.non_manifold_component[n.position]) continue;
      if (!add(n.position)) return false;
    }
  }
  return std::any_of(around_.begin(), around_.end(), [&](const Neighbour& n) {
    return n.triangles > 0 && marks_[n.position] == stamp_;
  });
}

// Counts one more of the loop: its triangles with two others around come in, those that one of the
// loop had with it and another go.
void LoopCollapse::count_around(uint32_t from) {
  const uint32_t is_around = stamp_, is_in_loop = stamp_ - 1;
  marks_[from] = is_in_loop;
  const auto around = [&](uint32_t x) -> Neighbour& {
    if (marks_[x] != is_around) {
      marks_[x] = is_around;
      slots_[x] = static_cast<uint32_t>(around_.size());
      around_.push_back({x, from, 0, false, false});
    }
    Neighbour& n = around_[slots_[x]];
    n.several |= n.from != from;
    n.at_target |= from == positions_[0];
    return n;
  };
  for (const LinkEdge& e : mesh_.link(from)) {
    const bool next_goes = marks_[e.next] == is_in_loop, prev_goes = marks_[e.prev] == is_in_loop;
    if (!next_goes && !prev_goes)
      ++around(e.next).triangles, ++around(e.prev).triangles;
    else if (!next_goes)
      --around(e.next).triangles;
    else if (!prev_goes)
      --around(e.prev).triangles;
  }
}

bool LoopCollapse::keep_wedges(uint32_t p) {
  if (!wedges_.find_cheapest(p, positions_[0])) return false;
  moves_.insert(moves_.end(), wedges_.moves().begin(), wedges_.moves().end());
  ends_.push_back(moves_.size());
  return true;
}

void LoopCollapse::map_wedges(size_t i) {
  wedges_.set(std::span(moves_).subspan(ends_[i - 1], ends_[i] - ends_[i - 1]));
}

float LoopCollapse::rank() {
  const uint32_t target = positions_[0];
  float rank = 0.0f;
  for (size_t i = 1; i < positions_.size(); ++i) {
    const uint32_t p = positions_[i];
    rank += costs_.rank_of_position(p, target);
    map_wedges(i);
    rank += costs_.rank_of_wedges(p, target);
  }
  // Those with two positions of the loop are in two of its rings.
  size_t twice = 0;
  for (uint32_t p : positions_)
    for (const LinkEdge& e : mesh_.link(p)) twice += contains(e.next) || contains(e.prev);
  return 4.0f * rank / static_cast<float>(std::max<size_t>(twice, 4));
}

}  // namespace umbel::lod
