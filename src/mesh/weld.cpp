// Merges equal vertices. Triangles are walked once to list the vertices they use by first use
// (a vertex once more wherever the material changes); the list goes through a hash table whose
// hashes were made in parallel and whose slots are loaded ahead; equal entries become one vertex.
// The list is in order of first use, and so are the vertices that come out.
#include "mesh/weld.hpp"

#include <algorithm>
#include <array>

#include "base/big_vector.hpp"
#include "base/hash_index.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "mesh/streams.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel {
namespace {

/// What may become a vertex: a vertex of the input, with the material of a triangle that uses it.
struct Candidates {
  std::vector<uint32_t> vertices;
  std::vector<uint32_t> materials;  // empty where the mesh has none
};

template <bool kMaterials>
Candidates list_candidates(const MeshView& mesh, std::vector<Triangle>& corners) {
  Candidates list;
  BigVector<uint32_t> last(mesh.positions.size(), kNone);
  reserve_big(list.vertices, mesh.positions.size());
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (uint32_t corner = 0; corner < 3; ++corner) {
      const uint32_t vertex = mesh.triangles[i][corner];
      uint32_t& candidate = last[vertex];
      bool is_new = candidate == kNone;
      if constexpr (kMaterials) is_new = is_new || list.materials[candidate] != mesh.materials[i];
      if (is_new) {
        candidate = static_cast<uint32_t>(list.vertices.size());
        list.vertices.push_back(vertex);
        if constexpr (kMaterials) list.materials.push_back(mesh.materials[i]);
      }
      corners[i][corner] = candidate;
    }
  }
  return list;
}

std::span<const float> extra_of(const MeshView& mesh, uint32_t vertex) {
  const size_t width = mesh.extras.empty() ? 0 : extra_width(mesh.extras);
  return mesh.extra_values.subspan(vertex * width, width);
}

uint64_t hash_of(const MeshView& mesh, const Candidates& list, size_t candidate) {
  const uint32_t vertex = list.vertices[candidate];
  uint64_t hash = list.materials.empty() ? 0 : list.materials[candidate];
  if (!mesh.normals.empty()) hash = hash_value(mesh.normals[vertex], hash);
  if (!mesh.tangents.empty()) hash = hash_value(mesh.tangents[vertex], hash);
  if (!mesh.uvs.empty()) hash = hash_value(mesh.uvs[vertex], hash);
  if (!mesh.colors.empty()) hash = hash_value(mesh.colors[vertex], hash);
  for (const float& value : extra_of(mesh, vertex))
    hash = hash_value(std::array<float, 1>{value}, hash);
  return hash_value(mesh.positions[vertex], hash);
}

template <typename Vector>
bool equal_in(std::span<const Vector> stream, uint32_t a, uint32_t b) {
  return stream.empty() || same_value(stream[a], stream[b]);
}

bool are_equal(const MeshView& mesh, const Candidates& list, uint32_t a, uint32_t b) {
  const uint32_t i = list.vertices[a], j = list.vertices[b];
  if (!list.materials.empty() && list.materials[a] != list.materials[b]) return false;
  return equal_in(mesh.positions, i, j) && equal_in(mesh.normals, i, j) &&
         equal_in(mesh.tangents, i, j) && equal_in(mesh.uvs, i, j) && equal_in(mesh.colors, i, j) &&
         std::ranges::equal(extra_of(mesh, i), extra_of(mesh, j));
}

/// The new index of each candidate, or nothing where they keep theirs; shrinks `list.vertices` to
/// the first of each kind.
std::vector<uint32_t> number_distinct(const MeshView& mesh, Candidates& list) {
  const size_t count = list.vertices.size();
  BigVector<uint64_t> hashes(count);
  parallel_for(count, 1 << 14, [&](size_t i) { hashes[i] = hash_of(mesh, list, i); });

  std::vector<uint32_t> numbers(count), distinct;
  distinct.reserve(count);
  HashIndex table(count);
  for_each_prefetched(table, hashes, [&](uint32_t i, uint64_t hash) {
    const uint32_t first = table.find_or_insert(
        hash, i, [&](uint32_t other) { return are_equal(mesh, list, i, other); });
    if (first == i) {
      numbers[i] = static_cast<uint32_t>(distinct.size());
      distinct.push_back(list.vertices[i]);
    } else {
      numbers[i] = numbers[first];
    }
  });
  if (distinct.size() == count) return {};
  list.vertices = std::move(distinct);
  return numbers;
}

template <typename Vector>
std::vector<Vector> gathered(std::span<const Vector> stream, const std::vector<uint32_t>& from) {
  std::vector<Vector> result;
  if (stream.empty()) return result;
  reserve_big(result, from.size());
  result.resize(from.size());
  parallel_for(from.size(), 1 << 14,
               [&](size_t i) { result[i] = without_negative_zero(stream[from[i]]); });
  return result;
}

std::vector<float> gathered_extras(const MeshView& mesh, const std::vector<uint32_t>& from) {
  const size_t width = extra_width(mesh.extras);
  std::vector<float> result(from.size() * width);
  if (width == 0) return result;
  parallel_for(from.size(), 1 << 14, [&](size_t i) {
    std::ranges::transform(extra_of(mesh, from[i]), result.begin() + i * width,
                           [](float f) { return without_negative_zero(f); });
  });
  return result;
}

}  // namespace

Mesh weld(const MeshView& mesh, const BuildOptions& options) {
  return weld_and_trace(mesh, options).mesh;
}

TracedWeld weld_and_trace(const MeshView& mesh, const BuildOptions& options) {
  check_streams(mesh);
  // Corners may each become a vertex of their own, and vertices have 32-bit numbers.
  if (mesh.triangles.size() > kNone / 3)
    throw Error(ErrorCode::kUnsupported, "the mesh has " + std::to_string(mesh.triangles.size()) +
                                             " triangles; at most " + std::to_string(kNone / 3) +
                                             " can be welded");
  Progress progress(options);
  progress.report(0, "welding");
  TracedWeld welded;
  Mesh& result = welded.mesh;
  with_threads(options.threads, [&] {
    check_indices(mesh);
    reserve_big(result.triangles, mesh.triangles.size());
    result.triangles.resize(mesh.triangles.size());
    result.materials.assign(mesh.materials.begin(), mesh.materials.end());
    Candidates list = mesh.materials.empty() ? list_candidates<false>(mesh, result.triangles)
                                             : list_candidates<true>(mesh, result.triangles);
    const std::vector<uint32_t> numbers = number_distinct(mesh, list);
    if (!numbers.empty())
      parallel_for(result.triangles.size(), kTriangleChunk, [&](size_t i) {
        for (uint32_t& corner : result.triangles[i]) corner = numbers[corner];
      });
    result.positions = gathered(mesh.positions, list.vertices);
    result.normals = gathered(mesh.normals, list.vertices);
    result.tangents = gathered(mesh.tangents, list.vertices);
    result.uvs = gathered(mesh.uvs, list.vertices);
    result.colors = gathered(mesh.colors, list.vertices);
    result.extras.assign(mesh.extras.begin(), mesh.extras.end());
    result.extra_values = gathered_extras(mesh, list.vertices);
    welded.sources = std::move(list.vertices);
  });
  progress.report(1, "welding");
  return welded;
}

}  // namespace umbel
