// All of Umbel's C interface but CUDA's (umbel_cuda.h and its neighbours, of the library
// umbel::cuda). C99.
//
//   umbel_base.h     results, errors, structs that every part shares
//   umbel_cluster.h  clusters of triangles or boxes, ordered and bounded as meshlets
//   umbel_frame_clusters.h  clusters of meshes that change every frame
//   umbel_bvh.h      bounding volume hierarchies: rays, distances, overlaps
//   umbel_dynamic_bvh.h  trees over boxes that are inserted, moved and removed one at a time
//   umbel_kdtree.h   kd-trees: the same queries; kd-trees over boxes
//   umbel_uniform.h  grids, octrees, interval hierarchies: the same queries
//   umbel_lod.h      continuous level of detail: building, saving, selecting
//   umbel_asset.h    .umbel files, and streaming them under a budget
//   umbel_instance_tree.h  .umbel files of millions of instances
#ifndef UMBEL_UMBEL_H
#define UMBEL_UMBEL_H

#include "umbel/umbel_asset.h"
#include "umbel/umbel_base.h"
#include "umbel/umbel_bvh.h"
#include "umbel/umbel_cluster.h"
#include "umbel/umbel_dynamic_bvh.h"
#include "umbel/umbel_frame_clusters.h"
#include "umbel/umbel_instance_tree.h"
#include "umbel/umbel_kdtree.h"
#include "umbel/umbel_lod.h"
#include "umbel/umbel_uniform.h"

#endif  // UMBEL_UMBEL_H
