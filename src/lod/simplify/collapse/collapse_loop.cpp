// Loops of edges around a tube or a neck that bound no triangle, which EdgeCollapser draws together
// to a point: a handle closes, or a bulge goes, once that costs no more than other collapses do. No
// edge gets more than two triangles, but where the surface comes to touch itself a position has
// several fans.
#include <algorithm>
#include <limits>

#include "lod/simplify/collapse/collapse.hpp"

namespace umbel::lod {
namespace {

// Positions drawn together at once.
constexpr size_t kMostTogether = 8;

}  // namespace

// Finds what has to go to the target together with p, so that no edge has more than two triangles
// that the source does not allow. Right after the test of the link has failed.
bool EdgeCollapser::find_loop(uint32_t p, uint32_t target) {
  loop_.assign({target});
  loop_moves_.clear();
  loop_ends_.assign({0});
  const bool found =
      add_to_loop(p) && complete_loop() &&
      std::all_of(loop_.begin() + 1, loop_.end(), [&](uint32_t from) {
        return (input_.allow_flips || keeps_orientation_in_loop(from)) && map_loop_wedges(from);
      });
  mark_neighbours(p);
  return found;
}

bool EdgeCollapser::add_to_loop(uint32_t p) {
  const uint32_t component = input_.component[p];
  if (loop_.size() == kMostTogether || kinds_[p] == Kind::kFixed ||
      (component != kNone && component != input_.component[loop_[0]]))
    return false;
  loop_.push_back(p);
  return true;
}

bool EdgeCollapser::is_in_loop(uint32_t p) const {
  return std::find(loop_.begin(), loop_.end(), p) != loop_.end();
}

// Adds those whose edges to several of the loop would become one with too many triangles, or none.
// False where too many would go, or all that hangs together.
bool EdgeCollapser::complete_loop() {
  const uint32_t target = loop_[0], component = input_.component[target];
  around_loop_.clear();
  stamp_ += 2;  // one less: in the loop
  for (size_t known = 0; known < loop_.size();) {
    for (; known < loop_.size(); ++known) count_around(loop_[known]);
    for (const LoopNeighbour& n : around_loop_) {
      if (marks_[n.position] != stamp_) continue;
      if (input_.locked[target] && !n.at_target && input_.locked[n.position]) return false;
      if (!n.several || n.triangles == 1 || n.triangles == 2) continue;
      if (component != kNone && component == input_.component[n.position]) continue;
      if (!add_to_loop(n.position)) return false;
    }
  }
  return std::any_of(around_loop_.begin(), around_loop_.end(), [&](const LoopNeighbour& n) {
    return n.triangles > 0 && marks_[n.position] == stamp_;
  });
}

// Counts one more of the loop: its triangles with two others around come in, those that one of the
// loop had with it and another go.
void EdgeCollapser::count_around(uint32_t from) {
  const uint32_t is_around = stamp_, is_in_loop = stamp_ - 1;
  marks_[from] = is_in_loop;
  const auto around = [&](uint32_t x) -> LoopNeighbour& {
    if (marks_[x] != is_around) {
      marks_[x] = is_around;
      slots_[x] = static_cast<uint32_t>(around_loop_.size());
      around_loop_.push_back({x, from, 0, false, false});
    }
    LoopNeighbour& n = around_loop_[slots_[x]];
    n.several |= n.from != from;
    n.at_target |= from == loop_[0];
    return n;
  };
  for (const LinkEdge& s : ring(from)) {
    const bool next_goes = marks_[s.next] == is_in_loop, prev_goes = marks_[s.prev] == is_in_loop;
    if (!next_goes && !prev_goes)
      ++around(s.next).triangles, ++around(s.prev).triangles;
    else if (!next_goes)
      --around(s.next).triangles;
    else if (!prev_goes)
      --around(s.prev).triangles;
  }
}

bool EdgeCollapser::keeps_orientation_in_loop(uint32_t p) const {
  const Vec3 from = point(p), to = point(loop_[0]);
  return std::none_of(ring(p).begin(), ring(p).end(), [&](const LinkEdge& s) {
    return !is_in_loop(s.next) && !is_in_loop(s.prev) && flips(from, to, s);
  });
}

// Each vertex at p becomes the one of its material that costs least.
bool EdgeCollapser::map_loop_wedges(uint32_t p) {
  const uint32_t target = loop_[0];
  const bool is_single = !has_wedges_ || wedge_counts_[p] == 1;
  if (!is_single && (rule(p) == SeamRule::kProtect || rule(target) == SeamRule::kProtect))
    return false;
  const Vec3 d = point(target) - point(p);
  wedge_map_.clear();
  for (size_t i = 0; i < ring(p).size(); ++i) {
    const uint32_t from = vertex(corner(p, i));
    if (mapped(from) != kNone) continue;
    const uint32_t to = has_wedges_ ? cheapest_wedge(from, target, d) : target;
    if (to == kNone) return false;
    wedge_map_.push_back({from, to, is_single});
  }
  loop_moves_.insert(loop_moves_.end(), wedge_map_.begin(), wedge_map_.end());
  loop_ends_.push_back(loop_moves_.size());
  return true;
}

// Of the i-th position of the loop.
void EdgeCollapser::take_loop_wedges(size_t i) {
  wedge_map_.assign(loop_moves_.begin() + loop_ends_[i - 1], loop_moves_.begin() + loop_ends_[i]);
}

// Of drawing the loop together, shared out among the collapses whose place it takes: each takes two
// triangles away.
float EdgeCollapser::rank_of_loop() {
  const uint32_t target = loop_[0];
  float rank = 0.0f;
  for (size_t i = 1; i < loop_.size(); ++i) {
    const uint32_t p = loop_[i];
    rank += position_choice(p, target).rank;
    if (attribute_count_ == 0) continue;
    take_loop_wedges(i);
    rank += wedge_cost(point(target) - point(p)) * quadrics_[p].weight * quadrics_[p].scale;
  }
  // Those with two positions of the loop are in two of its rings.
  size_t twice = 0;
  for (uint32_t p : loop_)
    for (const LinkEdge& s : ring(p)) twice += is_in_loop(s.next) || is_in_loop(s.prev);
  return 4.0f * rank / static_cast<float>(std::max<size_t>(twice, 4));
}

// The one that was found last.
void EdgeCollapser::collapse_loop() {
  const uint32_t target = loop_[0];
  std::vector<uint32_t> around = {target};
  for (size_t i = 1; i < loop_.size(); ++i) {
    const uint32_t p = loop_[i];
    list_all_neighbours(p, target);
    take_loop_wedges(i);
    merge_quadrics(p, target);
    around.insert(around.end(), neighbours_.begin(), neighbours_.end());
    move_ring(p, target);
    queue_.remove(p);
  }
  for (uint32_t x : around) kinds_[x] = kind_of(x);
  for (uint32_t x : around)
    if (kinds_[x] == Kind::kFixed)
      queue_.remove(x);
    else
      enqueue_best(x);
}

}  // namespace umbel::lod
