// Geometry of many clusters in arrays of a C caller.
#pragma once

#include <span>
#include <vector>

#include "umbel/lod.hpp"
#include "umbel/umbel_lod.h"

namespace umbel::capi {

/// What clusters of a DAG or of a page have besides positions.
struct ClusterStreams {
  uint32_t streams = 0;        ///< umbel_lod_stream
  std::vector<Extra> extras;   ///< without a material
  bool extras_differ = false;  ///< some clusters have others
};

/// Extras as clusters have them, where a material may be the last.
std::vector<Extra> without_material(std::span<const Extra> extras);

/// umbel_lod_stream of what `given`, a mesh or a cluster, has.
template <typename Given>
uint32_t streams_in(const Given& given) {
  uint32_t streams = 0;
  const auto add = [&](const auto& stream, umbel_lod_stream bit) {
    if (!stream.empty()) streams |= bit;
  };
  add(given.normals, UMBEL_LOD_NORMALS);
  add(given.tangents, UMBEL_LOD_TANGENTS);
  add(given.uvs, UMBEL_LOD_UVS);
  add(given.colors, UMBEL_LOD_COLORS);
  return streams;
}

class GeometryArrays {
 public:
  /// Writes the counts, and, unless all arrays are NULL, the offsets and materials of clusters.
  /// Throws CapacityError with only the counts written.
  GeometryArrays(std::span<const lod::Cluster> clusters, const ClusterStreams& streams,
                 umbel_lod_geometry* geometry);

  /// Whether `write` has anything to do.
  bool need_geometry() const {
    return out_.positions || out_.normals || out_.tangents || out_.uvs || out_.colors ||
           out_.extra_values || out_.source_vertices || out_.triangles || out_.triangle_materials;
  }
  /// Whether the caller wants to know which vertices of its own these are.
  bool want_sources() const { return out_.source_vertices != nullptr; }

  /// Writes cluster i; `sources` may be empty. Different clusters from any threads at once. Throws
  /// kCorrupt for geometry that is not as large as its table says.
  void write(size_t i, const lod::ClusterGeometry& geometry,
             std::span<const uint32_t> sources) const;

 private:
  void check_room() const;
  void write_clusters(std::span<const lod::Cluster> clusters) const;
  void write_extras(const lod::ClusterGeometry& geometry, size_t first) const;
  void write_triangle_materials(size_t i, const lod::ClusterGeometry& geometry) const;

  umbel_lod_geometry out_;  // the caller's arrays
  std::vector<uint32_t> vertex_offsets_{0}, triangle_offsets_{0}, materials_;
};

}  // namespace umbel::capi
