#include "lod/simplify/collapse/removable_components.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lod/simplify/collapse/collapse_costs.hpp"

namespace umbel::lod {

void RemovableComponents::load(std::span<const uint32_t> component_of,
                               std::span<const float> radii) {
  const CollapseInput& input = mesh_.input();
  radii_ = radii;
  areas_.assign(count(), 0.0f);
  left_.assign(count(), 0);
  offsets_.assign(count() + 1, 0);
  if (count() == 0) return;
  const size_t triangles = input.triangles.size();
  for (size_t t = 0; t < triangles; ++t) {
    const auto [a, b, c] = mesh_.positions_of(input.triangles[t]);
    const Vec3 origin = mesh_.point(a);
    ++left_[component_of[a]];
    areas_[component_of[a]] +=
        0.5f * length(cross(mesh_.point(b) - origin, mesh_.point(c) - origin));
  }
  for (size_t i = 0; i < count(); ++i) offsets_[i + 1] = offsets_[i] + left_[i];
  std::vector<uint32_t> cursor(offsets_.begin(), offsets_.end() - 1);
  triangles_.resize(triangles);
  for (uint32_t t = 0; t < triangles; ++t)
    triangles_[cursor[component_of[mesh_.positions_of(input.triangles[t])[0]]]++] = t;
  for (uint32_t c = 0; c < count(); ++c) recount(c);
}

bool RemovableComponents::is_removable(uint32_t component) const {
  return std::isfinite(radius(component)) && left_[component] > 0;
}

// Every point of it moves by its radius at most; a collapse takes two triangles away. Quadrics
// count each triangle at its three corners.
float RemovableComponents::rank(uint32_t component) const {
  const float r = radius(component), weight = 3.0f * areas_[component];
  const float collapses = std::max(0.5f * static_cast<float>(left_[component]), 1.0f);
  return r * r * weight * CollapseCosts::scale_of(weight) / collapses;
}

bool RemovableComponents::recount(uint32_t component) {
  const auto all = triangles(component);
  const uint32_t left = static_cast<uint32_t>(
      std::count_if(all.begin(), all.end(), [&](uint32_t t) { return !mesh_.is_removed(t); }));
  return std::exchange(left_[component], left) == left;
}

}  // namespace umbel::lod
