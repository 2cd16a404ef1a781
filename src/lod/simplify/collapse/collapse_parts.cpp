// Separate parts of a sub-mesh that EdgeCollapser leaves out whole, in their turn among the
// collapses: what leaving one out costs is shared out among the collapses whose place it takes.
#include <algorithm>
#include <cmath>
#include <utility>

#include "lod/simplify/collapse/collapse.hpp"

namespace umbel::lod {

void EdgeCollapser::load_parts() {
  const size_t count = input_.part_radii.size();
  part_areas_.assign(count, 0.0f);
  part_live_.assign(count, 0);
  part_offsets_.assign(count + 1, 0);
  removed_radius_ = 0.0f;
  if (count == 0) return;
  const auto part_of = [&](const Triangle& t) { return input_.part_of[positions_of(t)[0]]; };
  for (const Triangle& t : triangles_) {
    const auto [a, b, c] = positions_of(t);
    ++part_live_[input_.part_of[a]];
    part_areas_[input_.part_of[a]] +=
        0.5f * length(cross(point(b) - point(a), point(c) - point(a)));
  }
  for (size_t i = 0; i < count; ++i) part_offsets_[i + 1] = part_offsets_[i] + part_live_[i];
  std::vector<uint32_t> cursor(part_offsets_.begin(), part_offsets_.end() - 1);
  part_triangles_.resize(triangles_.size());
  for (uint32_t t = 0; t < triangles_.size(); ++t)
    part_triangles_[cursor[part_of(triangles_[t])]++] = t;
}

void EdgeCollapser::enqueue_parts() {
  for (uint32_t part = 0; part < input_.part_radii.size(); ++part)
    if (std::isfinite(input_.part_radii[part]) && part_live_[part] > 0)
      queue_.set(key_of_part(part), rank_of_part(part));
}

// Every point of it moves by its radius at most; a collapse takes two triangles away. Quadrics
// count each triangle at its three corners.
float EdgeCollapser::rank_of_part(uint32_t part) const {
  const float radius = input_.part_radii[part], weight = 3.0f * part_areas_[part];
  const float collapses = std::max(0.5f * static_cast<float>(part_live_[part]), 1.0f);
  return radius * radius * weight * scale_of(weight) / collapses;
}

// Unless it has fewer triangles by now than its rank says, then later.
void EdgeCollapser::leave_out(uint32_t part, size_t target, float most_squared) {
  const auto triangles =
      std::span(part_triangles_)
          .subspan(part_offsets_[part], part_offsets_[part + 1] - part_offsets_[part]);
  const uint32_t live = static_cast<uint32_t>(
      std::count_if(triangles.begin(), triangles.end(), [&](uint32_t t) { return !dead_[t]; }));
  if (std::exchange(part_live_[part], live) != live) {
    queue_.set(key_of_part(part), rank_of_part(part));
    return;
  }
  const float radius = input_.part_radii[part];
  if (live_ < target + live || radius * radius > most_squared) return;
  removed_radius_ = std::max(removed_radius_, radius);
  live_ -= live;
  for (uint32_t t : triangles) {
    if (std::exchange(dead_[t], 1)) continue;
    for (uint32_t p : positions_of(triangles_[t])) {
      ring_of_[p].count = 0;
      kinds_[p] = Kind::kFixed;
      queue_.remove(p);
    }
  }
}

}  // namespace umbel::lod
