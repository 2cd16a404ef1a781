#include "capi/geometry.hpp"

#include <algorithm>
#include <cstring>
#include <string>

#include "capi/guard.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {
namespace {

void append_offset(std::vector<uint32_t>& offsets, uint32_t count, const char* name) {
  const uint64_t next = uint64_t{offsets.back()} + count;
  if (next >= kNone)
    throw Error(ErrorCode::kUnsupported,
                std::string("the clusters have over 2^32 ") + name + ": ask for fewer at once");
  offsets.push_back(static_cast<uint32_t>(next));
}

void check(size_t capacity, size_t needed, const char* name) {
  if (capacity < needed)
    throw CapacityError{"geometry->" + std::string(name) + "_capacity is " +
                        std::to_string(capacity) + ", but " + std::to_string(needed) +
                        " are needed"};
}

// Where a cluster has none of a stream that others have, the values are 0.
template <typename To, typename From>
void copy(const std::vector<From>& from, To* to, size_t at, size_t count, bool others_have) {
  static_assert(sizeof(To) == sizeof(From));
  if (!to || count == 0) return;
  if (!from.empty())
    std::memcpy(to + at, from.data(), count * sizeof(From));
  else if (others_have)
    std::memset(to + at, 0, count * sizeof(To));
}

bool has_material(std::span<const Extra> extras) {
  return !extras.empty() && extras.back().kind == ExtraKind::kMaterial;
}

}  // namespace

std::vector<Extra> without_material(std::span<const Extra> extras) {
  const auto kept = extras.first(extras.size() - has_material(extras));
  return {kept.begin(), kept.end()};
}

GeometryArrays::GeometryArrays(std::span<const lod::Cluster> clusters,
                               const ClusterStreams& streams, umbel_lod_geometry* geometry)
    : out_(read_struct(geometry, "geometry")) {
  for (const lod::Cluster& cluster : clusters) {
    append_offset(vertex_offsets_, cluster.vertex_count, "vertices");
    append_offset(triangle_offsets_, cluster.triangle_count, "triangles");
    materials_.push_back(cluster.material);
  }
  out_.extra_width = extra_width(streams.extras);
  out_.streams = streams.streams | (out_.extra_width > 0 ? uint32_t{UMBEL_LOD_EXTRAS} : 0u);
  out_.cluster_count = clusters.size();
  out_.vertex_count = vertex_offsets_.back();
  out_.triangle_count = triangle_offsets_.back();
  write_struct(out_, geometry, "geometry");
  check_room();
  if (out_.source_vertices && !(out_.streams & UMBEL_LOD_SOURCE_VERTICES))
    throw Error(ErrorCode::kUnsupported,
                "geometry->source_vertices is not NULL, but files do not keep source vertices");
  if (out_.extra_values && streams.extras_differ)
    throw Error(ErrorCode::kUnsupported,
                "geometry->extra_values is not NULL, but the meshes of the page have different "
                "further attributes");
  write_clusters(clusters);
}

void GeometryArrays::check_room() const {
  const bool of_clusters = out_.vertex_offsets || out_.triangle_offsets || out_.materials;
  const bool of_vertices = out_.positions || out_.normals || out_.tangents || out_.uvs ||
                           out_.colors || out_.extra_values || out_.source_vertices;
  const bool of_triangles = out_.triangles || out_.triangle_materials;
  if (of_clusters) check(out_.cluster_capacity, out_.cluster_count, "cluster");
  if (of_vertices) check(out_.vertex_capacity, out_.vertex_count, "vertex");
  if (of_triangles) check(out_.triangle_capacity, out_.triangle_count, "triangle");
}

void GeometryArrays::write_clusters(std::span<const lod::Cluster> clusters) const {
  if (out_.vertex_offsets) std::ranges::copy(vertex_offsets_, out_.vertex_offsets);
  if (out_.triangle_offsets) std::ranges::copy(triangle_offsets_, out_.triangle_offsets);
  if (out_.materials && !clusters.empty()) std::ranges::copy(materials_, out_.materials);
}

void GeometryArrays::write(size_t i, const lod::ClusterGeometry& geometry,
                           std::span<const uint32_t> sources) const {
  const size_t first = vertex_offsets_[i], count = vertex_offsets_[i + 1] - first;
  const size_t triangle = triangle_offsets_[i], triangles = triangle_offsets_[i + 1] - triangle;
  if (geometry.positions.size() != count || geometry.triangles.size() != 3 * triangles)
    throw Error(ErrorCode::kCorrupt, "a cluster has " + std::to_string(geometry.positions.size()) +
                                         " vertices, but its table says " + std::to_string(count));
  const auto others_have = [&](umbel_lod_stream bit) { return (out_.streams & bit) != 0; };
  copy(geometry.positions, out_.positions, first, count, true);
  copy(geometry.normals, out_.normals, first, count, others_have(UMBEL_LOD_NORMALS));
  copy(geometry.tangents, out_.tangents, first, count, others_have(UMBEL_LOD_TANGENTS));
  copy(geometry.uvs, out_.uvs, first, count, others_have(UMBEL_LOD_UVS));
  copy(geometry.colors, out_.colors, first, count, others_have(UMBEL_LOD_COLORS));
  copy(geometry.triangles, out_.triangles, 3 * triangle, 3 * triangles, false);
  if (out_.extra_values) write_extras(geometry, first);
  if (out_.source_vertices) std::ranges::copy(sources, out_.source_vertices + first);
  if (out_.triangle_materials) write_triangle_materials(i, geometry);
}

void GeometryArrays::write_extras(const lod::ClusterGeometry& geometry, size_t first) const {
  const size_t count = geometry.positions.size(), given = extra_width(geometry.extras);
  float* to = out_.extra_values + first * out_.extra_width;
  if (without_material(geometry.extras).empty()) {
    std::fill_n(to, count * out_.extra_width, 0.0f);
    return;
  }
  for (size_t v = 0; v < count; ++v)
    std::copy_n(geometry.extra_values.begin() + v * given, out_.extra_width,
                to + v * out_.extra_width);
}

// Where clusters mix materials a triangle's is that of its first vertex, behind the other values.
void GeometryArrays::write_triangle_materials(size_t i,
                                              const lod::ClusterGeometry& geometry) const {
  const size_t first = triangle_offsets_[i], count = triangle_offsets_[i + 1] - first;
  const size_t width = extra_width(geometry.extras);
  const bool mixes = has_material(geometry.extras);
  for (size_t t = 0; t < count; ++t)
    out_.triangle_materials[first + t] =
        mixes ? static_cast<uint32_t>(
                    geometry.extra_values[(geometry.triangles[3 * t] + size_t{1}) * width - 1])
              : materials_[i];
}

}  // namespace umbel::capi
