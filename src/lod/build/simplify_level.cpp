#include "lod/build/simplify_level.hpp"

#include <algorithm>
#include <cmath>

#include "base/math.hpp"
#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

// Two such steps are one with `ratio`.
float ratio_between(float ratio) { return std::sqrt(ratio); }

}  // namespace

LevelSimplifier::LevelSimplifier(Unit& unit, const Config& config, const Decimator& decimate)
    : unit_(unit), source_(unit.source), config_(config), workers_([this, &decimate] {
        return std::make_unique<Worker>(source_, config_, decimate);
      }) {}

std::vector<GroupResult> LevelSimplifier::simplify(const Clusters& groups, float ratio,
                                                   bool last_resort,
                                                   const std::function<void(double)>& progress,
                                                   GroupResult* between) {
  groups_ = &groups;
  ratio_ = ratio;
  by_caller_ = true;
  insert_own_locked_edges();
  std::vector<GroupResult> results(groups.ranges.size());
  const auto simplify_one = [&](size_t g) {
    results[g] = simplify_group(members_of(groups, g), {.ratio = ratio_,
                                                        .locked_edges = true,
                                                        .by_caller = by_caller_,
                                                        .last_resort = last_resort,
                                                        .unused = unit_.unused,
                                                        .taken = &unit_.locked_edges});
  };
  if (between != nullptr) {
    parallel_invoke([&] { simplify_one(0); },
                    [&] {
                      *between =
                          simplify_group(members_of(groups, 0),
                                         {.ratio = ratio_between(ratio), .by_caller = false});
                    });
    progress(1.0);
  } else {
    constexpr size_t kBatch = 256;  // groups between two calls of `progress`
    for (size_t begin = 0; begin < results.size(); begin += kBatch) {
      const size_t count = std::min(kBatch, results.size() - begin);
      parallel_for(count, 1, [&](size_t i) { simplify_one(begin + i); });
      progress(static_cast<double>(begin + count) / results.size());
    }
  }
  settle_locked_edges(results, last_resort);
  settle_added(results, last_resort);
  keep_one_triangle(results);
  return results;
}

GroupResult LevelSimplifier::simplify_group(std::span<const uint32_t> members, Allowance allow) {
  // Nobody here knows which other positions there are elsewhere.
  allow.new_positions = unit_.is_whole;
  Worker& worker = *workers_.local();
  GroupResult result;
  result.simplified = worker.simplifier.simplify(unit_.pending, members, unit_.locked, allow);
  if (result.simplified.done)
    worker.clusteriser.append(result.simplified.mesh, kNone, result.clusters);
  result.simplified.mesh = {};
  return result;
}

void LevelSimplifier::settle_between(GroupResult& between) {
  ratio_ = ratio_between(ratio_);
  by_caller_ = false;
  settle_added(std::span(&between, 1), false);
}

void LevelSimplifier::insert_own_locked_edges() {
  std::vector<std::vector<PositionPair>> edges(groups_->ranges.size());
  parallel_for(edges.size(), 4, [&](size_t g) {
    edges[g] = own_locked_edges(unit_.pending, members_of(*groups_, g), source_.position_ids,
                                unit_.locked);
  });
  for (const std::vector<PositionPair>& of_group : edges) unit_.locked_edges.insert(of_group);
}

// Groups with a new edge between locked vertices that another group has made as well are simplified
// again without any.
void LevelSimplifier::settle_locked_edges(std::vector<GroupResult>& results, bool last_resort) {
  std::vector<size_t> refused;
  for (size_t g = 0; g < results.size(); ++g) {
    if (unit_.locked_edges.contains_any(results[g].simplified.locked_edges))
      refused.push_back(g);
    else
      unit_.locked_edges.insert(results[g].simplified.locked_edges);
  }
  parallel_for(refused.size(), 1, [&](size_t i) {
    results[refused[i]] =
        simplify_group(members_of(*groups_, refused[i]), {.ratio = ratio_,
                                                          .locked_edges = false,
                                                          .by_caller = by_caller_,
                                                          .last_resort = last_resort,
                                                          .unused = unit_.unused,
                                                          .taken = nullptr});
  });
}

// New positions of a group are moved away from all others. Where that cannot be, the group is
// simplified again without any. Returns the farthest that one moved.
float LevelSimplifier::set_apart(std::span<const uint32_t> members, bool last_resort,
                                 GroupResult& result) {
  AddedVertices& added = result.simplified.added;
  if (added.components.empty() && new_positions_.is_empty()) return 0;
  const auto moved = new_positions_.set_apart(source_, config_.position_step, unit_.unused, added);
  if (moved) return *moved;
  result = simplify_group(members, {.ratio = ratio_,
                                    .locked_edges = false,
                                    .by_caller = by_caller_,
                                    .last_resort = last_resort,
                                    .taken = nullptr});
  return 0;
}

// Vertices that groups have made get their numbers.
void LevelSimplifier::settle_added(std::span<GroupResult> results, bool last_resort) {
  for (size_t g = 0; g < results.size(); ++g) {
    GroupResult& result = results[g];
    if (result.simplified.added.position_ids.empty()) continue;
    const float moved = set_apart(members_of(*groups_, g), last_resort, result);
    Simplified& simplified = result.simplified;
    simplified.error += moved;
    const uint32_t first = append_vertices(source_, simplified.added);
    for (size_t v = 0; v < simplified.added.position_ids.size(); ++v)
      if (simplified.added.position_ids[v] == kNone)
        result.new_positions.push_back(simplified.added.mesh.positions[v]);
    for (uint32_t& v : result.clusters.vertices)
      if (v >= kAddedVertex) v = first + (v - kAddedVertex);
    if (unit_.unused)
      unit_.new_positions.insert(unit_.new_positions.end(), result.new_positions.begin(),
                                 result.new_positions.end());
    if (moved > 0) fit_boxes(result.clusters);
    simplified.added = {};
  }
}

void LevelSimplifier::fit_boxes(ClusterSet& clusters) const {
  for (size_t c = 0; c < clusters.size(); ++c) {
    clusters.boxes[c] = {};
    for (uint32_t v : clusters.cluster_vertices(c))
      extend(clusters.boxes[c], source_.mesh.positions[v]);
  }
}

// Groups may leave nothing behind, where every triangle is degenerate, or where one group is all
// that is left. A DAG still ends in a root: the first triangle stays, or where it has two sides
// both, so that a closed surface stays closed. Where another unit may have the edges of all, the
// first group waits instead.
void LevelSimplifier::keep_one_triangle(std::vector<GroupResult>& results) {
  if (std::any_of(results.begin(), results.end(),
                  [](const GroupResult& r) { return !r.simplified.done || r.clusters.size() > 0; }))
    return;
  std::vector<Triangle> kept;
  for (uint32_t c : members_of(*groups_, 0)) {
    const auto vertices = unit_.pending.cluster_vertices(c);
    const auto corners = unit_.pending.cluster_corners(c);
    for (size_t i = 0; i < corners.size(); i += 3) {
      const Triangle t{vertices[corners[i]], vertices[corners[i + 1]], vertices[corners[i + 2]]};
      if (!may_be_left(t)) continue;
      if (kept.empty()) kept = {t};
      if (kept.size() == 1 && !is_degenerate(t)) kept = {t, {t[0], t[2], t[1]}};
    }
  }
  if (kept.empty()) {
    results[0].simplified.done = false;
    results[0].simplified.limiting_factor = LimitingFactor::kLocked;
    return;
  }
  SubMesh mesh;
  const auto number = [&](uint32_t v) {
    const auto at = std::find(mesh.vertices.begin(), mesh.vertices.end(), v);
    const size_t found = at - mesh.vertices.begin();
    if (at == mesh.vertices.end()) {
      mesh.vertices.push_back(v);
      mesh.positions.push_back(source_.mesh.positions[v]);
      if (!source_.vertex_materials.empty()) mesh.materials.push_back(source_.material(v));
    }
    return static_cast<uint32_t>(found);
  };
  for (const Triangle& t : kept)
    mesh.triangles.push_back({number(t[0]), number(t[1]), number(t[2])});
  workers_.local()->clusteriser.append(mesh, kNone, results[0].clusters);
}

bool LevelSimplifier::may_be_left(const Triangle& t) const {
  if (unit_.frozen.empty() || is_degenerate(t)) return true;
  int frozen = 0;
  for (uint32_t v : t)
    frozen += std::find(unit_.frozen.begin(), unit_.frozen.end(), source_.position_ids[v]) !=
              unit_.frozen.end();
  return frozen < 2;
}

bool LevelSimplifier::is_degenerate(const Triangle& t) const {
  const auto& ids = source_.position_ids;
  return ids[t[0]] == ids[t[1]] || ids[t[1]] == ids[t[2]] || ids[t[2]] == ids[t[0]];
}

}  // namespace umbel::lod
