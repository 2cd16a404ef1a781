// umbel_cuda_bvh.h over cuda_bvh.hpp. Part of the library umbel::cuda.
#include "base/fields.hpp"
#include "capi/bvh_input.hpp"
#include "capi/cuda/input.hpp"
#include "capi/guard.hpp"
#include "capi/structs.hpp"
#include "umbel/cuda_bvh.hpp"
#include "umbel/umbel_cuda_bvh.h"

namespace umbel::capi {

static_assert(sizeof(umbel_compact_info) == sizeof(bvh::CompactInfo));

cuda::DeviceBvhConfig bvh_config_of(const umbel_cuda_bvh_config* given) {
  const umbel_cuda_bvh_config c = read_struct(given, "config");
  cuda::DeviceBvhConfig config;
  config.builder = static_cast<cuda::DeviceBuilder>(c.builder);
  config.cost = {c.traversal_cost, c.intersection_cost};
  COPY_FIELDS(config, c, max_leaf_size, presplit, hlbvh_bits, treelet_size, treelet_rounds,
              ploc_radius);
  config.kmeans = kmeans_config(c);
  return config;
}

namespace {

umbel_cuda_bvh_config config_of(const cuda::DeviceBvhConfig& c) {
  return {sizeof(umbel_cuda_bvh_config),
          static_cast<uint32_t>(c.builder),
          c.cost.traversal,
          c.cost.intersection,
          c.max_leaf_size,
          c.presplit,
          c.hlbvh_bits,
          c.treelet_size,
          c.treelet_rounds,
          c.ploc_radius,
          c.kmeans.clusters,
          c.kmeans.candidates,
          c.kmeans.iterations,
          c.kmeans.distance == bvh::KmeansDistance::kManhattan ? 1u : 0u,
          c.kmeans.forwarded_clusters};
}

}  // namespace
}  // namespace umbel::capi

using umbel::capi::guard;

umbel_result umbel_cuda_bvh_config_init_sized(umbel_cuda_bvh_config* config, size_t size,
                                              const char* builder) {
  return guard([&] {
    umbel::capi::init_sized(
        &umbel::capi::required(config, "config"), size,
        umbel::capi::config_of(builder ? umbel::cuda::device_builder_preset(builder)
                                       : umbel::cuda::DeviceBvhConfig{}));
  });
}

umbel_result umbel_cuda_bvh_capacity(uint32_t triangles, const umbel_cuda_bvh_config* config,
                                     uint32_t* node_capacity, uint32_t* triangle_capacity) {
  return guard([&] {
    uint32_t& nodes = umbel::capi::required(node_capacity, "node_capacity");
    umbel::capi::required(triangle_capacity, "triangle_capacity") =
        umbel::cuda::device_references(triangles, umbel::capi::bvh_config_of(config));
    nodes = umbel::bvh::compact_node_capacity(*triangle_capacity);
  });
}

umbel_result umbel_cuda_build_bvh(void* scratch, size_t* scratch_bytes, const umbel_cuda_mesh* mesh,
                                  const umbel_cuda_bvh_config* config, const umbel_cuda_bvh* out,
                                  void* stream) {
  return guard([&] {
    umbel::cuda::build_bvh(scratch, umbel::capi::required(scratch_bytes, "scratch_bytes"),
                           umbel::capi::mesh_of(mesh), umbel::capi::bvh_config_of(config),
                           umbel::capi::bvh_of(out, scratch, "out"),
                           umbel::capi::stream_of(stream));
  });
}

umbel_result umbel_cuda_refit_bvh(void* scratch, size_t* scratch_bytes, const umbel_cuda_mesh* mesh,
                                  const umbel_cuda_bvh_config* config, const umbel_cuda_bvh* bvh,
                                  void* stream) {
  return guard([&] {
    umbel::cuda::refit_bvh(scratch, umbel::capi::required(scratch_bytes, "scratch_bytes"),
                           umbel::capi::mesh_of(mesh), umbel::capi::bvh_config_of(config),
                           umbel::capi::bvh_of(bvh, scratch), umbel::capi::stream_of(stream));
  });
}
