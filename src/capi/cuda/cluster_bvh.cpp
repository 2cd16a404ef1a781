// umbel_cuda_cluster_bvh.h over cuda_cluster_bvh.hpp. Part of the library umbel::cuda.
#include "capi/cuda/input.hpp"
#include "capi/frame_input.hpp"
#include "capi/guard.hpp"

using namespace umbel::capi;

umbel_result umbel_cuda_build_cluster_bvh(void* scratch, size_t* scratch_bytes,
                                          const umbel_cuda_mesh* mesh,
                                          const umbel_frame_config* cluster_config,
                                          const umbel_cuda_clusters* clusters,
                                          const umbel_cuda_bvh_config* config,
                                          const umbel_cuda_bvh* out, void* stream) {
  return guard([&] {
    umbel::cuda::build_cluster_bvh(
        scratch, required(scratch_bytes, "scratch_bytes"), mesh_of(mesh),
        frame_config(cluster_config), clusters_of(clusters, scratch, "clusters"),
        bvh_config_of(config), bvh_of(out, scratch, "out"), stream_of(stream));
  });
}
