// One cut as an ordinary mesh. Clusters carry their own copies of the vertices on their borders;
// here copies that are equal in every bit become one vertex again.
#include <algorithm>
#include <bit>
#include <cstring>

#include "base/hash.hpp"
#include "base/interner.hpp"
#include "base/poll.hpp"
#include "lod/dag/join_clusters.hpp"

namespace umbel::lod {
namespace {

/// All bits of one vertex: position 3, normal 3, tangent 4, uv 2, color 4, the number of its
/// further attributes, and 0.
using Key = std::array<uint32_t, 18>;
using ExtraKey = std::array<uint32_t, kMostExtraValues>;

template <typename T>
void put(Key& key, size_t at, const std::vector<T>& stream, size_t i) {
  if (!stream.empty()) std::memcpy(&key[at], &stream[i], sizeof(T));
}

Key key_of(const ClusterGeometry& g, size_t i) {
  Key key{};
  put(key, 0, g.positions, i);
  put(key, 3, g.normals, i);
  put(key, 6, g.tangents, i);
  put(key, 10, g.uvs, i);
  put(key, 12, g.colors, i);
  return key;
}

struct KeyHash {
  uint64_t operator()(const auto& key) const {
    uint64_t h = 0;
    for (size_t i = 0; i < key.size(); i += 2)
      h = std::rotl(h, 27) * 0x9e3779b97f4a7c15ull ^ (uint64_t{key[i]} << 32 | key[i + 1]);
    return mix64(h);
  }
};

void check(const ClusterGeometry& g, uint32_t cluster) {
  const size_t n = g.positions.size();
  const auto fits = [&](size_t size) { return size == 0 || size == n; };
  const char* wrong = nullptr;
  if (!fits(g.normals.size()) || !fits(g.tangents.size()) || !fits(g.uvs.size()) ||
      !fits(g.colors.size()) || extra_width(g.extras) > kMostExtraValues ||
      g.extra_values.size() != n * extra_width(g.extras))
    wrong = "has attributes that are not one a vertex";
  if (g.triangles.size() % 3 != 0) wrong = "has triangle indices that are not three a triangle";
  for (const uint8_t v : g.triangles)
    if (v >= n) wrong = "has a triangle whose vertex index is out of range";
  if (wrong)
    throw Error(ErrorCode::kCorrupt,
                "mesh_of_cut: cluster " + std::to_string(cluster) + " " + wrong);
}

/// Appends vertex `i`. A stream that only some clusters have is filled with zeros in the others.
template <typename T>
void append(std::vector<T>& out, size_t index, const std::vector<T>& stream, size_t i) {
  if (stream.empty() && out.empty()) return;
  out.resize(index, T{});
  out.push_back(stream.empty() ? T{} : stream[i]);
}

void append_decoded(Mesh& mesh, const ClusterGeometry& g, size_t i) {
  const size_t index = mesh.positions.size();
  mesh.positions.push_back(g.positions[i]);
  append(mesh.normals, index, g.normals, i);
  append(mesh.tangents, index, g.tangents, i);
  append(mesh.uvs, index, g.uvs, i);
  append(mesh.colors, index, g.colors, i);
}

/// Further attributes of vertices, except for their material, which triangles get.
class ExtraJoiner {
 public:
  explicit ExtraJoiner(Mesh& mesh) : mesh_(mesh) {}

  void begin(const ClusterGeometry& g, uint32_t cluster) {
    values_ = g.extra_values.data();
    width_ = extra_width(g.extras);
    has_material_ = !g.extras.empty() && g.extras.back().kind == ExtraKind::kMaterial;
    const std::span<const Extra> kept(g.extras.data(), g.extras.size() - (has_material_ ? 1 : 0));
    if (mesh_.positions.empty()) mesh_.extras.assign(kept.begin(), kept.end());
    if (!std::ranges::equal(kept, mesh_.extras))
      throw Error(ErrorCode::kCorrupt, "mesh_of_cut: cluster " + std::to_string(cluster) +
                                           " has other further attributes than those before it");
  }
  bool has_material() const { return has_material_; }

  uint32_t number(size_t vertex) {
    const size_t count = width_ - (has_material_ ? 1 : 0);
    if (count == 0) return 0;
    ExtraKey key{};
    std::memcpy(key.data(), values_ + vertex * width_, count * sizeof(float));
    return records_.insert(key).first;
  }
  void append(size_t vertex) {
    const float* from = values_ + vertex * width_;
    mesh_.extra_values.insert(mesh_.extra_values.end(), from,
                              from + width_ - (has_material_ ? 1 : 0));
  }
  uint32_t material(size_t vertex) const {
    const float value = values_[(vertex + 1) * width_ - 1];
    return value >= 0 && value <= 0x1p24f ? static_cast<uint32_t>(value) : 0;
  }

 private:
  Mesh& mesh_;
  const float* values_ = nullptr;
  size_t width_ = 0;
  bool has_material_ = false;
  Interner<ExtraKey, KeyHash> records_;
};

}  // namespace

Mesh join_clusters(std::span<const JoinedCluster> cut, const GeometryReader& geometry) {
  size_t triangles = 0;
  bool materials = false;
  for (const JoinedCluster& c : cut) {
    triangles += c.triangles;
    materials |= c.material != 0;
  }
  Mesh mesh;
  mesh.triangles.reserve(triangles);
  Interner<Key, KeyHash> vertices(triangles / 2);
  ExtraJoiner extras(mesh);
  std::vector<uint32_t> index;
  for (size_t k = 0; k < cut.size(); ++k) {
    poll();
    const uint32_t c = cut[k].id;
    const ClusterGeometry g = geometry(static_cast<uint32_t>(k));
    check(g, c);
    extras.begin(g, c);
    index.clear();
    for (size_t i = 0; i < g.positions.size(); ++i) {
      Key key = key_of(g, i);
      key[16] = extras.number(i);
      const auto [vertex, is_new] = vertices.insert(key);
      if (is_new) {
        append_decoded(mesh, g, i);
        extras.append(i);
      }
      index.push_back(vertex);
    }
    for (size_t t = 0; t < g.triangles.size(); t += 3) {
      mesh.triangles.push_back(
          {index[g.triangles[t]], index[g.triangles[t + 1]], index[g.triangles[t + 2]]});
      if (!extras.has_material()) continue;
      const uint32_t material = extras.material(g.triangles[t]);
      if (material != 0) materials = true;
      mesh.materials.resize(mesh.triangles.size() - 1, 0);
      mesh.materials.push_back(material);
    }
    if (materials) mesh.materials.resize(mesh.triangles.size(), cut[k].material);
  }
  if (!materials) mesh.materials.clear();
  // A stream that ended before the last vertices, because their clusters lack it.
  const size_t n = mesh.positions.size();
  if (!mesh.normals.empty()) mesh.normals.resize(n);
  if (!mesh.tangents.empty()) mesh.tangents.resize(n);
  if (!mesh.uvs.empty()) mesh.uvs.resize(n);
  if (!mesh.colors.empty()) mesh.colors.resize(n);
  return mesh;
}

Mesh mesh_of_cut(const Tables& tables, const GeometryReader& geometry,
                 std::span<const uint32_t> cut) {
  std::vector<JoinedCluster> clusters;
  clusters.reserve(cut.size());
  for (const uint32_t c : cut) {
    if (c >= tables.clusters.size())
      throw Error(ErrorCode::kInvalidArgument, "mesh_of_cut: cluster " + std::to_string(c) +
                                                   " of the cut is out of range, there are " +
                                                   std::to_string(tables.clusters.size()));
    clusters.push_back({c, tables.clusters[c].material, tables.clusters[c].triangle_count});
  }
  return join_clusters(clusters, [&](uint32_t k) { return geometry(cut[k]); });
}

}  // namespace umbel::lod
