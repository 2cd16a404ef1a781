// The caller's own decimation of a group: what it is given, and whether what it gives back can take
// the group's place.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>

#include "base/math.hpp"
#include "lod/simplify/simplify.hpp"

namespace umbel::lod {
namespace {

[[noreturn]] void reject(const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "decimate: " + what);
}

std::array<float, 3> key(const Vec3& p) {
  return std::bit_cast<std::array<float, 3>>(without_negative_zero(p));
}

// One material of several that the group has must be said.
void check(const DecimationInput& input, const DecimationResult& made) {
  const size_t given = input.mesh.positions.size(), added = made.added.positions.size();
  for (size_t i = 0; i < made.triangles.size(); ++i)
    for (uint32_t v : made.triangles[i])
      if (v >= given + added)
        reject("triangles[" + std::to_string(i) + "] has the vertex " + std::to_string(v) +
               ", but there are " + std::to_string(given) + " and " + std::to_string(added) +
               " added");
  if (!(made.error >= 0) || !std::isfinite(made.error))
    reject("error is " + std::to_string(made.error) + ", must be at least 0 and finite");
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

}  // namespace

Mesh GroupSimplifier::gathered_mesh() const {
  Mesh mesh;
  for (uint32_t v : vertices_) append_vertex(mesh, source_.mesh, v);
  mesh.triangles = triangles_;
  if (!source_.vertex_materials.empty())
    for (const Triangle& t : triangles_) mesh.materials.push_back(material(t[0]));
  return mesh;
}

bool GroupSimplifier::ask_caller(size_t target, size_t most, Candidate& candidate) {
  const Mesh mesh = gathered_mesh();
  std::vector<uint8_t> locked;
  for (uint32_t p : position_of_) locked.push_back(locked_[p]);
  const DecimationInput input{mesh.view(), locked, target};
  DecimationResult made;
  if (!decimate_(input, made)) return false;
  check(input, made);
  if (made.triangles.size() > most) return false;
  Candidate result;
  result.error = made.error;
  if (config_.position_step > 0 && !made.added.positions.empty())
    result.error += snap_to_grid(made.added.positions, config_.position_step);
  if (made.added_materials.empty())
    made.added_materials.assign(made.added.positions.size(),
                                triangles_.empty() ? 0 : material(triangles_[0][0]));
  take_added(made, result.added);
  result.triangles = std::move(made.triangles);
  const bool degenerate =
      std::any_of(result.triangles.begin(), result.triangles.end(), [&](const Triangle& t) {
        const uint32_t a = position_of_[t[0]], b = position_of_[t[1]], c = position_of_[t[2]];
        return a == b || b == c || c == a;
      });
  if (!degenerate && !mixes_materials(result.triangles) && faults(result.triangles).empty()) {
    accept(result);
    candidate = std::move(result);
    return true;
  }
  forget_added();
  return false;
}

// Behind the gathered vertices and positions.
void GroupSimplifier::take_added(const DecimationResult& made, AddedVertices& added) {
  const size_t count = made.added.positions.size();
  added.mesh = made.added;
  added.mesh.extras = source_.mesh.extras;
  added.materials = added_materials_ = made.added_materials;
  if (count == 0) return;
  std::map<std::array<float, 3>, uint32_t> known;  // local positions
  for (uint32_t v = 0; v < vertices_.size(); ++v)
    known.insert({key(source_.mesh.positions[vertices_[v]]), position_of_[v]});
  std::vector<uint32_t> first_there;  // of the added, by their new local positions
  const uint32_t gathered = static_cast<uint32_t>(position_ids_.size());
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3& p = made.added.positions[i];
    const auto [at, is_new] = known.insert({key(p), static_cast<uint32_t>(position_ids_.size())});
    if (is_new) {
      position_ids_.push_back(kNone);
      locked_.push_back(0);
      components_.push_back(kNone);
      first_there.push_back(i);
    }
    vertices_.push_back(kAddedVertex + i);
    position_of_.push_back(at->second);
    positions_.push_back(p * source_.scale);
    added.position_ids.push_back(is_new ? kNone
                                 : at->second >= gathered
                                     ? kAddedVertex + first_there[at->second - gathered]
                                     : position_ids_[at->second]);
  }
  knows_topology_ = false;
}

void GroupSimplifier::forget_added() {
  if (added_materials_.empty()) return;
  vertices_.resize(vertices_.size() - added_materials_.size());
  position_of_.resize(vertices_.size());
  positions_.resize(vertices_.size());
  while (!position_ids_.empty() && position_ids_.back() == kNone) position_ids_.pop_back();
  locked_.resize(position_ids_.size());
  components_.resize(position_ids_.size());
  added_materials_.clear();
  knows_topology_ = false;
}

}  // namespace umbel::lod
