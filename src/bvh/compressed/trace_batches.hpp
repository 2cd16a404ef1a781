// Batches of queries of a compact tree, for any executor.
#pragma once

#include <cstdint>

#include "base/exec.hpp"
#include "bvh/compressed/compact_ray.hpp"
#include "bvh/compressed/compact_shapes.hpp"
#include "umbel/cuda_trace.hpp"

namespace umbel::cuda {

/// The i-th element of an array of floats with a stride in bytes.
UMBEL_HOST_DEVICE inline const float* at(const void* array, size_t stride, size_t i) {
  return reinterpret_cast<const float*>(static_cast<const char*>(array) + stride * i);
}
UMBEL_HOST_DEVICE inline Vec3 vector_at(const void* array, size_t stride, size_t i) {
  const float* v = at(array, stride, i);
  return {v[0], v[1], v[2]};
}
UMBEL_HOST_DEVICE inline Ray ray_at(const DeviceRays& rays, size_t i) {
  return {vector_at(rays.origins, rays.origin_stride, i),
          rays.t_min ? *at(rays.t_min, rays.interval_stride, i) : 0.0f,
          vector_at(rays.directions, rays.direction_stride, i),
          rays.t_max ? *at(rays.t_max, rays.interval_stride, i)
                     : std::numeric_limits<float>::infinity()};
}

/// Barycentric coordinates of what was found, if they are wanted.
template <typename Found>
UMBEL_HOST_DEVICE void write_uv(float* uvs, size_t i, const Found& found) {
  if (!uvs) return;
  uvs[2 * i] = found.u;
  uvs[2 * i + 1] = found.v;
}

/// A query on its way through the tree.
template <typename Visitor>
struct TraversalState {
  Visitor visitor;
  bvh::CompactTraversal traversal;
};

template <bool any>
struct TraceRay {
  using State = TraversalState<bvh::RayVisitor<any>>;

  bvh::CompactTree tree;
  DeviceRays rays;
  DeviceHits hits;
  uint8_t* results;

  UMBEL_HOST_DEVICE bool begin(size_t i, State& s) const {
    if (!s.visitor.begin(tree, ray_at(rays, i), rays.cull_back_faces, {rays.masks, rays.mask}))
      return false;
    s.traversal.begin(tree, s.visitor);
    return true;
  }
  UMBEL_HOST_DEVICE bool step(State& s) const { return s.traversal.step(tree, s.visitor); }
  UMBEL_HOST_DEVICE void end(size_t i, const State& s) const {
    const Hit hit = s.visitor.result();
    if constexpr (any) {
      results[i] = hit.primitive != kNone ? 1 : 0;
      return;
    }
    if (hits.t) hits.t[i] = hit.t;
    if (hits.primitives) hits.primitives[i] = hit.primitive;
    write_uv(hits.uvs, i, hit);
  }
};

struct FindClosest {
  using State = TraversalState<bvh::ClosestVisitor>;

  bvh::CompactTree tree;
  DevicePoints points;
  DeviceClosest out;

  UMBEL_HOST_DEVICE bool begin(size_t i, State& s) const {
    if (!s.visitor.begin(tree, vector_at(points.points, points.stride, i), points.max_distance))
      return false;
    s.traversal.begin(tree, s.visitor);
    return true;
  }
  UMBEL_HOST_DEVICE bool step(State& s) const { return s.traversal.step(tree, s.visitor); }
  UMBEL_HOST_DEVICE void end(size_t i, const State& s) const {
    const ClosestPoint found = s.visitor.result();
    if (out.points) {
      out.points[3 * i] = found.point.x;
      out.points[3 * i + 1] = found.point.y;
      out.points[3 * i + 2] = found.point.z;
    }
    if (out.distances) out.distances[i] = found.distance;
    if (out.primitives) out.primitives[i] = found.primitive;
    write_uv(out.uvs, i, found);
  }
};

/// Counts what touches a box, where there are `sizes`, or writes it as keys: the box above, the
/// primitive below.
struct FindOverlaps {
  struct Found {
    uint64_t* keys;
    uint64_t box;
    uint32_t* size;
    uint32_t room;

    UMBEL_HOST_DEVICE void operator()(uint32_t primitive) const {
      if (*size < room) keys[*size] = box << 32 | primitive;
      ++*size;
    }
  };
  struct State {
    bvh::BoxVisitor<Found> visitor{Found{}};
    bvh::CompactTraversal traversal;
    uint32_t size = 0;
  };

  bvh::CompactTree tree;
  const Aabb* boxes;
  const uint32_t* offsets;
  uint32_t* sizes;
  uint64_t* keys;
  uint32_t room;

  UMBEL_HOST_DEVICE bool begin(size_t i, State& s) const {
    s.size = sizes ? 0 : offsets[i];
    s.visitor = bvh::BoxVisitor<Found>(Found{keys, i, &s.size, room});
    if (!s.visitor.begin(tree, boxes[i])) return false;
    s.traversal.begin(tree, s.visitor);
    return true;
  }
  UMBEL_HOST_DEVICE bool step(State& s) const { return s.traversal.step(tree, s.visitor); }
  UMBEL_HOST_DEVICE void end(size_t i, const State& s) const {
    if (sizes) sizes[i] = s.size;
  }
};

template <typename Exec>
void count_touching(Exec& exec, const bvh::CompactTree& tree, const Aabb* boxes, uint32_t count,
                    uint32_t* offsets) {
  exec.for_each_traversal(count, FindOverlaps{tree, boxes, nullptr, offsets, nullptr, 0});
  exec.template exclusive_scan<uint32_t>(
      count, [offsets] UMBEL_DEVICE_LAMBDA(size_t i) { return offsets[i]; }, offsets);
}

template <typename Exec>
void list_touching(Exec& exec, const bvh::CompactTree& tree, const Aabb* boxes, uint32_t count,
                   uint32_t* offsets, uint32_t* primitives, uint32_t room) {
  constexpr uint64_t kNoKey = ~uint64_t(0);
  const auto key_buffer = exec.template allocate<uint64_t>(room);
  const auto values = exec.template allocate<uint32_t>(room);
  const auto target_buffer = exec.template allocate<uint32_t>(size_t(room) + 1);
  uint64_t* keys = key_buffer.data();
  uint32_t* targets = target_buffer.data();
  exec.for_each(room, [keys, values = values.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
    keys[i] = kNoKey;
    values[i] = 0;
  });
  exec.for_each_traversal(count, FindOverlaps{tree, boxes, offsets, nullptr, keys, room});
  exec.radix_sort_pairs(room, keys, values.data(), 0, 64);
  exec.template exclusive_scan<uint32_t>(
      room,
      [keys] UMBEL_DEVICE_LAMBDA(size_t i) {
        return keys[i] != kNoKey && (i == 0 || keys[i] != keys[i - 1]) ? 1u : 0u;
      },
      targets);
  exec.for_each(room, [keys, targets, primitives] UMBEL_DEVICE_LAMBDA(size_t i) {
    if (targets[i + 1] != targets[i]) primitives[targets[i]] = uint32_t(keys[i]);
  });
  exec.for_each(size_t(count) + 1, [keys, targets, offsets, room] UMBEL_DEVICE_LAMBDA(size_t box) {
    uint32_t first = 0, last = room;
    while (first < last) {
      const uint32_t middle = first + (last - first) / 2;
      if (keys[middle] >> 32 < box)
        first = middle + 1;
      else
        last = middle;
    }
    offsets[box] = targets[first];
  });
}

}  // namespace umbel::cuda
