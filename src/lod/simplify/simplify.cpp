#include "lod/simplify/simplify.hpp"

#include <algorithm>
#include <utility>

#include "lod/simplify/add_refitted.hpp"
#include "lod/simplify/decimate.hpp"
#include "lod/simplify/keep_area.hpp"
#include "lod/simplify/move_vertices.hpp"

namespace umbel::lod {
namespace {

// A result that keeps more than this part of the triangles moves on to the next method.
constexpr double kGoodEnough = 0.7;
// And one that keeps more than this after the last method is not worth a level, unless the ratio
// asks for no less.
constexpr double kStuck = 0.85;

// How far what was there is from what is left.
float deviation(const Candidate& candidate) {
  return std::max({candidate.error, candidate.attribute_error, candidate.removed_radius});
}

}  // namespace

Simplified GroupSimplifier::simplify(const ClusterSet& set, std::span<const uint32_t> clusters,
                                     std::span<const uint8_t> locked, const Allowance& allow) {
  group_.gather(set, clusters, locked);
  components_.reset();
  check_.reset(allow);
  size_t before = 0;
  for (uint32_t c : clusters) before += set.triangle_offsets[c + 1] - set.triangle_offsets[c];
  const Config& config = group_.config;
  const size_t target = static_cast<size_t>(before * static_cast<double>(allow.ratio));
  const size_t good = std::max(target, static_cast<size_t>(before * kGoodEnough));
  const size_t worthwhile = std::max(target, static_cast<size_t>(before * kStuck));

  Candidate best;
  best.triangles = group_.triangles;
  best.valid = true;  // the group itself, less what is degenerate or repeated
  Simplified result;
  bool by_caller = false;
  if (best.triangles.size() > target) {
    by_caller = decimate_ && allow.by_caller && allow.new_positions &&
                decimate_by_caller(decimate_, target, worthwhile, group_, check_, best);
    result.limiting_factor = by_caller ? LimitingFactor::kCaller : try_methods(target, good, best);
  }
  // A component may shrink to the only one of its positions that is held.
  if (!by_caller && !best.renews_positions && components_.restore_held(best.triangles))
    result.limiting_factor = LimitingFactor::kLocked;
  if (!best.valid || best.triangles.size() > worthwhile) return result;
  result.done = true;
  if (best.removed_radius > 0)
    result.removed_radius = best.removed_radius;
  else if (components_.is_known())
    result.removed_radius = components_.restore(good, best.triangles);
  result.error = best.error;
  result.attribute_error = best.attribute_error;
  result.method = best.method;
  for (const auto& [a, b] : best.locked_edges)
    result.locked_edges.push_back({group_.position_ids[a], group_.position_ids[b]});
  result.added = std::move(best.added);
  result.mesh = sub_mesh_of(best, result.added);
  add_refitted(group_, best, result);
  if (best.renews_positions)
    renew_positions(group_, result);
  else if (config.keep_area && !by_caller && best.triangles.size() < group_.triangles.size()) {
    if (allow.new_positions || allow.unused)
      keep_area(group_, components_, collapse_.area(), allow.new_positions ? nullptr : allow.unused,
                result);
    else if (loses_area(group_, components_, collapse_.area(), result))
      result.limiting_factor = LimitingFactor::kAreaLost;
  }
  return result;
}

// Each method is tried only if those before it left more than `good` triangles, or had to move the
// surface far because topology let nothing else move.
LimitingFactor GroupSimplifier::try_methods(size_t target, size_t good, Candidate& best) {
  const auto is_good = [&] { return best.triangles.size() <= good; };
  const auto consider = [&](Candidate candidate) {
    if (candidate.valid && candidate.triangles.size() < best.triangles.size())
      best = std::move(candidate);
  };
  const auto prefer = [&](Candidate candidate) {
    if (!candidate.valid) return;
    const bool enough = candidate.triangles.size() <= good;
    if (enough && is_good() ? deviation(candidate) < deviation(best)
                            : candidate.triangles.size() < best.triangles.size())
      best = std::move(candidate);
  };
  LimitingFactor limit = LimitingFactor::kNone;
  consider(collapse_.regular(
      target, std::max(target, static_cast<size_t>(kGoodEnough * group_.triangles.size()))));
  if (best.method == SimplifyMethod::kPrune) limit = LimitingFactor::kSmallComponents;
  const bool forced = collapse_.was_forced();
  if (!is_good() || forced) limit = collapse_.limiting_factor();
  if (!is_good() || forced || collapse_.may_lose_components()) components_.find();

  const Config& config = group_.config;
  const bool last_resort = check_.allowance().last_resort;
  const bool protects_seams =
      config.seams == SeamRule::kProtect || config.creases == SeamRule::kProtect;
  const bool across_seams = !protects_seams || last_resort;
  if (across_seams && (!is_good() || forced)) {
    const bool unbound = meshopt_.may_be_unbound();
    prefer(unbound ? meshopt_.unbound(target) : meshopt_.permissive(target));
    // Cells do not ask which side of a seam a vertex is on.
    if (unbound && group_.attributes.weights().empty()) prefer(meshopt_.merge_cells(target));
    prefer(collapse_.non_manifold(target, true));
    if (!is_good()) prefer(collapse_.non_manifold(target, false));
  }
  if (!is_good()) consider(components_.prune(best, target));
  if (!last_resort) return limit;
  if (!is_good()) consider(collapse_.non_manifold(target, true));
  if (!is_good()) consider(components_.prune(best, target));
  if (!is_good()) consider(replace_patches(best, target, remove_patches));
  if (!is_good()) consider(meshopt_.merge_cells(target));
  if (!is_good()) consider(replace_patches(best, target, cap_patches));
  return limit;
}

Candidate GroupSimplifier::replace_patches(const Candidate& from, size_t target,
                                           PatchChange change) {
  Candidate result;
  result.method = SimplifyMethod::kSloppy;
  result.triangles = from.triangles;
  const std::vector<uint32_t> materials = group_.materials();
  const float moved = change({group_.position_of, group_.positions, group_.locked,
                              group_.non_manifold_component, materials},
                             target, result.triangles);
  result.error = std::max(from.error, moved / group_.source.scale);
  check_.accept_if_sound(result);
  return result;
}

SubMesh GroupSimplifier::sub_mesh_of(const Candidate& candidate, const AddedVertices& added) const {
  SubMesh mesh{candidate.triangles, group_.vertices, group_.positions, group_.materials()};
  if (group_.source.scale == 1.0f) return mesh;
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    const uint32_t v = mesh.vertices[i];
    mesh.positions[i] = v >= kAddedVertex ? added.mesh.positions[v - kAddedVertex]
                                          : group_.source.mesh.positions[v];
  }
  return mesh;
}

}  // namespace umbel::lod
