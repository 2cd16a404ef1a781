#include "lod/simplify/collapse_methods.hpp"

#include <algorithm>
#include <utility>

namespace umbel::lod {
namespace {

// Components may be removed where the error is more than this part of the group's extent.
constexpr float kPruneAbove = 0.01f;
// What one collapse may cost attributes in any case, as a part of the group's extent.
constexpr float kAttributeLoss = 0.01f;
// Of the triangles; to get from these to the target only collapses are done that cost little more.
constexpr float kLimitBelow = 0.85f;

bool differ_in_extras(const Mesh& mesh, uint32_t a, uint32_t b) {
  if (mesh.extras.empty()) return false;
  const size_t width = extra_width(mesh.extras);
  const float* values = mesh.extra_values.data();
  return !std::equal(values + a * width, values + (a + 1) * width, values + b * width);
}

bool are_mirrored(const Mesh& mesh, uint32_t a, uint32_t b) {
  return !mesh.tangents.empty() && mesh.tangents[a].w != mesh.tangents[b].w;
}

}  // namespace

// The rule of each position, by what its vertices differ in.
void CollapseMethods::find_seam_rules() {
  rules_.clear();
  const SeamRule seams = group_.config.seams, creases = group_.config.creases;
  if (!group_.source.has_wedges || (seams == SeamRule::kAllow && creases == SeamRule::kAllow))
    return;
  const Mesh& mesh = group_.source.mesh;
  const auto differ = [](const auto& stream, uint32_t a, uint32_t b) {
    return !stream.empty() && stream[a] != stream[b];
  };
  rules_.assign(group_.position_count(), SeamRule::kIgnore);
  std::vector<uint32_t> first(group_.position_count(), kNone);
  for (uint32_t i = 0; i < group_.vertices.size(); ++i) {
    const uint32_t v = group_.vertices[i], p = group_.position_of[i];
    if (first[p] == kNone) first[p] = v;
    const uint32_t other = first[p];
    if (differ(mesh.uvs, v, other) || differ(mesh.colors, v, other) ||
        differ_in_extras(mesh, v, other) || are_mirrored(mesh, v, other))
      rules_[p] = std::min(rules_[p], seams);
    if (differ(mesh.normals, v, other) || differ(mesh.tangents, v, other))
      rules_[p] = std::min(rules_[p], creases);
  }
}

CollapseInput CollapseMethods::input() {
  find_seam_rules();
  materials_ = group_.materials();
  CollapseInput input;
  input.triangles = group_.triangles;
  input.position_of = group_.position_of;
  input.positions = group_.positions;
  input.attributes = group_.attributes.values();
  input.attribute_weights = group_.attributes.weights();
  input.locked = group_.locked;
  input.non_manifold_component = group_.non_manifold_component;
  input.allow_locked_edges = check_.allowance().locked_edges;
  input.taken = check_.allowance().taken;
  input.position_ids = group_.position_ids;
  input.materials = materials_;
  input.rules = rules_;
  return input;
}

Candidate CollapseMethods::regular(size_t target, size_t good) {
  CollapseInput given = input();
  given.limit_below = static_cast<size_t>(kLimitBelow * group_.triangles.size());
  // Without non-manifold edges and seams, the next method has nothing more to permit.
  if (!group_.has_non_manifold && !group_.source.has_wedges) given.unlimited_until = good;
  given.pause_above = kPruneAbove;
  given.pause_until = good;
  given.keep_attributes_below = good;
  given.attribute_loss = kAttributeLoss;
  run_with_removal(given, target);
  if (group_.has_non_manifold && collapser_.has_moved_non_manifold() &&
      !check_.faults(collapser_.triangles()).empty()) {
    given.move_non_manifold = false;
    run_with_removal(given, target);
  }
  Candidate candidate = result();
  if (collapser_.removed_radius() > 0) {
    candidate.removed_radius = collapser_.removed_radius() / group_.source.scale;
    candidate.method = SimplifyMethod::kPrune;
  }
  candidate.locked_edges = collapser_.locked_edges();
  candidate.valid = true;
  if (group_.config.refit_attributes && !group_.attributes.weights().empty())
    refit_attributes(candidate);
  return candidate;
}

// Small components may be removed once larger ones would pay for keeping them.
void CollapseMethods::run_with_removal(const CollapseInput& input, size_t target) {
  collapser_.run(input, target);
  if (!collapser_.is_paused()) return;
  components_.find();
  const std::vector<float> radii = components_.removable_radii();
  collapser_.resume(components_.of_positions(), radii);
}

Candidate CollapseMethods::non_manifold(size_t target, bool allow_flips) {
  CollapseInput given = input();
  given.non_manifold_moves = true;
  given.rules = {};
  given.allow_flips = allow_flips;
  collapser_.run(given, target);
  Candidate candidate = result();
  candidate.method = SimplifyMethod::kPermissive;
  check_.accept_if_sound(candidate);
  return candidate;
}

Candidate CollapseMethods::result() const {
  Candidate candidate;
  candidate.triangles = collapser_.triangles();
  candidate.error = collapser_.error() / group_.source.scale;
  candidate.attribute_error = collapser_.attribute_error() / group_.source.scale;
  return candidate;
}

// Of what the collapser has just made (Hoppe 1999).
void CollapseMethods::refit_attributes(Candidate& candidate) const {
  const size_t count = group_.attributes.weights().size();
  std::vector<uint8_t> seen(group_.vertices.size(), 0);
  std::vector<float> values(count);
  for (const Triangle& t : candidate.triangles)
    for (uint32_t v : t) {
      if (std::exchange(seen[v], 1)) continue;
      std::copy_n(group_.attributes.values().begin() + count * v, count, values.begin());
      if (!collapser_.refit(v, values)) continue;
      candidate.refitted.push_back(v);
      candidate.refitted_values.insert(candidate.refitted_values.end(), values.begin(),
                                       values.end());
    }
}

}  // namespace umbel::lod
