// All of Umbel's C++ interface but CUDA's (cuda.hpp and its neighbours, of the library
// umbel::cuda).
#pragma once

#include "umbel/asset.hpp"
#include "umbel/bvh.hpp"
#include "umbel/bvh_presets.hpp"
#include "umbel/bvh_traverse.hpp"
#include "umbel/camera.hpp"
#include "umbel/cluster.hpp"
#include "umbel/compact_bvh.hpp"
#include "umbel/frame_clusters.hpp"
#include "umbel/kdtree.hpp"
#include "umbel/lod.hpp"
#include "umbel/mesh.hpp"
#include "umbel/ray_arrays.hpp"
#include "umbel/stream.hpp"
#include "umbel/trace.hpp"
#include "umbel/trace_material.hpp"
#include "umbel/triangle_bvh.hpp"
#include "umbel/triangle_queries.hpp"
#include "umbel/types.hpp"
#include "umbel/uniform.hpp"
#include "umbel/version.hpp"
