// What umbel_lod.h's functions are given, as the C++ interface takes it.
#pragma once

#include "capi/bvh_input.hpp"
#include "umbel/lod.hpp"
#include "umbel/umbel_lod.h"

/// What a C caller holds.
struct umbel_lod_tables {
  umbel::lod::Tables tables;
};
struct umbel_lod {
  umbel::lod::Dag dag;
  umbel_lod_tables tables;  ///< a copy of its tables
};
struct umbel_mesh {
  umbel::Mesh mesh;
};

namespace umbel::capi {

struct LodMesh {
  MeshView view;
  std::span<const uint8_t> locked;
  Mesh copied;  ///< streams of the caller's that have gaps
};
/// Views of the caller's arrays. What they hold is checked by who reads them.
LodMesh lod_mesh(const umbel_lod_mesh* mesh);
/// The arrays of a mesh, as C sees them.
umbel_lod_mesh mesh_as_c(const MeshView& mesh);

/// The caller's config; the defaults where `config` is NULL.
lod::Config lod_config(const umbel_lod_config* config);
/// The caller's view.
lod::View view_of(const umbel_lod_view* given);
/// The callback of a config, if it has one.
lod::Decimator lod_decimator(const umbel_lod_config* config);

}  // namespace umbel::capi
