// How each attribute of a DAG is stored: as its configuration asks, where the values fit.
#pragma once

#include <vector>

#include "asset/codec/vertex_codec.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

/// Of the values of one attribute.
struct ValueRange {
  float largest = 0;       ///< without sign, of those that are numbers
  uint32_t is_finite = 1;  ///< all of them
};

/// Of the streams that every mesh may have once; 0 or 1.
struct StreamStatistics {
  uint32_t normals = 0, tangents = 0, uvs = 0, colors = 0;  ///< whether they are there
  uint32_t positions_on_grid = 1;                           ///< of the position step
  uint32_t colors_in_range = 1;                             ///< [0, 1]
  ValueRange uv_range;
};

/// All that the choice depends on. What is known of parts can be added up.
struct VertexStatistics {
  StreamStatistics streams;
  std::vector<Extra> extras;
  std::vector<ValueRange> extra_ranges;  ///< one an extra
};
VertexStatistics vertex_statistics(const Mesh& vertices, float position_step);
/// Both have the same streams, or one of them no vertices.
void add(VertexStatistics& sum, const VertexStatistics& more);

/// Throws kInvalidArgument for a configuration out of range.
VertexFormat choose_format(const VertexStatistics& vertices, float position_step,
                           const AssetConfig& config);
VertexFormat choose_format(const lod::Dag& dag, const AssetConfig& config);

}  // namespace umbel::asset
