// The functions of umbel/cuda_trace.hpp: queries of bvh/compressed on an executor.

#include <string>

#include "bvh/compressed/trace_batches.hpp"
#include "cuda/run.hpp"
#include "umbel/cuda_trace.hpp"

namespace umbel::cuda {
namespace {

bvh::CompactTree tree_of(const DeviceBvh& bvh) { return {bvh.nodes, bvh.triangles, bvh.info}; }

void check_stride(size_t stride, size_t least, const char* name) {
  if (stride < least || stride % sizeof(float) != 0)
    throw Error(ErrorCode::kInvalidArgument,
                std::string(name) + " must be a multiple of 4 and at least " +
                    std::to_string(least) + ", not " + std::to_string(stride));
}

void check_rays(const DeviceRays& rays) {
  check_stride(rays.origin_stride, sizeof(Vec3), "origin_stride");
  check_stride(rays.direction_stride, sizeof(Vec3), "direction_stride");
  check_stride(rays.interval_stride, sizeof(float), "interval_stride");
}

}  // namespace

void intersect_rays(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh,
                    const DeviceRays& rays, const DeviceHits& hits, Stream stream) {
  check_rays(rays);
  run(scratch, scratch_bytes, stream, bvh.nodes, [&](auto& exec) {
    exec.for_each_traversal(rays.count, TraceRay<false>{tree_of(bvh), rays, hits, nullptr});
  });
}

void occluded_rays(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh,
                   const DeviceRays& rays, uint8_t* results, Stream stream) {
  check_rays(rays);
  run(scratch, scratch_bytes, stream, bvh.nodes, [&](auto& exec) {
    exec.for_each_traversal(rays.count, TraceRay<true>{tree_of(bvh), rays, {}, results});
  });
}

void closest_points(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh,
                    const DevicePoints& points, const DeviceClosest& out, Stream stream) {
  check_stride(points.stride, sizeof(Vec3), "stride");
  run(scratch, scratch_bytes, stream, bvh.nodes, [&](auto& exec) {
    exec.for_each_traversal(points.count, FindClosest{tree_of(bvh), points, out});
  });
}

void count_overlaps(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh, const Aabb* boxes,
                    uint32_t count, uint32_t* offsets, Stream stream) {
  run(scratch, scratch_bytes, stream, bvh.nodes,
      [&](auto& exec) { count_touching(exec, tree_of(bvh), boxes, count, offsets); });
}

void list_overlaps(void* scratch, size_t& scratch_bytes, const DeviceBvh& bvh, const Aabb* boxes,
                   uint32_t count, uint32_t* offsets, uint32_t* primitives, uint32_t room,
                   Stream stream) {
  run(scratch, scratch_bytes, stream, bvh.nodes, [&](auto& exec) {
    list_touching(exec, tree_of(bvh), boxes, count, offsets, primitives, room);
  });
}

}  // namespace umbel::cuda
