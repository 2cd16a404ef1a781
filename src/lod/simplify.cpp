#include "lod/simplify.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/math.hpp"
#include "lod/repair.hpp"

namespace umbel::lod {
namespace {

// A result that keeps more than this part of the triangles moves to the next rung of the ladder.
constexpr double kGoodEnough = 0.7;
// And one that keeps more than this after the last rung is not worth a level.
constexpr double kStuck = 0.85;
// Rounds of repair of one result: mending an edge can uncover another.
constexpr int kMostRepairs = 4;
// Tries with more and more vertices held before a rung is given up.
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

}  // namespace

GroupSimplifier::GroupSimplifier(const Source& source, const Config& config)
    : source_(source), config_(config) {
  if (!config.attributes) return;
  const Mesh& mesh = source.mesh;
  if (!mesh.normals.empty()) attribute_weights_.insert(attribute_weights_.end(), 3, config.normal_weight);
  if (!mesh.uvs.empty()) attribute_weights_.insert(attribute_weights_.end(), 2, config.uv_weight);
  if (!mesh.colors.empty()) attribute_weights_.insert(attribute_weights_.end(), 4, config.color_weight);
}

Simplified GroupSimplifier::simplify(const ClusterSet& set, std::span<const uint32_t> clusters,
                                     std::span<const uint8_t> locked, bool last_resort) {
  gather(set, clusters, locked);
  size_t before = 0;
  for (uint32_t c : clusters) before += set.triangle_offsets[c + 1] - set.triangle_offsets[c];
  const size_t target = static_cast<size_t>(before * static_cast<double>(config_.ratio));
  const size_t good = static_cast<size_t>(before * kGoodEnough);

  Candidate best;
  best.triangles = triangles_;
  best.valid = faults(triangles_).empty();
  const auto consider = [&](Candidate candidate) {
    if (candidate.valid && (!best.valid || candidate.triangles.size() < best.triangles.size()))
      best = std::move(candidate);
  };
  if (best.triangles.size() > target) {
    consider(collapse_checked(target, 0, Rung::kRegular));
    if (best.triangles.size() > good)
      consider(collapse_checked(target, meshopt_SimplifyPermissive, Rung::kPermissive));
    if (best.triangles.size() > good) consider(prune(best, target));
    if (last_resort && best.triangles.size() > good) consider(merge_cells(target));
  }

  Simplified result;
  if (!best.valid || best.triangles.size() > kStuck * before) return result;
  result.done = true;
  result.error = best.error;
  result.rung = best.rung;
  result.triangles = std::move(best.triangles);
  for (Triangle& t : result.triangles)
    for (uint32_t& v : t) v = vertices_[v];
  return result;
}

uint32_t GroupSimplifier::local_position(uint32_t position_id, std::span<const uint8_t> locked) {
  const uint32_t slot = find_slot(position_table_, position_id,
                                  [&](uint32_t p) { return position_ids_[p] == position_id; });
  if (position_table_[slot] == kNone) {
    position_table_[slot] = static_cast<uint32_t>(position_ids_.size());
    position_ids_.push_back(position_id);
    locked_.push_back(locked[position_id]);
    components_.push_back(source_.irregular_components[position_id]);
  }
  return position_table_[slot];
}

uint32_t GroupSimplifier::local_vertex(uint32_t vertex, std::span<const uint8_t> locked) {
  const uint32_t slot =
      find_slot(vertex_table_, vertex, [&](uint32_t v) { return vertices_[v] == vertex; });
  if (vertex_table_[slot] == kNone) {
    vertex_table_[slot] = static_cast<uint32_t>(vertices_.size());
    vertices_.push_back(vertex);
    const uint32_t position_id = source_.position_ids[vertex];
    position_of_.push_back(local_position(position_id, locked));
    // Adding 0 turns -0 into 0, so that meshoptimizer sees equal positions as equal bits.
    const Vec3 p = source_.mesh.positions[position_id] * source_.scale;
    positions_.push_back({p.x + 0.0f, p.y + 0.0f, p.z + 0.0f});
  }
  return vertex_table_[slot];
}

void GroupSimplifier::gather(const ClusterSet& set, std::span<const uint32_t> clusters,
                             std::span<const uint8_t> locked) {
  for (auto* array : {&vertices_, &position_of_, &components_, &position_ids_}) array->clear();
  positions_.clear();
  locked_.clear();
  triangles_.clear();
  size_t most_vertices = 0;
  for (uint32_t c : clusters) most_vertices += set.cluster_vertices(c).size();
  const size_t table_size = std::bit_ceil(2 * most_vertices + 1);
  vertex_table_.assign(table_size, kNone);
  position_table_.assign(table_size, kNone);

  uint32_t local[256];
  for (uint32_t c : clusters) {
    const auto vertices = set.cluster_vertices(c);
    for (size_t i = 0; i < vertices.size(); ++i) local[i] = local_vertex(vertices[i], locked);
    const auto corners = set.cluster_corners(c);
    for (size_t i = 0; i < corners.size(); i += 3) {
      const Triangle t{local[corners[i]], local[corners[i + 1]], local[corners[i + 2]]};
      const uint32_t a = position_of_[t[0]], b = position_of_[t[1]], c2 = position_of_[t[2]];
      if (a != b && b != c2 && c2 != a) triangles_.push_back(t);
    }
  }
  drop_repeated_triangles();

  position_triangles_.clear();
  for (const Triangle& t : triangles_)
    position_triangles_.push_back({position_of_[t[0]], position_of_[t[1]], position_of_[t[2]]});
  topology_.set_piece(position_triangles_, locked_, components_);
  find_spare_vertices();
  gather_attributes();
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

void GroupSimplifier::gather_attributes() {
  const Mesh& mesh = source_.mesh;
  attributes_.clear();
  if (attribute_weights_.empty()) return;
  for (uint32_t v : vertices_) {
    if (!mesh.normals.empty()) {
      const Vec3& n = mesh.normals[v];
      attributes_.insert(attributes_.end(), {n.x, n.y, n.z});
    }
    if (!mesh.uvs.empty()) attributes_.insert(attributes_.end(), {mesh.uvs[v].x, mesh.uvs[v].y});
    if (!mesh.colors.empty()) {
      const Vec4& c = mesh.colors[v];
      attributes_.insert(attributes_.end(), {c.x, c.y, c.z, c.w});
    }
  }
}

// A triangle that is there twice with the same vertices and the same front looks as one does.
void GroupSimplifier::drop_repeated_triangles() {
  std::vector<uint32_t> table(std::bit_ceil(2 * triangles_.size() + 1), kNone);
  const auto normal_form = [](const Triangle& t) {
    const size_t first = std::min_element(t.begin(), t.end()) - t.begin();
    return Triangle{t[first], t[(first + 1) % 3], t[(first + 2) % 3]};
  };
  size_t kept = 0;
  for (size_t i = 0; i < triangles_.size(); ++i) {
    const Triangle t = normal_form(triangles_[i]);
    const uint32_t key = hash(hash(t[0]) + t[1]) + t[2];
    const uint32_t slot =
        find_slot(table, key, [&](uint32_t j) { return normal_form(triangles_[j]) == t; });
    if (table[slot] != kNone) continue;
    table[slot] = static_cast<uint32_t>(kept);
    triangles_[kept++] = triangles_[i];
  }
  triangles_.resize(kept);
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
  const size_t count = meshopt_simplifyWithAttributes(
      result.triangles.data()->data(), indices(triangles_), 3 * triangles_.size(),
      &positions_[0].x, positions_.size(), sizeof(Vec3), attributes_.data(),
      attributes * sizeof(float), attribute_weights_.data(), attributes, flags_.data(), 3 * target,
      std::numeric_limits<float>::max(), options, &result.error);
  result.triangles.resize(count / 3);
  result.error /= source_.scale;
  return result;
}

GroupSimplifier::Candidate GroupSimplifier::collapse_checked(size_t target, unsigned options,
                                                             Rung rung) {
  held_.assign(position_ids_.size(), 0);
  for (int attempt = 0; attempt < kMostTries; ++attempt) {
    Candidate result = collapse(target, options);
    result.rung = rung;
    if (mixes_materials(result.triangles)) return result;
    auto found = faults(result.triangles);
    for (int round = 0; round < kMostRepairs && !found.empty(); ++round) {
      const float moved = repair({position_of_, positions_, locked_, spare_}, found, result.triangles);
      result.error = std::max(result.error, moved / source_.scale);
      found = faults(result.triangles);
    }
    if (found.empty()) {
      result.valid = true;
      return result;
    }
    // If the triangles at one end of an edge do not change, that edge cannot come into being.
    for (const auto& [a, b] : found) hold_around(locked_[b] && !locked_[a] ? b : a);
  }
  return {};
}

void GroupSimplifier::hold_around(uint32_t position) {
  held_[position] = 1;
  for (const Triangle& t : position_triangles_)
    if (t[0] == position || t[1] == position || t[2] == position)
      held_[t[0]] = held_[t[1]] = held_[t[2]] = 1;
}

std::span<const std::pair<uint32_t, uint32_t>> GroupSimplifier::faults(
    std::span<const Triangle> triangles) {
  result_positions_.clear();
  for (const Triangle& t : triangles)
    result_positions_.push_back({position_of_[t[0]], position_of_[t[1]], position_of_[t[2]]});
  return topology_.violations(result_positions_);
}

bool GroupSimplifier::mixes_materials(std::span<const Triangle> triangles) const {
  if (source_.vertex_materials.empty()) return false;
  return std::any_of(triangles.begin(), triangles.end(), [&](const Triangle& t) {
    const uint32_t m = source_.material(vertices_[t[0]]);
    return source_.material(vertices_[t[1]]) != m || source_.material(vertices_[t[2]]) != m;
  });
}

// Removes the smallest components that no neighbour touches, never the last one. What it loses
// is farther than half its diagonal from nothing that is left.
GroupSimplifier::Candidate GroupSimplifier::prune(const Candidate& from, size_t target) {
  std::vector<uint32_t> parent(position_ids_.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root = [&](uint32_t p) {
    while (parent[p] != p) p = parent[p] = parent[parent[p]];
    return p;
  };
  for (const Triangle& t : from.triangles)
    for (int i = 1; i < 3; ++i) {
      const uint32_t a = root(position_of_[t[0]]), b = root(position_of_[t[i]]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  struct Component {
    uint32_t root = 0, triangles = 0;
    bool fixed = false;
    Aabb box;
    float radius() const { return 0.5f * length(box.max - box.min); }
  };
  std::vector<Component> components;
  std::vector<uint32_t> index(position_ids_.size(), kNone);
  for (const Triangle& t : from.triangles) {
    const uint32_t r = root(position_of_[t[0]]);
    if (index[r] == kNone) {
      index[r] = static_cast<uint32_t>(components.size());
      components.push_back({});
      components.back().root = r;
    }
    Component& component = components[index[r]];
    ++component.triangles;
    for (uint32_t v : t) {
      extend(component.box, positions_[v]);
      component.fixed |= locked_[position_of_[v]] != 0;
    }
  }
  std::vector<uint32_t> order(components.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return components[a].radius() < components[b].radius();
  });
  Candidate result;
  result.rung = Rung::kPrune;
  result.error = from.error;
  size_t left = from.triangles.size();
  std::vector<uint8_t> removed(components.size(), 0);
  for (size_t i = 0; i + 1 < order.size() && left > target; ++i) {
    const Component& component = components[order[i]];
    if (component.fixed) continue;
    removed[order[i]] = 1;
    left -= component.triangles;
    result.error = std::max(result.error, component.radius() / source_.scale);
  }
  for (const Triangle& t : from.triangles)
    if (!removed[index[root(position_of_[t[0]])]]) result.triangles.push_back(t);
  result.valid = from.valid;
  return result;
}

// Vertices in one cell of a grid become one (Rossignac & Borrel 1993).
GroupSimplifier::Candidate GroupSimplifier::merge_cells(size_t target) {
  for (size_t v = 0; v < vertices_.size(); ++v) {
    const uint32_t p = position_of_[v];
    flags_[v] = locked_[p] || (!source_.several_materials.empty() &&
                               source_.several_materials[position_ids_[p]]);
  }
  Candidate result;
  result.rung = Rung::kSloppy;
  result.triangles.resize(triangles_.size());
  const size_t count = meshopt_simplifySloppy(
      result.triangles.data()->data(), indices(triangles_), 3 * triangles_.size(),
      &positions_[0].x, positions_.size(), sizeof(Vec3), flags_.data(), 3 * target,
      std::numeric_limits<float>::max(), &result.error);
  result.triangles.resize(count / 3);
  result.error *= kCellErrorFactor / source_.scale *
                  meshopt_simplifyScale(&positions_[0].x, positions_.size(), sizeof(Vec3));
  result.valid = !mixes_materials(result.triangles) && faults(result.triangles).empty();
  return result;
}

}  // namespace umbel::lod
