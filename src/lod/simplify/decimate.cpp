#include "lod/simplify/decimate.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/find_root.hpp"
#include "base/math.hpp"
#include "base/printed.hpp"

namespace umbel::lod {
namespace {

[[noreturn]] void reject(const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "decimate: " + what);
}

Mesh mesh_of(const GroupMesh& group) {
  Mesh mesh;
  for (uint32_t v : group.vertices) append_vertex(mesh, group.source.mesh, v);
  mesh.triangles = group.triangles;
  if (!group.source.vertex_materials.empty())
    for (const Triangle& t : group.triangles) mesh.materials.push_back(group.material(t[0]));
  return mesh;
}

// Where the group has several materials, those of added vertices must be given.
void validate_result(const DecimationInput& input, const DecimationResult& made) {
  const size_t given = input.mesh.positions.size(), added = made.added.positions.size();
  for (size_t i = 0; i < made.triangles.size(); ++i)
    for (uint32_t v : made.triangles[i])
      if (v >= given + added)
        reject("triangles[" + std::to_string(i) + "] has the vertex " + std::to_string(v) +
               ", but there are " + std::to_string(given) + " and " + std::to_string(added) +
               " added");
  if (!(made.error >= 0) || !std::isfinite(made.error))
    reject("error is " + printed(made.error) + ", must be at least 0 and finite");
  const auto fits = [&](const auto& stream, const auto& values, const char* name) {
    const size_t needed = stream.empty() ? 0 : added;
    if (values.size() != needed)
      reject("there are " + std::to_string(values.size()) + " added " + name + ", must be " +
             std::to_string(needed));
  };
  fits(input.mesh.normals, made.added.normals, "normals");
  fits(input.mesh.tangents, made.added.tangents, "tangents");
  fits(input.mesh.uvs, made.added.uvs, "uvs");
  fits(input.mesh.colors, made.added.colors, "colors");
  const size_t width = extra_width(input.mesh.extras);
  if (made.added.extra_values.size() != width * added)
    reject("there are " + std::to_string(made.added.extra_values.size()) +
           " values of further attributes of added vertices, must be " +
           std::to_string(width * added));
  const auto& materials = input.mesh.materials;
  const bool several = std::adjacent_find(materials.begin(), materials.end(),
                                          std::not_equal_to<>()) != materials.end();
  if (made.added_materials.size() != added && (several || !made.added_materials.empty()))
    reject("there are " + std::to_string(made.added_materials.size()) +
           " materials of added vertices, must be " + std::to_string(added));
  Mesh probe = made.added;
  probe.extras.assign(input.mesh.extras.begin(), input.mesh.extras.end());
  for (uint32_t v = 0; v < added; ++v) probe.triangles.push_back({v, v, v});
  probe.materials.clear();
  validate(probe.view());
}

// The first vertex at each position.
std::vector<uint32_t> first_vertices(const GroupMesh& group) {
  std::vector<uint32_t> first(group.position_count(), kNone);
  for (uint32_t v = 0; v < group.position_of.size(); ++v)
    first[group.position_of[v]] = std::min(first[group.position_of[v]], v);
  return first;
}

// Whether no two triangles run along an edge in the same direction.
bool is_consistently_oriented(GroupMesh& group) {
  std::vector<PositionPair> sides;
  for (const Triangle& t : group.position_triangles())
    sides.insert(sides.end(), {{t[0], t[1]}, {t[1], t[2]}, {t[2], t[0]}});
  std::ranges::sort(sides);
  return std::ranges::adjacent_find(sides) == sides.end();
}

// For each triangle (as positions) the lowest of those that it is joined with by edges.
std::vector<uint32_t> joined_by_edges(std::span<const Triangle> triangles) {
  std::vector<std::pair<uint64_t, uint32_t>> edges;
  std::vector<uint32_t> joined(triangles.size());
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    const auto [a, b, c] = triangles[i];
    for (const PositionPair& edge : {PositionPair{a, b}, {b, c}, {c, a}})
      edges.push_back({edge_key(edge), i});
    joined[i] = i;
  }
  std::ranges::sort(edges);
  for (size_t e = 1; e < edges.size(); ++e) {
    if (edges[e].first != edges[e - 1].first) continue;
    const uint32_t a = find_root(joined, edges[e].second),
                   b = find_root(joined, edges[e - 1].second);
    joined[std::max(a, b)] = std::min(a, b);
  }
  for (uint32_t& i : joined) i = find_root(joined, i);
  return joined;
}

// Of each position: the sum of its triangles' area vectors, and of their areas.
struct AreaAround {
  Vec3d vector{0, 0, 0};
  double area = 0;
};

// The first triangle of a component that faces against what its vertices faced before, or kNone.
// Edges do not tell where no neighbour has any of them. What has only new vertices is not known.
uint32_t first_turned(GroupMesh& group, std::span<const Triangle> triangles) {
  std::vector<Vec3d> at(group.position_count());
  for (uint32_t v = 0; v < group.vertices.size(); ++v)
    at[group.position_of[v]] = to_double(group.positions[v]);
  const auto area_vector = [&](const Triangle& t) {
    return cross(at[t[1]] - at[t[0]], at[t[2]] - at[t[0]]);
  };
  std::vector<AreaAround> before(at.size());
  for (const Triangle& t : group.position_triangles()) {
    const Vec3d vector = area_vector(t);
    for (const uint32_t p : t) {
      before[p].vector = before[p].vector + vector;
      before[p].area += length(vector);
    }
  }
  std::vector<Triangle> as_positions;
  for (const Triangle& t : triangles) as_positions.push_back(group.positions_of(t));
  const std::vector<uint32_t> component = joined_by_edges(as_positions);
  std::vector<double> agreement(triangles.size(), 0), most(triangles.size(), 0);
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    const Vec3d vector = area_vector(as_positions[i]);
    for (const uint32_t p : as_positions[i]) {
      agreement[component[i]] += dot(vector, before[p].vector);
      most[component[i]] += length(vector) * before[p].area;
    }
  }
  // A flat body, whose vertices all have triangles of both sides, faces nowhere but for rounding.
  for (uint32_t i = 0; i < triangles.size(); ++i)
    if (agreement[i] < -0.01 * most[i]) return i;
  return kNone;
}

// Of a result whose vertices have been appended to the group; no reason where there is none.
DecimationRefusal refusal_of(GroupMesh& group, CandidateCheck& check,
                             std::span<const Triangle> triangles) {
  using Reason = DecimationRefusal::Reason;
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    if (group.is_degenerate(triangles[i])) return {Reason::kDegenerate, i, {}};
    if (group.mixes_materials({&triangles[i], 1})) return {Reason::kMixedMaterials, i, {}};
  }
  DecimationRefusal refusal;
  const bool is_oriented = is_consistently_oriented(group);
  const auto faults = check.faults(triangles, is_oriented);
  if (faults.empty()) {
    if (is_oriented) refusal.triangle = first_turned(group, triangles);
    if (refusal.triangle != kNone) refusal.reason = Reason::kTurnedOver;
    return refusal;
  }
  refusal.reason = Reason::kEdges;
  const std::vector<uint32_t> first = first_vertices(group);
  for (const auto& [a, b] : faults) refusal.edges.push_back({first[a], first[b]});
  return refusal;
}

// Takes the result into the group, or says why not and leaves the group as it was.
DecimationRefusal take(DecimationResult& made, GroupMesh& group, CandidateCheck& check,
                       Candidate& candidate) {
  Candidate result;
  result.error = made.error;
  const float step = group.config.position_step;
  if (step > 0 && !made.added.positions.empty())
    result.error += snap_to_grid(made.added.positions, step);
  if (made.added_materials.empty())
    made.added_materials.assign(
        made.added.positions.size(),
        group.triangles.empty() ? 0 : group.material(group.triangles[0][0]));
  result.added.mesh = made.added;
  result.added.mesh.extras = group.source.mesh.extras;
  result.added.materials = made.added_materials;
  group.append(made.added, result.added);
  check.reset(check.allowance());
  result.triangles = std::move(made.triangles);
  DecimationRefusal refusal = refusal_of(group, check, result.triangles);
  if (refusal.reason == DecimationRefusal::Reason::kNone) {
    check.accept(result);
    candidate = std::move(result);
  } else {
    group.remove_appended();
    check.reset(check.allowance());
  }
  return refusal;
}

}  // namespace

bool decimate_by_caller(const Decimator& decimate, size_t target, size_t most, GroupMesh& group,
                        CandidateCheck& check, Candidate& candidate) {
  constexpr int kMostCalls = 4;
  const Mesh mesh = mesh_of(group);
  std::vector<uint8_t> locked;
  for (uint32_t p : group.position_of) locked.push_back(group.locked[p] != 0);
  DecimationInput input{mesh.view(), locked, target, most};
  DecimationRefusal refusal;
  if (!check.allowance().locked_edges) {
    refusal.reason = DecimationRefusal::Reason::kTakenEdge;
    input.refused = &refusal;
  }
  for (int call = 0; call < kMostCalls; ++call) {
    DecimationResult made;
    if (!decimate(input, made)) return false;
    validate_result(input, made);
    if (made.triangles.size() > most)
      refusal = {DecimationRefusal::Reason::kTooMany, kNone, {}};
    else
      refusal = take(made, group, check, candidate);
    if (refusal.reason == DecimationRefusal::Reason::kNone) return true;
    input.refused = &refusal;
  }
  return false;
}

std::string to_string(const DecimationRefusal& refusal) {
  using Reason = DecimationRefusal::Reason;
  const std::string triangle = "triangle " + std::to_string(refusal.triangle);
  switch (refusal.reason) {
    case Reason::kNone:
      break;
    case Reason::kTooMany:
      return "too many triangles are left";
    case Reason::kDegenerate:
      return triangle + " has two corners at one position";
    case Reason::kMixedMaterials:
      return triangle + " has corners of several materials";
    case Reason::kEdges: {
      std::string sentence =
          std::to_string(refusal.edges.size()) +
          " edges are open, missing, shared by too many triangles or run along the "
          "wrong way";
      if (!refusal.edges.empty())
        sentence += ", the first from vertex " + std::to_string(refusal.edges[0][0]) + " to " +
                    std::to_string(refusal.edges[0][1]);
      return sentence;
    }
    case Reason::kTurnedOver:
      return triangle + " and all that is joined to it are turned over";
    case Reason::kTakenEdge:
      return "another group has made the same edge between two locked vertices: make none";
  }
  return "not refused";
}

}  // namespace umbel::lod
