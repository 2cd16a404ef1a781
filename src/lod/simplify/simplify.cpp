#include "lod/simplify/simplify.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "base/math.hpp"
#include "lod/simplify/non_manifold_repair.hpp"
#include "lod/simplify/patches.hpp"

namespace umbel::lod {
namespace {

// A result that keeps more than this part of the triangles moves to the next method of the ladder.
constexpr double kGoodEnough = 0.7;
// And one that keeps more than this after the last method is not worth a level.
constexpr double kStuck = 0.85;
// Components come back if that lowers the radius of the largest one that is gone to this part.
constexpr float kWorthwhile = 0.8f;
// Parts may be left out where the error is more than this part of the group's extent.
constexpr float kPruneAbove = 0.01f;
// With less than this part of the triangles they make too little room for the rest.
constexpr double kLeastPruned = 0.02;
// Of the triangles; to get from these to the target only collapses are done that cost little more.
constexpr float kLimitBelow = 0.85f;
// meshoptimizer counts a difference of 1 as a part of the group's extent: ours, where a vertex
// stands for some hundredths of the area.
constexpr float kPerExtent = 0.05f;
// Tries with more and more vertices held before a method is given up.
constexpr int kMostTries = 8;
// Merging vertices by cell loses the look sooner than its distance says.
constexpr float kCellErrorFactor = 2.0f;

const unsigned* indices(std::span<const Triangle> triangles) {
  return triangles.empty() ? nullptr : triangles.data()->data();
}

uint32_t hash(uint32_t key) { return key * 0x9e3779b1u; }

// Index into a power-of-two table where `is_match(value)` holds or the slot is empty.
template <typename Match>
uint32_t find_slot(const std::vector<uint32_t>& table, uint32_t key, const Match& is_match) {
  const uint32_t mask = static_cast<uint32_t>(table.size() - 1);
  uint32_t slot = hash(key) >> 8 & mask;
  while (table[slot] != kNone && !is_match(table[slot])) slot = (slot + 1) & mask;
  return slot;
}

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

GroupSimplifier::GroupSimplifier(const Source& source, const Config& config,
                                 const Decimator& decimate)
    : source_(source), config_(config), decimate_(decimate) {}

Simplified GroupSimplifier::simplify(const ClusterSet& set, std::span<const uint32_t> clusters,
                                     std::span<const uint8_t> locked, Allowance allow) {
  allow_ = allow;
  gather(set, clusters, locked);
  size_t before = 0;
  for (uint32_t c : clusters) before += set.triangle_offsets[c + 1] - set.triangle_offsets[c];
  const size_t target = static_cast<size_t>(before * static_cast<double>(config_.ratio));
  const size_t good = static_cast<size_t>(before * kGoodEnough);

  Candidate best;
  best.triangles = triangles_;
  best.valid = true;  // the sub-mesh itself, less what is degenerate or repeated
  const auto consider = [&](Candidate candidate) {
    if (candidate.valid && (!best.valid || candidate.triangles.size() < best.triangles.size()))
      best = std::move(candidate);
  };
  const size_t worthwhile = static_cast<size_t>(before * kStuck);
  const bool by_caller =
      decimate_ && best.triangles.size() > target && ask_caller(target, worthwhile, best);
  Simplified result;
  if (by_caller) result.limiting_factor = LimitingFactor::kCaller;
  if (!by_caller && best.triangles.size() > target) {
    consider(collapse_regular(target));
    if (best.method == SimplifyMethod::kPrune)
      result.limiting_factor = LimitingFactor::kSmallComponents;
    if (best.triangles.size() > good) result.limiting_factor = collapser_.limiting_factor();
    if (best.triangles.size() > good || has_non_manifold_) prepare_repair();
    const bool across = !protects_seams() || allow.last_resort;
    if (across && best.triangles.size() > good)
      consider(collapse_checked(target, meshopt_SimplifyPermissive, SimplifyMethod::kPermissive));
    if (across && best.triangles.size() > good) consider(collapse_non_manifold(target, false));
    if (best.triangles.size() > good) consider(prune(best, target));
    if (allow.last_resort) {
      if (best.triangles.size() > good) consider(collapse_non_manifold(target, true));
      if (best.triangles.size() > good) consider(prune(best, target));
      if (best.triangles.size() > good) consider(replace_patches(best, target, remove_patches));
      if (best.triangles.size() > good) consider(merge_cells(target));
      if (best.triangles.size() > good) consider(replace_patches(best, target, cap_patches));
    }
  }

  const auto to_ids = [&](std::span<const PositionPair> edges) {
    std::vector<PositionPair> ids;
    for (const auto& [a, b] : edges) ids.push_back({position_ids_[a], position_ids_[b]});
    return ids;
  };
  if (!best.valid || best.triangles.size() > worthwhile) return result;
  result.done = true;
  if (best.pruned > 0)
    result.removed_radius = best.pruned;
  else if (has_parts_)
    result.removed_radius = restore_components(good, best.triangles);
  result.error = best.error;
  result.attribute_error = best.attribute_error;
  result.method = best.method;
  result.locked_edges = to_ids(best.locked_edges);
  result.added = std::move(best.added);
  leave(best, result);
  add_refitted(best, result);
  if (config_.keep_area && !by_caller && best.triangles.size() < triangles_.size())
    keep_area(best, result);
  return result;
}

void GroupSimplifier::leave(Candidate& best, const Simplified& result) {
  left_.triangles = best.triangles;
  left_.vertices = vertices_;
  left_.positions = positions_;
  if (source_.scale != 1.0f)
    for (size_t v = 0; v < vertices_.size(); ++v) {
      const bool is_added = vertices_[v] >= kAddedVertex;
      const Mesh& mesh = is_added ? result.added.mesh : source_.mesh;
      left_.positions[v] = mesh.positions[is_added ? vertices_[v] - kAddedVertex : vertices_[v]];
    }
  left_.materials.clear();
  if (source_.vertex_materials.empty()) return;
  for (uint32_t v = 0; v < vertices_.size(); ++v) left_.materials.push_back(material(v));
}

uint32_t GroupSimplifier::local_vertex(uint32_t vertex) {
  const size_t mask = vertex_table_.size() - 1;
  size_t slot = hash(vertex) >> 8 & mask;
  while (vertex_table_[slot].vertex != vertex) {
    if (vertex_table_[slot].vertex == kNone) {
      vertex_table_[slot] = {vertex, static_cast<uint32_t>(vertices_.size())};
      vertices_.push_back(vertex);
      break;
    }
    slot = (slot + 1) & mask;
  }
  return vertex_table_[slot].local;
}

// Numbers the positions of vertices_ by first use.
void GroupSimplifier::gather_positions(std::span<const uint8_t> locked) {
  const size_t count = vertices_.size();
  position_of_.resize(count);
  positions_.resize(count);
  position_ids_.clear();
  if (!source_.has_wedges) {
    std::iota(position_of_.begin(), position_of_.end(), 0u);
    position_ids_ = vertices_;
  } else {
    position_table_.assign(std::bit_ceil(count + count / 2 + 1), kNone);
    for (size_t v = 0; v < count; ++v) {
      const uint32_t id = source_.position_ids[vertices_[v]];
      const uint32_t slot =
          find_slot(position_table_, id, [&](uint32_t p) { return position_ids_[p] == id; });
      if (position_table_[slot] == kNone) {
        position_table_[slot] = static_cast<uint32_t>(position_ids_.size());
        position_ids_.push_back(id);
      }
      position_of_[v] = position_table_[slot];
    }
  }
  locked_.resize(position_ids_.size());
  components_.resize(position_ids_.size());
  for (size_t p = 0; p < position_ids_.size(); ++p) {
    locked_[p] = locked[position_ids_[p]];
    components_[p] = source_.non_manifold_components[position_ids_[p]];
  }
  for (size_t v = 0; v < count; ++v) {
    // meshoptimizer compares positions by their bits.
    const Vec3 p = source_.mesh.positions[position_ids_[position_of_[v]]] * source_.scale;
    positions_[v] = without_negative_zero(p);
  }
}

void GroupSimplifier::gather(const ClusterSet& set, std::span<const uint32_t> clusters,
                             std::span<const uint8_t> locked) {
  vertices_.clear();
  has_parts_ = false;
  triangles_.clear();
  size_t most_vertices = 0;
  for (uint32_t c : clusters) most_vertices += set.cluster_vertices(c).size();
  vertex_table_.assign(std::bit_ceil(most_vertices + most_vertices / 2 + 1), {kNone, kNone});

  uint32_t local[256];
  for (uint32_t c : clusters) {
    const auto vertices = set.cluster_vertices(c);
    for (size_t i = 0; i < vertices.size(); ++i) local[i] = local_vertex(vertices[i]);
    const auto corners = set.cluster_corners(c);
    for (size_t i = 0; i < corners.size(); i += 3)
      triangles_.push_back({local[corners[i]], local[corners[i + 1]], local[corners[i + 2]]});
  }
  gather_positions(locked);
  std::erase_if(triangles_, [&](const Triangle& t) {
    const uint32_t a = position_of_[t[0]], b = position_of_[t[1]], c = position_of_[t[2]];
    return a == b || b == c || c == a;
  });
  has_non_manifold_ = std::any_of(components_.begin(), components_.end(),
                                  [](uint32_t component) { return component != kNone; });
  drop_repeated_triangles();

  position_triangles_.clear();
  knows_topology_ = false;
  gather_attributes();
}

// The sub-mesh's own.
std::span<const Triangle> GroupSimplifier::position_triangles() {
  if (!source_.has_wedges) return triangles_;
  if (position_triangles_.empty())
    for (const Triangle& t : triangles_)
      position_triangles_.push_back({position_of_[t[0]], position_of_[t[1]], position_of_[t[2]]});
  return position_triangles_;
}

// What the methods below the first need to know. No component vanishes in the first.
void GroupSimplifier::prepare_repair() {
  find_spare_vertices();
  find_components();
}

void GroupSimplifier::find_spare_vertices() {
  spare_.assign(vertices_.size(), 1);
  std::vector<uint32_t> first(position_ids_.size(), kNone);
  for (uint32_t v = 0; v < vertices_.size(); ++v) {
    const uint32_t p = position_of_[v];
    if (first[p] != kNone) spare_[v] = spare_[first[p]] = 0;
    if (locked_[p] || components_[p] != kNone) spare_[v] = 0;
    first[p] = v;
  }
}

// A triangle that is there twice with the same vertices and the same front looks as one does. Its
// edges are non-manifold.
void GroupSimplifier::drop_repeated_triangles() {
  if (!has_non_manifold_) return;
  triangle_table_.assign(std::bit_ceil(2 * triangles_.size() + 1), kNone);
  const auto normal_form = [](const Triangle& t) {
    const size_t first = std::min_element(t.begin(), t.end()) - t.begin();
    return Triangle{t[first], t[(first + 1) % 3], t[(first + 2) % 3]};
  };
  size_t kept = 0;
  for (size_t i = 0; i < triangles_.size(); ++i) {
    const Triangle t = normal_form(triangles_[i]);
    const uint32_t key = hash(hash(t[0]) + t[1]) + t[2];
    const uint32_t slot = find_slot(triangle_table_, key,
                                    [&](uint32_t j) { return normal_form(triangles_[j]) == t; });
    if (triangle_table_[slot] != kNone) continue;
    triangle_table_[slot] = static_cast<uint32_t>(kept);
    triangles_[kept++] = triangles_[i];
  }
  triangles_.resize(kept);
}

// The rule of each position, by what its vertices differ in.
void GroupSimplifier::find_rules() {
  rules_.clear();
  if (!source_.has_wedges || !has_rules()) return;
  const Mesh& mesh = source_.mesh;
  const auto differ = [](const auto& stream, uint32_t a, uint32_t b) {
    return !stream.empty() && stream[a] != stream[b];
  };
  rules_.assign(position_ids_.size(), SeamRule::kIgnore);
  std::vector<uint32_t> first(position_ids_.size(), kNone);
  for (uint32_t i = 0; i < vertices_.size(); ++i) {
    const uint32_t v = vertices_[i], p = position_of_[i];
    if (first[p] == kNone) first[p] = v;
    if (differ(mesh.uvs, v, first[p]) || differ(mesh.colors, v, first[p]) ||
        differ_in_extras(mesh, v, first[p]) || are_mirrored(mesh, v, first[p]))
      rules_[p] = std::min(rules_[p], config_.seams);
    if (differ(mesh.normals, v, first[p]) || differ(mesh.tangents, v, first[p]))
      rules_[p] = std::min(rules_[p], config_.creases);
  }
}

CollapseInput GroupSimplifier::collapse_input() {
  find_rules();
  materials_.clear();
  if (!source_.vertex_materials.empty())
    for (uint32_t v = 0; v < vertices_.size(); ++v) materials_.push_back(material(v));
  CollapseInput input{triangles_,         position_of_, positions_,  attributes_,
                      attribute_weights_, locked_,      components_, allow_.locked_edges};
  input.taken = allow_.taken;
  input.position_ids = position_ids_;
  input.materials = materials_;
  input.rules = rules_;
  return input;
}

GroupSimplifier::Candidate GroupSimplifier::collapse_regular(size_t target) {
  CollapseInput input = collapse_input();
  input.limit_below = static_cast<size_t>(kLimitBelow * triangles_.size());
  // Where nothing is non-manifold and there is no seam, the next method has nothing more to permit.
  if (!has_non_manifold_ && !source_.has_wedges)
    input.unlimited_until = static_cast<size_t>(kGoodEnough * triangles_.size());
  Candidate result = collapse_regular(input, target);
  if (result.error * source_.scale < kPruneAbove * collapser_.extent() &&
      result.triangles.size() <= kGoodEnough * triangles_.size())
    return result;
  // Small parts may be held at a price that larger ones pay.
  find_components();
  const std::vector<float> radii = radii_of_parts();
  if (radii.empty()) return result;
  input.part_of = component_of_;
  input.part_radii = radii;
  Candidate without = collapse_regular(input, target);
  if (!(collapser_.removed_radius() > 0)) return without;
  without.pruned = collapser_.removed_radius() / source_.scale;
  without.method = SimplifyMethod::kPrune;
  return without;
}

// Infinite where neighbours touch a part. Empty where the others make too little room.
std::vector<float> GroupSimplifier::radii_of_parts() {
  size_t spare = 0;
  for (const Triangle& t : position_triangles()) spare += !parts_[component_of_[t[0]]].fixed;
  if (static_cast<double>(spare) < kLeastPruned * triangles_.size()) return {};
  std::vector<float> radii;
  for (const Part& part : parts_)
    radii.push_back(part.fixed ? std::numeric_limits<float>::infinity() : part.radius());
  return radii;
}

GroupSimplifier::Candidate GroupSimplifier::collapse_regular(CollapseInput input, size_t target) {
  Candidate result;
  collapser_.run(input, target);
  result.triangles = collapser_.triangles();
  if (has_non_manifold_ && !faults(result.triangles).empty()) {
    input.non_manifold = false;
    collapser_.run(input, target);
    result.triangles = collapser_.triangles();
  }
  result.error = collapser_.error() / source_.scale;
  result.attribute_error = collapser_.attribute_error() / source_.scale;
  result.locked_edges = collapser_.locked_edges();
  result.valid = true;
  if (config_.refit_attributes && !attribute_weights_.empty()) refit_attributes(result);
  return result;
}

// Our own edge collapse once more, with non-manifold vertices and across seams.
GroupSimplifier::Candidate GroupSimplifier::collapse_non_manifold(size_t target, bool allow_flips) {
  CollapseInput input = collapse_input();
  input.non_manifold_moves = true;
  input.rules = {};
  input.allow_flips = allow_flips;
  collapser_.run(input, target);
  Candidate result;
  result.method = SimplifyMethod::kPermissive;
  result.triangles = collapser_.triangles();
  result.error = collapser_.error() / source_.scale;
  result.attribute_error = collapser_.attribute_error() / source_.scale;
  if (!mixes_materials(result.triangles) && faults(result.triangles).empty()) accept(result);
  return result;
}

GroupSimplifier::Candidate GroupSimplifier::collapse(size_t target, unsigned options) {
  options |= meshopt_SimplifyErrorAbsolute;
  if (!attribute_weights_.empty()) options |= meshopt_SimplifyErrorClamped;
  flags_.resize(vertices_.size());
  for (size_t v = 0; v < vertices_.size(); ++v) {
    const uint32_t p = position_of_[v];
    flags_[v] = locked_[p] || held_[p] ? meshopt_SimplifyVertex_Lock : 0;
    if (!source_.several_materials.empty() && source_.several_materials[position_ids_[p]])
      flags_[v] |= meshopt_SimplifyVertex_Protect;
  }
  Candidate result;
  result.triangles.resize(triangles_.size());
  const size_t attributes = attribute_weights_.size();
  std::vector<float> weights(attribute_weights_);
  for (float& weight : weights) weight *= kPerExtent;
  const size_t count = meshopt_simplifyWithAttributes(
      result.triangles.data()->data(), indices(triangles_), 3 * triangles_.size(), &positions_[0].x,
      positions_.size(), sizeof(Vec3), attributes_.data(), attributes * sizeof(float),
      weights.data(), attributes, flags_.data(), 3 * target, std::numeric_limits<float>::max(),
      options, &result.error);
  result.triangles.resize(count / 3);
  result.error /= source_.scale;
  return result;
}

// It divides by a group's extent, which has no reciprocal where it is smaller than this.
bool GroupSimplifier::suits_meshoptimizer() const {
  const float extent = meshopt_simplifyScale(&positions_[0].x, positions_.size(), sizeof(Vec3));
  return extent == 0 || extent > 1e-36f;
}

GroupSimplifier::Candidate GroupSimplifier::collapse_checked(size_t target, unsigned options,
                                                             SimplifyMethod method) {
  if (!suits_meshoptimizer()) return {};
  held_.assign(position_ids_.size(), 0);
  for (int attempt = 0; attempt < kMostTries; ++attempt) {
    Candidate result = collapse(target, options);
    result.method = method;
    if (mixes_materials(result.triangles)) return result;
    const auto found = repair_faults(result);
    if (found.empty()) {
      accept(result);
      return result;
    }
    // If the triangles at one end of an edge do not change, that edge cannot come into being.
    for (const auto& [a, b] : found) hold_around(locked_[b] && !locked_[a] ? b : a);
  }
  return {};
}

// Returns those that are left.
std::span<const PositionPair> GroupSimplifier::repair_faults(Candidate& candidate) {
  auto found = faults(candidate.triangles);
  for (size_t before = found.size() + 1; !found.empty() && found.size() < before;) {
    before = found.size();
    const float moved =
        repair({position_of_, positions_, locked_, patch_of_, spare_}, found, candidate.triangles);
    candidate.error = std::max(candidate.error, moved / source_.scale);
    found = faults(candidate.triangles);
  }
  return found;
}

void GroupSimplifier::hold_around(uint32_t position) {
  held_[position] = 1;
  for (const Triangle& t : position_triangles())
    if (t[0] == position || t[1] == position || t[2] == position)
      held_[t[0]] = held_[t[1]] = held_[t[2]] = 1;
}

std::span<const PositionPair> GroupSimplifier::faults(std::span<const Triangle> triangles) {
  result_positions_.clear();
  for (const Triangle& t : triangles)
    result_positions_.push_back({position_of_[t[0]], position_of_[t[1]], position_of_[t[2]]});
  if (!std::exchange(knows_topology_, true))
    topology_.set_sub_mesh(position_triangles(), locked_, components_);
  return topology_.violations(result_positions_, [&](uint32_t a, uint32_t b) {
    return allow_.locked_edges &&
           !(allow_.taken && allow_.taken->contains({position_ids_[a], position_ids_[b]}));
  });
}

// Of a candidate in which `faults` has just found none.
void GroupSimplifier::accept(Candidate& candidate) {
  candidate.valid = true;
  candidate.locked_edges.assign(topology_.locked_edges().begin(), topology_.locked_edges().end());
}

bool GroupSimplifier::mixes_materials(std::span<const Triangle> triangles) const {
  if (source_.vertex_materials.empty()) return false;
  return std::any_of(triangles.begin(), triangles.end(), [&](const Triangle& t) {
    const uint32_t m = material(t[0]);
    return material(t[1]) != m || material(t[2]) != m;
  });
}

void GroupSimplifier::find_components() {
  has_parts_ = true;
  component_of_.resize(position_ids_.size());
  std::iota(component_of_.begin(), component_of_.end(), 0u);
  const auto root = [&](uint32_t p) {
    while (component_of_[p] != p) p = component_of_[p] = component_of_[component_of_[p]];
    return p;
  };
  for (const Triangle& t : position_triangles())
    for (int i = 1; i < 3; ++i) {
      const uint32_t a = root(t[0]), b = root(t[i]);
      component_of_[std::max(a, b)] = std::min(a, b);
    }
  // Roots are the lowest of their component, so one pass numbers all.
  parts_.clear();
  for (uint32_t p = 0; p < component_of_.size(); ++p) {
    if (component_of_[p] == p) {
      component_of_[p] = static_cast<uint32_t>(parts_.size());
      parts_.push_back({});
    } else {
      component_of_[p] = component_of_[component_of_[p]];
    }
    parts_[component_of_[p]].fixed |= locked_[p] != 0;
  }
  patch_of_.resize(vertices_.size());
  for (uint32_t v = 0; v < vertices_.size(); ++v) {
    const uint32_t component = component_of_[position_of_[v]];
    extend(parts_[component].box, positions_[v]);
    patch_of_[v] = uint64_t{material(v)} << 32 | component;
  }
}

// A component that is gone was nowhere nearer to what is left than half its diagonal, whatever the
// quadrics of a thin or flat one say. The largest come back as they were where that lowers the
// error much at a small price. Returns the radius of the largest that stays away.
float GroupSimplifier::restore_components(size_t most_triangles, std::vector<Triangle>& triangles) {
  if (parts_.size() == 1 && !triangles.empty()) return 0.0f;
  std::vector<uint8_t> present(parts_.size(), 0);
  for (const Triangle& t : triangles) present[component_of_[position_of_[t[0]]]] = 1;
  std::vector<uint32_t> removed, triangles_of(parts_.size(), 0);
  for (const Triangle& t : position_triangles())
    if (const uint32_t part = component_of_[t[0]]; !present[part] && triangles_of[part]++ == 0)
      removed.push_back(part);
  if (removed.empty()) return 0.0f;
  std::stable_sort(removed.begin(), removed.end(),
                   [&](uint32_t a, uint32_t b) { return parts_[a].radius() > parts_[b].radius(); });
  size_t restored = 0, count = triangles.size();
  while (restored < removed.size() && count + triangles_of[removed[restored]] <= most_triangles)
    count += triangles_of[removed[restored++]];
  const float largest = parts_[removed[0]].radius();
  const float left = restored < removed.size() ? parts_[removed[restored]].radius() : 0.0f;
  if (left > kWorthwhile * largest) return largest / source_.scale;
  for (size_t i = 0; i < restored; ++i) present[removed[i]] = 2;
  for (const Triangle& t : triangles_)
    if (present[component_of_[position_of_[t[0]]]] == 2) triangles.push_back(t);
  return left / source_.scale;
}

// Removes the smallest components that no neighbour touches, never the last one.
GroupSimplifier::Candidate GroupSimplifier::prune(const Candidate& from, size_t target) {
  std::vector<uint32_t> triangles_of(parts_.size(), 0);
  for (const Triangle& t : from.triangles) ++triangles_of[component_of_[position_of_[t[0]]]];
  std::vector<uint32_t> order(parts_.size());
  std::iota(order.begin(), order.end(), 0u);
  std::erase_if(order, [&](uint32_t part) { return triangles_of[part] == 0; });
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return parts_[a].radius() < parts_[b].radius(); });
  std::vector<uint8_t> removed(parts_.size(), 0);
  size_t left = from.triangles.size();
  for (size_t i = 0; i + 1 < order.size() && left > target; ++i) {
    if (parts_[order[i]].fixed) continue;
    removed[order[i]] = 1;
    left -= triangles_of[order[i]];
  }
  Candidate result = from;
  result.method = SimplifyMethod::kPrune;
  std::erase_if(result.triangles,
                [&](const Triangle& t) { return removed[component_of_[position_of_[t[0]]]]; });
  return result;
}

GroupSimplifier::Candidate GroupSimplifier::replace_patches(const Candidate& from, size_t target,
                                                            PatchChange change) {
  Candidate result;
  result.method = SimplifyMethod::kSloppy;
  result.triangles = from.triangles;
  const float moved = change({position_of_, positions_, locked_, components_, materials_}, target,
                             result.triangles);
  result.error = std::max(from.error, moved / source_.scale);
  if (!mixes_materials(result.triangles) && faults(result.triangles).empty()) accept(result);
  return result;
}

// Vertices in one cell of a grid become one (Rossignac & Borrel 1993).
GroupSimplifier::Candidate GroupSimplifier::merge_cells(size_t target) {
  if (!suits_meshoptimizer()) return {};
  for (size_t v = 0; v < vertices_.size(); ++v) {
    const uint32_t p = position_of_[v];
    flags_[v] = locked_[p] ||
                (!source_.several_materials.empty() && source_.several_materials[position_ids_[p]]);
  }
  Candidate result;
  result.method = SimplifyMethod::kSloppy;
  result.triangles.resize(triangles_.size());
  const size_t count = meshopt_simplifySloppy(
      result.triangles.data()->data(), indices(triangles_), 3 * triangles_.size(), &positions_[0].x,
      positions_.size(), sizeof(Vec3), flags_.data(), 3 * target, std::numeric_limits<float>::max(),
      &result.error);
  result.triangles.resize(count / 3);
  result.error *= kCellErrorFactor / source_.scale *
                  meshopt_simplifyScale(&positions_[0].x, positions_.size(), sizeof(Vec3));
  if (!mixes_materials(result.triangles) && repair_faults(result).empty()) accept(result);
  return result;
}

}  // namespace umbel::lod
