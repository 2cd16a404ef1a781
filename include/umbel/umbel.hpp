// All of Umbel's C++ interface.
#pragma once

#include "umbel/asset.hpp"
#include "umbel/bvh.hpp"
#include "umbel/bvh_presets.hpp"
#include "umbel/bvh_traverse.hpp"
#include "umbel/cluster.hpp"
#include "umbel/frame_clusters.hpp"
#include "umbel/kdtree.hpp"
#include "umbel/lod.hpp"
#include "umbel/lod_select.hpp"
#include "umbel/mesh.hpp"
#include "umbel/ray_arrays.hpp"
#include "umbel/stream.hpp"
#include "umbel/triangle_bvh.hpp"
#include "umbel/types.hpp"
#include "umbel/uniform.hpp"
#include "umbel/version.hpp"
