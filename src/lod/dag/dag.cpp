// The geometry of one cluster, gathered from the DAG's shared vertices.
#include "umbel/lod/build.hpp"

namespace umbel::lod {
namespace {

template <typename T>
std::vector<T> gather(const std::vector<T>& stream, std::span<const uint32_t> indices) {
  std::vector<T> out;
  if (stream.empty()) return out;
  out.reserve(indices.size());
  for (const uint32_t i : indices) out.push_back(stream[i]);
  return out;
}

}  // namespace

ClusterGeometry Dag::geometry(uint32_t cluster) const {
  if (cluster >= tables.clusters.size())
    throw Error(ErrorCode::kInvalidArgument, "Dag::geometry: cluster " + std::to_string(cluster) +
                                                 " is out of range, there are " +
                                                 std::to_string(tables.clusters.size()));
  const std::span<const uint32_t> used(cluster_vertices.data() + vertex_offsets[cluster],
                                       vertex_offsets[cluster + 1] - vertex_offsets[cluster]);
  ClusterGeometry geometry;
  geometry.positions = gather(vertices.positions, used);
  geometry.normals = gather(vertices.normals, used);
  geometry.tangents = gather(vertices.tangents, used);
  geometry.uvs = gather(vertices.uvs, used);
  geometry.colors = gather(vertices.colors, used);
  geometry.extras = vertices.extras;
  const size_t width = extra_width(vertices.extras);
  for (const uint32_t v : used)
    geometry.extra_values.insert(geometry.extra_values.end(),
                                 vertices.extra_values.begin() + width * v,
                                 vertices.extra_values.begin() + width * (v + 1));
  geometry.triangles.assign(cluster_triangles.begin() + size_t{3} * triangle_offsets[cluster],
                            cluster_triangles.begin() + size_t{3} * triangle_offsets[cluster + 1]);
  return geometry;
}

}  // namespace umbel::lod
