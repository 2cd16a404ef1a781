#include "lod/simplify/collapse/link_condition.hpp"

#include <algorithm>

namespace umbel::lod {

using Kind = CollapseMesh::Kind;

void LinkCondition::reset() {
  marks_.assign(mesh_.position_count(), 0);
  stamp_ = 0;
}

bool LinkCondition::holds(uint32_t p, uint32_t target) {
  return mesh_.moves_non_manifold(p) ? holds_non_manifold(p, target) : holds_manifold(p, target);
}

// Only the third corners at the edge may be neighbours of both ends.
bool LinkCondition::holds_manifold(uint32_t p, uint32_t target) {
  find_opposites(p, target);
  const auto [a, b] = opposite_;
  const uint32_t around = mesh_.rings().size(p);
  // The last triangles of a component stay, and so does one whose place another takes.
  if (around == opposites_ && mesh_.rings().size(target) == around) return false;
  const uint32_t* const marks = marks_.data();
  const auto link = mesh_.link(target);
  bool shared = false;
  for (const LinkEdge& e : link) shared |= marks[e.next] == stamp_ && e.next != a && e.next != b;
  if (mesh_.kind(target) != Kind::kInterior)
    for (const LinkEdge& e : link) shared |= marks[e.prev] == stamp_ && e.prev != a && e.prev != b;
  has_loop_ = shared;
  if (shared) return false;
  if (around == 3 && opposites_ == 2)
    for (const LinkEdge& e : link)
      if (std::minmax(e.next, e.prev) == std::minmax(a, b)) return false;
  if (!mesh_.input().locked[target]) return true;
  list(p, target);
  return keeps_locked_edges(target);
}

// Hardly anything branches on what comes next, which no processor can predict.
void LinkCondition::list(uint32_t p, uint32_t target) {
  const auto link = mesh_.link(p);
  if (room_.size() < 2 * link.size() + 1) room_.resize(4 * link.size() + 1);
  uint32_t* const list = room_.data();
  const auto [a, b] = opposite_;
  list[0] = a, list[1] = b;
  size_t count = opposites_;
  uint32_t last = kNone;  // of an open fan, the position that no triangle starts with
  for (const LinkEdge& e : link) {
    const uint32_t x = e.next;
    list[count] = x;
    count += x != target && x != a && x != b;
  }
  if (mesh_.kind(p) != Kind::kInterior) {
    for (const LinkEdge& e : link)
      if (std::none_of(link.begin(), link.end(),
                       [&](const LinkEdge& o) { return o.next == e.prev; }))
        last = e.prev;
    if (last != kNone && last != target && last != a && last != b) list[count++] = last;
  }
  neighbours_ = {list, count};
}

// An edge that comes to have four triangles must be allowed by the source: its ends are in one
// component of non-manifold edges. So must those that have an odd number already.
bool LinkCondition::holds_non_manifold(uint32_t p, uint32_t target) {
  const auto& components = mesh_.input().non_manifold_component;
  const uint32_t component = components[target];
  if (components[p] != kNone && components[p] != component) return false;
  list_any(p, target);
  const uint32_t is_other = stamp_;
  for (const LinkEdge& e : mesh_.link(target))
    for (uint32_t x : {e.next, e.prev})
      has_loop_ |= marks_[x] == is_other && (component == kNone || components[x] != component);
  return !has_loop_ && keeps_locked_edges(target);
}

// Marks all but the third corners with the last stamp.
void LinkCondition::list_any(uint32_t p, uint32_t target) {
  const uint32_t is_opposite = ++stamp_, is_other = ++stamp_;
  const auto link = mesh_.link(p);
  const size_t most = 2 * link.size();
  if (room_.size() < most) room_.resize(2 * most);
  size_t count = 0;
  const auto add = [&](uint32_t x, uint32_t mark) {
    if (x == target || marks_[x] >= is_opposite) return;
    marks_[x] = mark;
    room_[count++] = x;
  };
  for (const LinkEdge& e : link)
    if (e.next == target || e.prev == target) add(e.next == target ? e.prev : e.next, is_opposite);
  opposites_ = count;
  for (const LinkEdge& e : link) add(e.next, is_other), add(e.prev, is_other);
  neighbours_ = {room_.data(), count};
}

bool LinkCondition::keeps_locked_edges(uint32_t target) const {
  const CollapseInput& input = mesh_.input();
  if (!input.locked[target]) return true;
  return std::none_of(neighbours_.begin() + opposites_, neighbours_.end(), [&](uint32_t x) {
    if (!input.locked[x]) return false;
    const auto& ids = input.position_ids;
    return !input.allow_locked_edges ||
           (input.taken && input.taken->contains({ids[x], ids[target]}));
  });
}

}  // namespace umbel::lod
