// What umbel.h does to finished clusters of triangles: their order and their bounds.
#include <cstddef>
#include <cstring>
#include <string>

#include "capi/cluster_input.hpp"
#include "capi/guard.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {
namespace {

static_assert(sizeof(umbel_cull_bounds) == sizeof(ClusterBounds));
static_assert(offsetof(umbel_cull_bounds, radius) ==
              offsetof(ClusterBounds, sphere) + offsetof(Sphere, radius));
static_assert(offsetof(umbel_cull_bounds, cone_apex) == offsetof(ClusterBounds, cone_apex));
static_assert(offsetof(umbel_cull_bounds, cone_axis) == offsetof(ClusterBounds, cone_axis));
static_assert(offsetof(umbel_cull_bounds, cone_cutoff) == offsetof(ClusterBounds, cone_cutoff));

const MeshView& mesh_of(const ClusterArrays& arrays) {
  if (!arrays.has_positions() && arrays.item_count() > 0)
    throw Error(ErrorCode::kInvalidArgument,
                "input->positions is NULL: only clusters of triangles have an order and bounds");
  return arrays.mesh();
}

struct Array {
  const char* name;
  void* to;
  size_t capacity;
  const void* from;
  size_t count, element;
};

void write_all(std::initializer_list<Array> arrays) {
  for (const Array& a : arrays)
    if (a.capacity < a.count)
      throw CapacityError{"meshlets->" + std::string(a.name) + "_capacity is " +
                          std::to_string(a.capacity) + ", but " + std::to_string(a.count) +
                          " are needed"};
  for (const Array& a : arrays)
    if (a.count) std::memcpy(a.to, a.from, a.count * a.element);
}

void check_array(const void* array, size_t capacity, const char* name) {
  if (!array && capacity > 0)
    throw Error(ErrorCode::kInvalidArgument, "meshlets->" + std::string(name) +
                                                 " is NULL, but its capacity is " +
                                                 std::to_string(capacity));
}

void order(const umbel_cluster_input* input, const umbel_cluster_output* clusters, int level,
           const umbel_build_options* options, umbel_cluster_meshlets* out) {
  read_struct(out, "meshlets");
  out->item_count = out->vertex_offset_count = out->vertex_count = out->corner_count = 0;
  check_array(out->items, out->item_capacity, "items");
  check_array(out->vertex_offsets, out->vertex_offset_capacity, "vertex_offsets");
  check_array(out->vertices, out->vertex_capacity, "vertices");
  check_array(out->corners, out->corner_capacity, "corners");
  const ClusterArrays arrays(input);
  const ClusterMeshlets made =
      order_clusters(mesh_of(arrays), given_clusters(clusters), level, build_options(options));
  out->item_count = made.items.size();
  out->vertex_offset_count = made.vertex_offsets.size();
  out->vertex_count = made.vertices.size();
  out->corner_count = made.corners.size() * 3;
  write_all(
      {{"item", out->items, out->item_capacity, made.items.data(), out->item_count, 4},
       {"vertex_offset", out->vertex_offsets, out->vertex_offset_capacity,
        made.vertex_offsets.data(), out->vertex_offset_count, 4},
       {"vertex", out->vertices, out->vertex_capacity, made.vertices.data(), out->vertex_count, 4},
       {"corner", out->corners, out->corner_capacity, made.corners.data(), out->corner_count, 1}});
}

void bound(const umbel_cluster_input* input, const umbel_cluster_output* clusters,
           const umbel_build_options* options, umbel_cull_bounds* bounds, size_t capacity) {
  if (!bounds && capacity > 0)
    throw Error(ErrorCode::kInvalidArgument,
                "bounds is NULL, but its capacity is " + std::to_string(capacity));
  const ClusterArrays arrays(input);
  const Clusters given = given_clusters(clusters);
  if (capacity < given.ranges.size())
    throw CapacityError{"capacity is " + std::to_string(capacity) + ", but " +
                        std::to_string(given.ranges.size()) + " are needed"};
  const std::vector<ClusterBounds> made =
      cluster_bounds(mesh_of(arrays), given, build_options(options));
  if (!made.empty()) std::memcpy(bounds, made.data(), made.size() * sizeof made[0]);
}

}  // namespace
}  // namespace umbel::capi

umbel_result umbel_cluster_order(const umbel_cluster_input* input,
                                 const umbel_cluster_output* clusters, int level,
                                 const umbel_build_options* options,
                                 umbel_cluster_meshlets* meshlets) {
  return umbel::capi::guard([&] { umbel::capi::order(input, clusters, level, options, meshlets); });
}

umbel_result umbel_cluster_cull_bounds(const umbel_cluster_input* input,
                                       const umbel_cluster_output* clusters,
                                       const umbel_build_options* options,
                                       umbel_cull_bounds* bounds, size_t capacity) {
  return umbel::capi::guard(
      [&] { umbel::capi::bound(input, clusters, options, bounds, capacity); });
}
