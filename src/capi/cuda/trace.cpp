// umbel_cuda_trace.h over cuda_trace.hpp. Part of the library umbel::cuda.
#include "capi/cuda/input.hpp"
#include "capi/guard.hpp"
#include "umbel/cuda_trace.hpp"
#include "umbel/umbel_cuda_trace.h"

namespace umbel::capi {
namespace {

cuda::DeviceRays rays_of(const umbel_cuda_rays* given) {
  const umbel_cuda_rays& r = required(given, "rays");
  return {
      r.origins, r.directions,      r.origin_stride, r.direction_stride,     r.t_min,
      r.t_max,   r.interval_stride, r.count,         r.cull_back_faces != 0, r.masks ? r.mask : ~0u,
      r.masks};
}

const Aabb* boxes_of(const umbel_aabb* boxes) { return reinterpret_cast<const Aabb*>(boxes); }

}  // namespace
}  // namespace umbel::capi

using umbel::capi::boxes_of;
using umbel::capi::bvh_of;
using umbel::capi::guard;
using umbel::capi::required;
using umbel::capi::stream_of;

umbel_result umbel_cuda_intersect(void* scratch, size_t* scratch_bytes, const umbel_cuda_bvh* bvh,
                                  const umbel_cuda_rays* rays, const umbel_cuda_hits* hits,
                                  void* stream) {
  return guard([&] {
    umbel::cuda::DeviceHits out;
    if (hits || scratch) {
      const umbel_cuda_hits& h = required(hits, "hits");
      out = {h.t, h.primitives, h.uvs};
    }
    umbel::cuda::intersect_rays(scratch, required(scratch_bytes, "scratch_bytes"),
                                bvh_of(bvh, scratch), umbel::capi::rays_of(rays), out,
                                stream_of(stream));
  });
}

umbel_result umbel_cuda_occluded(void* scratch, size_t* scratch_bytes, const umbel_cuda_bvh* bvh,
                                 const umbel_cuda_rays* rays, uint8_t* results, void* stream) {
  return guard([&] {
    if (scratch && required(rays, "rays").count > 0) required(results, "results");
    umbel::cuda::occluded_rays(scratch, required(scratch_bytes, "scratch_bytes"),
                               bvh_of(bvh, scratch), umbel::capi::rays_of(rays), results,
                               stream_of(stream));
  });
}

umbel_result umbel_cuda_closest_points(void* scratch, size_t* scratch_bytes,
                                       const umbel_cuda_bvh* bvh, const umbel_cuda_points* points,
                                       const umbel_cuda_closest* out, void* stream) {
  return guard([&] {
    const umbel_cuda_points& p = required(points, "points");
    umbel::cuda::DeviceClosest found;
    if (out || scratch) {
      const umbel_cuda_closest& o = required(out, "out");
      found = {o.points, o.distances, o.primitives, o.uvs};
    }
    umbel::cuda::closest_points(scratch, required(scratch_bytes, "scratch_bytes"),
                                bvh_of(bvh, scratch), {p.points, p.stride, p.count, p.max_distance},
                                found, stream_of(stream));
  });
}

umbel_result umbel_cuda_count_overlaps(void* scratch, size_t* scratch_bytes,
                                       const umbel_cuda_bvh* bvh, const umbel_aabb* boxes,
                                       uint32_t count, uint32_t* offsets, void* stream) {
  return guard([&] {
    umbel::cuda::count_overlaps(scratch, required(scratch_bytes, "scratch_bytes"),
                                bvh_of(bvh, scratch), boxes_of(boxes), count, offsets,
                                stream_of(stream));
  });
}

umbel_result umbel_cuda_list_overlaps(void* scratch, size_t* scratch_bytes,
                                      const umbel_cuda_bvh* bvh, const umbel_aabb* boxes,
                                      uint32_t count, uint32_t* offsets, uint32_t* primitives,
                                      uint32_t room, void* stream) {
  return guard([&] {
    umbel::cuda::list_overlaps(scratch, required(scratch_bytes, "scratch_bytes"),
                               bvh_of(bvh, scratch), boxes_of(boxes), count, offsets, primitives,
                               room, stream_of(stream));
  });
}
