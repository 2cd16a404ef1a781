#include "lod/simplify/group_mesh.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>

#include "base/hash.hpp"
#include "base/math.hpp"

namespace umbel::lod {

void GroupMesh::gather(const ClusterSet& set, std::span<const uint32_t> clusters,
                       std::span<const uint8_t> is_locked) {
  gather_triangles(set, clusters);
  number_positions();
  const size_t count = position_count();
  locked.resize(count);
  non_manifold_component.resize(count);
  for (size_t p = 0; p < count; ++p) {
    locked[p] = is_locked[position_ids[p]];
    non_manifold_component[p] = source.non_manifold_components[position_ids[p]];
  }
  positions.resize(vertices.size());
  // Without negative zeros, meshoptimizer sees equal positions as equal bits.
  for (size_t v = 0; v < vertices.size(); ++v)
    positions[v] =
        without_negative_zero(source.mesh.positions[position_ids[position_of[v]]] * source.scale);
  std::erase_if(triangles, [&](const Triangle& t) { return is_degenerate(t); });
  has_non_manifold = std::any_of(non_manifold_component.begin(), non_manifold_component.end(),
                                 [](uint32_t component) { return component != kNone; });
  drop_repeated_triangles();
  position_triangles_.clear();
  attributes.gather(vertices);
}

void GroupMesh::gather_triangles(const ClusterSet& set, std::span<const uint32_t> clusters) {
  vertices.clear();
  triangles.clear();
  size_t most_vertices = 0;
  for (uint32_t c : clusters) most_vertices += set.cluster_vertices(c).size();
  index_.reset(most_vertices);
  const auto number_of = [&](uint32_t vertex) {
    const uint32_t next = static_cast<uint32_t>(vertices.size());
    const uint32_t found = index_.find_or_insert(
        IntegerHash()(vertex), next, [&](uint32_t local) { return vertices[local] == vertex; });
    if (found == next) vertices.push_back(vertex);
    return found;
  };
  std::array<uint32_t, 256> local;
  for (uint32_t c : clusters) {
    const auto of_cluster = set.cluster_vertices(c);
    for (size_t i = 0; i < of_cluster.size(); ++i) local[i] = number_of(of_cluster[i]);
    const auto corners = set.cluster_corners(c);
    for (size_t i = 0; i < corners.size(); i += 3)
      triangles.push_back({local[corners[i]], local[corners[i + 1]], local[corners[i + 2]]});
  }
}

void GroupMesh::number_positions() {
  const size_t count = vertices.size();
  position_of.resize(count);
  position_ids.clear();
  if (!source.has_wedges) {
    std::iota(position_of.begin(), position_of.end(), 0u);
    position_ids = vertices;
    return;
  }
  index_.reset(count);
  for (size_t v = 0; v < count; ++v) {
    const uint32_t id = source.position_ids[vertices[v]];
    const uint32_t next = static_cast<uint32_t>(position_ids.size());
    position_of[v] = index_.find_or_insert(IntegerHash()(id), next,
                                           [&](uint32_t p) { return position_ids[p] == id; });
    if (position_of[v] == next) position_ids.push_back(id);
  }
}

// A triangle that is there twice with the same vertices and the same front looks as one does. Its
// edges are non-manifold.
void GroupMesh::drop_repeated_triangles() {
  if (!has_non_manifold) return;
  index_.reset(triangles.size());
  const auto normal_form = [](const Triangle& t) {
    const size_t first = std::min_element(t.begin(), t.end()) - t.begin();
    return Triangle{t[first], t[(first + 1) % 3], t[(first + 2) % 3]};
  };
  uint32_t kept = 0;
  const auto is_non_manifold = [&](uint32_t v) {
    return non_manifold_component[position_of[v]] != kNone;
  };
  for (size_t i = 0; i < triangles.size(); ++i) {
    if (!std::all_of(triangles[i].begin(), triangles[i].end(), is_non_manifold)) {
      triangles[kept++] = triangles[i];
      continue;
    }
    const Triangle t = normal_form(triangles[i]);
    const uint64_t hash = mix64((uint64_t{t[0]} << 32 | t[1]) ^ mix64(t[2]));
    const uint32_t found = index_.find_or_insert(
        hash, kept, [&](uint32_t j) { return normal_form(triangles[j]) == t; });
    if (found == kept) triangles[kept++] = triangles[i];
  }
  triangles.resize(kept);
}

std::span<const Triangle> GroupMesh::position_triangles() {
  if (!source.has_wedges) return triangles;
  if (position_triangles_.empty())
    for (const Triangle& t : triangles) position_triangles_.push_back(positions_of(t));
  return position_triangles_;
}

uint32_t GroupMesh::material(uint32_t vertex) const {
  const uint32_t v = vertices[vertex];
  return v >= kAddedVertex ? added_materials_[v - kAddedVertex] : source.material(v);
}

std::vector<uint32_t> GroupMesh::materials() const {
  std::vector<uint32_t> result;
  if (source.vertex_materials.empty()) return result;
  for (uint32_t v = 0; v < vertices.size(); ++v) result.push_back(material(v));
  return result;
}

bool GroupMesh::mixes_materials(std::span<const Triangle> some) const {
  if (source.vertex_materials.empty()) return false;
  return std::any_of(some.begin(), some.end(), [&](const Triangle& t) {
    const uint32_t m = material(t[0]);
    return material(t[1]) != m || material(t[2]) != m;
  });
}

// Behind the gathered vertices and positions.
void GroupMesh::append(const Mesh& made, AddedVertices& added) {
  added_materials_ = added.materials;
  const size_t count = made.positions.size();
  if (count == 0) return;
  const auto key = [](const Vec3& p) {
    return std::bit_cast<std::array<float, 3>>(without_negative_zero(p));
  };
  std::map<std::array<float, 3>, uint32_t> known;  // positions
  for (uint32_t v = 0; v < vertices.size(); ++v)
    known.insert({key(source.mesh.positions[vertices[v]]), position_of[v]});
  std::vector<uint32_t> first_there;  // of the added, by their new positions
  const uint32_t gathered = static_cast<uint32_t>(position_count());
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3& p = made.positions[i];
    const auto [at, is_new] = known.insert({key(p), static_cast<uint32_t>(position_count())});
    if (is_new) {
      position_ids.push_back(kNone);
      locked.push_back(0);
      non_manifold_component.push_back(kNone);
      first_there.push_back(i);
    }
    vertices.push_back(kAddedVertex + i);
    position_of.push_back(at->second);
    positions.push_back(p * source.scale);
    added.position_ids.push_back(is_new ? kNone
                                 : at->second >= gathered
                                     ? kAddedVertex + first_there[at->second - gathered]
                                     : position_ids[at->second]);
  }
}

void GroupMesh::remove_appended() {
  if (added_materials_.empty()) return;
  vertices.resize(vertices.size() - added_materials_.size());
  position_of.resize(vertices.size());
  positions.resize(vertices.size());
  while (!position_ids.empty() && position_ids.back() == kNone) position_ids.pop_back();
  locked.resize(position_count());
  non_manifold_component.resize(position_count());
  added_materials_.clear();
}

}  // namespace umbel::lod
