#include "lod/simplify/meshopt_methods.hpp"

#include <meshoptimizer.h>

#include <limits>

namespace umbel::lod {
namespace {

// meshoptimizer counts a difference of 1 as a part of the group's extent: ours, where a vertex
// stands for some hundredths of the area.
constexpr float kPerExtent = 0.05f;
// Tries with more and more vertices held before the method is given up.
constexpr int kMostTries = 8;
// Merging vertices by cell loses the look sooner than its distance says.
constexpr float kCellErrorFactor = 2.0f;

const unsigned* indices(std::span<const Triangle> triangles) {
  return triangles.empty() ? nullptr : triangles.data()->data();
}

float extent_of(const GroupMesh& group) {
  return meshopt_simplifyScale(&group.positions[0].x, group.positions.size(), sizeof(Vec3));
}

}  // namespace

// meshoptimizer divides by the extent, which has no reciprocal where it is smaller than this.
bool MeshoptMethods::is_suitable() const {
  const float extent = extent_of(group_);
  return extent == 0 || extent > 1e-36f;
}

Candidate MeshoptMethods::permissive(size_t target) {
  if (!is_suitable()) return {};
  held_.assign(group_.position_count(), 0);
  for (int attempt = 0; attempt < kMostTries; ++attempt) {
    Candidate result = collapse(target);
    if (group_.mixes_materials(result.triangles)) return result;
    const auto found = check_.repair(components_, result);
    if (found.empty()) {
      check_.accept(result);
      return result;
    }
    // If the triangles at one end of an edge do not change, that edge cannot come into being.
    for (const auto& [a, b] : found) hold_around(group_.locked[b] && !group_.locked[a] ? b : a);
  }
  return {};
}

Candidate MeshoptMethods::unbound(size_t target) {
  if (!is_suitable()) return {};
  held_.assign(group_.position_count(), 0);
  Candidate result = collapse(target);
  accept_unbound(result);
  return result;
}

// Verification knows new positions by this method.
void MeshoptMethods::accept_unbound(Candidate& candidate) const {
  if (candidate.triangles.empty() || group_.mixes_materials(candidate.triangles)) return;
  candidate.valid = candidate.renews_positions = true;
  candidate.method = SimplifyMethod::kSloppy;
}

Candidate MeshoptMethods::collapse(size_t target) {
  const auto attribute_values = group_.attributes.values();
  const auto attribute_weights = group_.attributes.weights();
  const size_t attributes = attribute_weights.size();
  unsigned options = meshopt_SimplifyPermissive | meshopt_SimplifyErrorAbsolute;
  if (attributes > 0) options |= meshopt_SimplifyErrorClamped;
  flags_.resize(group_.vertices.size());
  for (size_t v = 0; v < flags_.size(); ++v) {
    const uint32_t p = group_.position_of[v];
    flags_[v] = group_.locked[p] || held_[p] ? meshopt_SimplifyVertex_Lock : 0;
    if (group_.is_material_border(p)) flags_[v] |= meshopt_SimplifyVertex_Protect;
  }
  Candidate result;
  result.method = SimplifyMethod::kPermissive;
  result.triangles.resize(group_.triangles.size());
  std::vector<float> weights(attribute_weights.begin(), attribute_weights.end());
  for (float& weight : weights) weight *= kPerExtent;
  const size_t count = meshopt_simplifyWithAttributes(
      result.triangles.data()->data(), indices(group_.triangles), 3 * group_.triangles.size(),
      &group_.positions[0].x, group_.positions.size(), sizeof(Vec3), attribute_values.data(),
      attributes * sizeof(float), weights.data(), attributes, flags_.data(), 3 * target,
      std::numeric_limits<float>::max(), options, &result.error);
  result.triangles.resize(count / 3);
  result.error /= group_.source.scale;
  return result;
}

void MeshoptMethods::hold_around(uint32_t position) {
  held_[position] = 1;
  for (const Triangle& t : group_.position_triangles())
    if (t[0] == position || t[1] == position || t[2] == position)
      held_[t[0]] = held_[t[1]] = held_[t[2]] = 1;
}

Candidate MeshoptMethods::merge_cells(size_t target) {
  if (!is_suitable()) return {};
  flags_.resize(group_.vertices.size());
  for (size_t v = 0; v < flags_.size(); ++v) {
    const uint32_t p = group_.position_of[v];
    flags_[v] = group_.locked[p] || group_.is_material_border(p);
  }
  Candidate result;
  result.method = SimplifyMethod::kSloppy;
  result.triangles.resize(group_.triangles.size());
  const size_t count = meshopt_simplifySloppy(
      result.triangles.data()->data(), indices(group_.triangles), 3 * group_.triangles.size(),
      &group_.positions[0].x, group_.positions.size(), sizeof(Vec3), flags_.data(), 3 * target,
      std::numeric_limits<float>::max(), &result.error);
  result.triangles.resize(count / 3);
  result.error *= kCellErrorFactor / group_.source.scale * extent_of(group_);
  if (may_be_unbound())
    accept_unbound(result);
  else if (!group_.mixes_materials(result.triangles) && check_.repair(components_, result).empty())
    check_.accept(result);
  return result;
}

}  // namespace umbel::lod
