// umbel_cuda_clusters.h over cuda_clusters.hpp. Part of the library umbel::cuda.
#include "capi/cuda/input.hpp"
#include "capi/frame_input.hpp"
#include "capi/guard.hpp"
#include "umbel/cuda_clusters.hpp"
#include "umbel/umbel_cuda_clusters.h"

namespace umbel::capi {
namespace {

/// What is only looked at when there is work to do may be missing before.
struct Call {
  void* scratch;
  size_t* scratch_bytes;

  size_t& bytes() const { return required(scratch_bytes, "scratch_bytes"); }
  cuda::DeviceClusters of(const umbel_cuda_clusters* given, const char* name) const {
    return clusters_of(given, scratch, name);
  }
  cuda::DeviceAreaGrowth of(const umbel_cuda_area_growth* given, const char* name) const {
    if (!given && !scratch) return {};
    const umbel_cuda_area_growth& d = required(given, name);
    return {d.now, d.at_build, d.total};
  }
};

}  // namespace
}  // namespace umbel::capi

using umbel::capi::Call;
using umbel::capi::frame_config;
using umbel::capi::guard;
using umbel::capi::mesh_of;
using umbel::capi::stream_of;

umbel_result umbel_cuda_build_frame_clusters(void* scratch, size_t* scratch_bytes,
                                             const umbel_cuda_mesh* mesh,
                                             const umbel_frame_config* config,
                                             const umbel_cuda_clusters* out, void* stream) {
  return guard([&] {
    const Call call{scratch, scratch_bytes};
    umbel::cuda::build_frame_clusters(scratch, call.bytes(), mesh_of(mesh), frame_config(config),
                                      call.of(out, "out"), stream_of(stream));
  });
}

umbel_result umbel_cuda_measure_frame_clusters(void* scratch, size_t* scratch_bytes,
                                               uint32_t triangles, const umbel_frame_config* config,
                                               const umbel_cuda_clusters* clusters,
                                               const umbel_cuda_area_growth* growth, int is_new,
                                               void* stream) {
  return guard([&] {
    const Call call{scratch, scratch_bytes};
    umbel::cuda::measure_frame_clusters(scratch, call.bytes(), triangles, frame_config(config),
                                        call.of(clusters, "clusters"), call.of(growth, "growth"),
                                        is_new != 0, stream_of(stream));
  });
}

umbel_result umbel_cuda_refit_frame_clusters(void* scratch, size_t* scratch_bytes,
                                             const umbel_cuda_mesh* mesh,
                                             const umbel_frame_config* config,
                                             const umbel_cuda_clusters* clusters,
                                             const umbel_cuda_area_growth* growth, void* stream) {
  return guard([&] {
    const Call call{scratch, scratch_bytes};
    umbel::cuda::refit_frame_clusters(scratch, call.bytes(), mesh_of(mesh), frame_config(config),
                                      call.of(clusters, "clusters"), call.of(growth, "growth"),
                                      stream_of(stream));
  });
}

umbel_result umbel_cuda_rebuild_worst_frame_clusters(
    void* scratch, size_t* scratch_bytes, const umbel_cuda_mesh* mesh,
    const umbel_frame_config* config, uint32_t budget, const umbel_cuda_clusters* clusters,
    const umbel_cuda_area_growth* growth, const umbel_cuda_clusters* out,
    const umbel_cuda_area_growth* out_growth, void* stream) {
  return guard([&] {
    const Call call{scratch, scratch_bytes};
    umbel::cuda::rebuild_worst_frame_clusters(
        scratch, call.bytes(), mesh_of(mesh), frame_config(config), budget,
        call.of(clusters, "clusters"), call.of(growth, "growth"), call.of(out, "out"),
        call.of(out_growth, "out_growth"), stream_of(stream));
  });
}

umbel_result umbel_cuda_list_frame_vertices(void* scratch, size_t* scratch_bytes,
                                            uint32_t triangles, const umbel_frame_config* config,
                                            const umbel_cuda_clusters* clusters,
                                            const umbel_cuda_vertex_lists* out, void* stream) {
  return guard([&] {
    const Call call{scratch, scratch_bytes};
    const umbel_cuda_vertex_lists lists =
        scratch ? umbel::capi::required(out, "out") : umbel_cuda_vertex_lists{};
    umbel::cuda::list_frame_vertices(
        scratch, call.bytes(), triangles, frame_config(config), call.of(clusters, "clusters"),
        {lists.offsets, lists.vertices, lists.corners}, stream_of(stream));
  });
}
