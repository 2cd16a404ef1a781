// The queries about distances and overlaps, one table of functions for each kind of nodes.
#pragma once

#include <span>
#include <vector>

#include "query/closest_point.hpp"
#include "query/contains.hpp"
#include "query/overlap.hpp"

namespace umbel {

/// Each takes the structure that it was made for. Batches run in parallel.
struct ShapeKernels {
  ClosestPoint (*closest_point)(const LeafStore& store, const Vec3& point, float max_distance);
  void (*closest_points)(const LeafStore& store, std::span<const Vec3> points,
                         std::span<ClosestPoint> results, float max_distance);
  bool (*contains)(const LeafStore& store, const Vec3& point);
  void (*contains_all)(const LeafStore& store, std::span<const Vec3> points,
                       std::span<uint8_t> results);
  std::vector<uint32_t> (*in_box)(const LeafStore& store, const Aabb& box);
  std::vector<uint32_t> (*in_sphere)(const LeafStore& store, const Sphere& sphere);
  std::vector<uint32_t> (*in_frustum)(const LeafStore& store, const Frustum& frustum);
};

template <typename Nodes>
constexpr ShapeKernels shape_kernels_of{closest_point_of<Nodes>,   closest_points_of<Nodes>,
                                        contains_of<Nodes>,        contains_all_of<Nodes>,
                                        overlaps_of_box<Nodes>,    overlaps_of_sphere<Nodes>,
                                        overlaps_of_frustum<Nodes>};

}  // namespace umbel
