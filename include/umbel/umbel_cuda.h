// All of Umbel's C interface for CUDA devices, of the library umbel::cuda.
//
//   umbel_cuda_types.h     what all share
//   umbel_cuda_clusters.h  clusters of meshes that change every frame
//   umbel_cuda_bvh.h       bounding volume hierarchies, built and refitted
//   umbel_cuda_cluster_bvh.h  hierarchies over those clusters
//   umbel_cuda_trace.h     rays, closest points, overlaps
//   umbel_cuda_select.h    selection of levels of detail
//   umbel_cuda_memory.h    memory of a device, and what streams are doing
#ifndef UMBEL_UMBEL_CUDA_H
#define UMBEL_UMBEL_CUDA_H

#include "umbel/umbel_cuda_bvh.h"
#include "umbel/umbel_cuda_cluster_bvh.h"
#include "umbel/umbel_cuda_clusters.h"
#include "umbel/umbel_cuda_memory.h"
#include "umbel/umbel_cuda_select.h"
#include "umbel/umbel_cuda_trace.h"
#include "umbel/umbel_cuda_types.h"

#endif  // UMBEL_UMBEL_CUDA_H
