#include "lod/simplify/group_components.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "lod/dag/topology.hpp"

namespace umbel::lod {
namespace {

// With less than this part of the triangles, components make too little room for the rest.
constexpr double kLeastRemovable = 0.02;
// Components come back if that lowers the radius of the largest one that is gone to this part.
constexpr float kWorthwhile = 0.8f;

}  // namespace

void GroupComponents::find() {
  if (std::exchange(is_known_, true)) return;
  of_positions_.resize(group_.position_count());
  std::iota(of_positions_.begin(), of_positions_.end(), 0u);
  const auto root = [&](uint32_t p) {
    while (of_positions_[p] != p) p = of_positions_[p] = of_positions_[of_positions_[p]];
    return p;
  };
  for (const Triangle& t : group_.position_triangles()) {
    uint32_t lowest = root(t[0]);
    for (const uint32_t other : {root(t[1]), root(t[2])}) {
      of_positions_[std::max(lowest, other)] = std::min(lowest, other);
      lowest = std::min(lowest, other);
    }
  }
  // Roots are the lowest of their component, so one pass numbers all.
  components_.clear();
  for (uint32_t p = 0; p < of_positions_.size(); ++p) {
    if (of_positions_[p] == p) {
      of_positions_[p] = static_cast<uint32_t>(components_.size());
      components_.push_back({});
    } else {
      of_positions_[p] = of_positions_[of_positions_[p]];
    }
    components_[of_positions_[p]].fixed |= group_.locked[p] != 0;
  }
  with_materials_.resize(group_.vertices.size());
  for (uint32_t v = 0; v < group_.vertices.size(); ++v) {
    const uint32_t component = of_positions_[group_.position_of[v]];
    extend(components_[component].box, group_.positions[v]);
    with_materials_[v] = uint64_t{group_.material(v)} << 32 | component;
  }
}

bool GroupComponents::has_main() const {
  std::vector<size_t> counts(components_.size(), 0);
  for (const Triangle& t : group_.triangles)
    if (2 * ++counts[of(t)] > group_.triangles.size()) return true;
  return false;
}

std::vector<float> GroupComponents::removable_radii() const {
  size_t removable = 0;
  for (const Triangle& t : group_.triangles) removable += !components_[of(t)].fixed;
  if (static_cast<double>(removable) < kLeastRemovable * group_.triangles.size()) return {};
  std::vector<float> radii;
  for (const Component& component : components_)
    radii.push_back(component.fixed ? std::numeric_limits<float>::infinity() : component.radius());
  return radii;
}

Candidate GroupComponents::prune(const Candidate& from, size_t target) const {
  std::vector<uint32_t> triangles_of(components_.size(), 0);
  for (const Triangle& t : from.triangles) ++triangles_of[of(t)];
  std::vector<uint32_t> order(components_.size());
  std::iota(order.begin(), order.end(), 0u);
  std::erase_if(order, [&](uint32_t c) { return triangles_of[c] == 0; });
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return components_[a].radius() < components_[b].radius();
  });
  std::vector<uint8_t> removed(components_.size(), 0);
  size_t left = from.triangles.size();
  for (size_t i = 0; i + 1 < order.size() && left > target; ++i) {
    if (components_[order[i]].fixed) continue;
    removed[order[i]] = 1;
    left -= triangles_of[order[i]];
  }
  Candidate result = from;
  // Verification knows new positions by their method.
  if (!result.renews_positions) result.method = SimplifyMethod::kPrune;
  std::erase_if(result.triangles, [&](const Triangle& t) { return removed[of(t)]; });
  return result;
}

float GroupComponents::restore(size_t most_triangles, std::vector<Triangle>& triangles) const {
  if (components_.size() == 1 && !triangles.empty()) return 0.0f;
  constexpr uint8_t kPresent = 1, kRestored = 2;
  std::vector<uint8_t> state(components_.size(), 0);
  for (const Triangle& t : triangles) state[of(t)] = kPresent;
  std::vector<uint32_t> removed, triangles_of(components_.size(), 0);
  for (const Triangle& t : group_.triangles)
    if (const uint32_t c = of(t); !state[c] && triangles_of[c]++ == 0) removed.push_back(c);
  if (removed.empty()) return 0.0f;
  std::stable_sort(removed.begin(), removed.end(), [&](uint32_t a, uint32_t b) {
    return components_[a].radius() > components_[b].radius();
  });
  size_t restored = 0, count = triangles.size();
  while (restored < removed.size() && count + triangles_of[removed[restored]] <= most_triangles)
    count += triangles_of[removed[restored++]];
  const float scale = group_.source.scale;
  const float largest = components_[removed[0]].radius();
  const float left = restored < removed.size() ? components_[removed[restored]].radius() : 0.0f;
  if (left > kWorthwhile * largest) return largest / scale;
  for (size_t i = 0; i < restored; ++i) state[removed[i]] = kRestored;
  for (const Triangle& t : group_.triangles)
    if (state[of(t)] == kRestored) triangles.push_back(t);
  return left / scale;
}

bool GroupComponents::restore_held(std::vector<Triangle>& triangles) {
  std::vector<uint8_t> is_lost(group_.position_count());
  for (uint32_t p = 0; p < is_lost.size(); ++p) is_lost[p] = group_.locked[p] == kHeld;
  for (const Triangle& t : triangles)
    for (uint32_t p : group_.positions_of(t)) is_lost[p] = 0;
  if (std::find(is_lost.begin(), is_lost.end(), 1) == is_lost.end()) return false;
  find();
  std::vector<uint8_t> comes_back(components_.size(), 0);
  for (uint32_t p = 0; p < is_lost.size(); ++p)
    if (is_lost[p]) comes_back[of_positions_[p]] = 1;
  std::erase_if(triangles, [&](const Triangle& t) { return comes_back[of(t)] != 0; });
  for (const Triangle& t : group_.triangles)
    if (comes_back[of(t)]) triangles.push_back(t);
  return true;
}

}  // namespace umbel::lod
