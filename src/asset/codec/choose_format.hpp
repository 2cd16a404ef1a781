// How each attribute of a DAG is stored: as its configuration asks, where the values fit.
#pragma once

#include "asset/codec/vertex_codec.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

/// Throws kInvalidArgument for a configuration out of range, and for positions that are not on the
/// grid that the DAG's configuration says they are on.
VertexFormat choose_format(const lod::Dag& dag, const AssetConfig& config);

}  // namespace umbel::asset
