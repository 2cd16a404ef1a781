#include "lod/dag/source.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/big_vector.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "lod/dag/cluster_topology.hpp"
#include "mesh/weld.hpp"

namespace umbel::lod {
namespace {

// Beyond this the square of a distance overflows in selection's 32-bit arithmetic.
constexpr float kLargestCoordinate = 1e18f;

// Where vertices have nothing but a position, welding has left one at each.
std::vector<uint32_t> find_position_ids(const Source& source) {
  const Mesh& mesh = source.mesh;
  const bool only_positions = source.vertex_materials.empty() && mesh.normals.empty() &&
                              mesh.tangents.empty() && mesh.uvs.empty() && mesh.colors.empty() &&
                              mesh.materials.empty() && mesh.extras.empty();
  if (!only_positions) return position_ids(mesh.positions);
  std::vector<uint32_t> ids;
  reserve_big(ids, mesh.positions.size());
  ids.resize(mesh.positions.size());
  std::iota(ids.begin(), ids.end(), 0u);
  return ids;
}

// The i-th becomes the `from[i]`-th of what was there.
template <typename Value>
void permute(std::vector<Value>& values, const std::vector<uint32_t>& from) {
  if (values.empty()) return;
  std::vector<Value> result;
  reserve_big(result, from.size());
  result.resize(from.size());
  parallel_for(from.size(), 1 << 14, [&](size_t i) { result[i] = values[from[i]]; });
  values = std::move(result);
}

void permute_extras(Mesh& mesh, const std::vector<uint32_t>& from) {
  if (mesh.extras.empty()) return;
  const size_t width = extra_width(mesh.extras);
  std::vector<float> result(from.size() * width);
  for (size_t i = 0; i < from.size(); ++i)
    std::copy_n(mesh.extra_values.begin() + width * from[i], width, result.begin() + width * i);
  mesh.extra_values = std::move(result);
}

}  // namespace

float simplification_scale(const Aabb& box) {
  const Vec3 size = box.max - box.min;
  const float extent = std::max({size.x, size.y, size.z});
  // Ordinary meshes are left alone: scaling could underflow their smallest coordinates.
  if (extent == 0.0f || (extent > 1e-6f && extent < 1e6f)) return 1.0f;
  // What is smaller still than the largest power of two can scale is as large as that makes it.
  return std::ldexp(1.0f, std::min(-std::ilogb(extent), 126));
}

Source make_source(const MeshView& input, const BuildOptions& options) {
  Source source;
  TracedWeld welded = weld_and_trace(input, options);
  source.mesh = std::move(welded.mesh);
  source.caller_vertices = std::move(welded.sources);
  const Mesh& mesh = source.mesh;
  const Aabb box = bounds(mesh.view());
  for (float c : {box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z})
    if (!mesh.triangles.empty() && std::fabs(c) > kLargestCoordinate)
      throw Error(ErrorCode::kUnsupported,
                  "coordinate " + printed(c) + " is too large: the limit is 1e18 in magnitude");
  if (!mesh.triangles.empty()) source.scale = simplification_scale(box);

  if (std::any_of(mesh.materials.begin(), mesh.materials.end(),
                  [](uint32_t m) { return m != 0; })) {
    source.vertex_materials.resize(mesh.positions.size());
    for (size_t i = 0; i < mesh.triangles.size(); ++i)
      for (uint32_t v : mesh.triangles[i]) source.vertex_materials[v] = mesh.materials[i];
  }
  find_shared_positions(source);
  return source;
}

void find_shared_positions(Source& source) {
  source.position_ids = find_position_ids(source);
  for (uint32_t v = 0; v < source.position_ids.size(); ++v)
    source.has_wedges |= source.position_ids[v] != v;
  if (source.vertex_materials.empty()) return;
  source.several_materials.resize(source.position_ids.size(), 0);
  for (size_t v = 0; v < source.position_ids.size(); ++v) {
    const uint32_t p = source.position_ids[v];
    if (source.vertex_materials[v] != source.vertex_materials[p]) source.several_materials[p] = 1;
  }
}

void append_vertex(Mesh& to, const Mesh& from, uint32_t vertex) {
  const auto append = [&](auto& stream, const auto& values) {
    if (!values.empty()) stream.push_back(values[vertex]);
  };
  append(to.positions, from.positions);
  append(to.normals, from.normals);
  append(to.tangents, from.tangents);
  append(to.uvs, from.uvs);
  append(to.colors, from.colors);
  if (from.extras.empty()) return;
  const size_t width = extra_width(from.extras);
  to.extras = from.extras;
  const float* values = from.extra_values.data() + vertex * width;
  to.extra_values.insert(to.extra_values.end(), values, values + width);
}

uint32_t append_vertices(Source& source, const AddedVertices& added) {
  const uint32_t first = static_cast<uint32_t>(source.mesh.positions.size());
  const size_t count = added.mesh.positions.size();
  if (first + count >= kAddedVertex)
    throw Error(ErrorCode::kUnsupported, "the levels of detail have over 2^31 vertices");
  for (uint32_t v = 0; v < count; ++v) {
    append_vertex(source.mesh, added.mesh, v);
    source.caller_vertices.push_back(kNone);
    const uint32_t shared = added.position_ids[v];
    const uint32_t earlier = first + (shared - kAddedVertex);
    source.position_ids.push_back(shared == kNone          ? first + v
                                  : shared >= kAddedVertex ? source.position_ids[earlier]
                                                           : shared);
    const uint32_t component = added.components.empty() ? kNone : added.components[v];
    source.non_manifold_components.push_back(
        component == kNone ? kNone : first + (component - kAddedVertex));
    source.has_wedges |= shared != kNone;
    if (source.vertex_materials.empty()) continue;
    source.vertex_materials.push_back(added.materials[v]);
    source.several_materials.push_back(0);
  }
  return first;
}

BigVector<uint32_t> order_vertices(Source& source, ClusterSet& clusters) {
  const size_t count = source.mesh.positions.size();
  BigVector<uint32_t> number(count, kNone);
  std::vector<uint32_t> from;
  reserve_big(from, count);
  for (uint32_t& v : clusters.vertices) {
    if (number[v] == kNone) {
      number[v] = static_cast<uint32_t>(from.size());
      from.push_back(v);
    }
    v = number[v];
  }
  Mesh& mesh = source.mesh;
  permute(mesh.positions, from);
  permute(mesh.normals, from);
  permute(mesh.tangents, from);
  permute(mesh.uvs, from);
  permute(mesh.colors, from);
  permute_extras(mesh, from);
  permute(source.vertex_materials, from);
  permute(source.several_materials, from);
  permute(source.caller_vertices, from);
  permute(source.position_ids, from);
  for (uint32_t& id : source.position_ids) id = number[id];
  return number;
}

size_t settle_source(Source& source, const ClusterSet& clusters, std::span<const uint32_t> frozen,
                     std::vector<PositionPair>* undecided) {
  source.mesh.triangles = {};
  ClusterTopology topology = cluster_topology(clusters, source.position_ids, frozen);
  source.non_manifold_components = std::move(topology.non_manifold_components);
  if (undecided != nullptr) *undecided = std::move(topology.undecided);
  return topology.degenerate_triangles;
}

}  // namespace umbel::lod
