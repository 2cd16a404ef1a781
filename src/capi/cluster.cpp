// Clusters from C (umbel_cluster.h).
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <string>
#include <string_view>

#include "base/fields.hpp"
#include "capi/cluster_input.hpp"
#include "capi/guard.hpp"
#include "capi/structs.hpp"
#include "cluster/validate.hpp"

namespace umbel::capi {
namespace {

umbel_cluster_config config_as_c(const ClusterConfig& config) {
  umbel_cluster_config result{};
  result.struct_size = sizeof result;
  COPY_FIELDS(result, config, CLUSTER_CONFIG_FIELDS);
  return result;
}

size_t most_clusters(size_t items, const ClusterConfig& config) {
  return config.max_vertices ? items : (items + config.min_items - 1) / config.min_items;
}

umbel_cluster_capacity requirements(const ItemCounts& counts, const ClusterConfig& config) {
  cluster::validate_config(config);
  umbel_cluster_capacity needed{};
  needed.items = counts.items;
  if (!counts.has_segments) {
    needed.segments = needed.items ? 1 : 0;
    needed.ranges = most_clusters(needed.items, config);
    return needed;
  }
  needed.segments = counts.segments.size();
  size_t held = 0;
  for (size_t s = 0; s < needed.segments; ++s) {
    const Range& r = counts.segments[s];
    if (uint64_t(r.offset) + r.count > needed.items)
      throw Error(ErrorCode::kInvalidArgument, "segments[" + std::to_string(s) + "] ends at " +
                                                   std::to_string(uint64_t(r.offset) + r.count) +
                                                   ", but there are " +
                                                   std::to_string(needed.items) + " items");
    needed.ranges += most_clusters(r.count, config);
    held += r.count;
  }
  if (held > needed.items)
    throw Error(ErrorCode::kInvalidArgument, "segments overlap: they hold " + std::to_string(held) +
                                                 " items, but there are " +
                                                 std::to_string(needed.items));
  return needed;
}

[[noreturn]] void too_small(const char* name, size_t capacity, size_t needed) {
  throw CapacityError{"output->" + std::string(name) + "_capacity is " + std::to_string(capacity) +
                      ", but " + std::to_string(needed) + " are needed"};
}

void check_array(const void* array, size_t capacity, const char* name) {
  if (!array && capacity > 0)
    throw Error(ErrorCode::kInvalidArgument, "output->" + std::string(name) +
                                                 "s is NULL, but its capacity is " +
                                                 std::to_string(capacity));
}

void set_counts(umbel_cluster_output* output, const umbel_cluster_capacity& counts) {
  output->range_count = counts.ranges;
  output->item_count = counts.items;
  output->segment_count = counts.segments;
}

// Throws if an array is too small, with the counts set to what is needed.
void check_capacity(umbel_cluster_output* output, const umbel_cluster_capacity& needed) {
  if (output->item_capacity < needed.items) {
    set_counts(output, needed);
    too_small("item", output->item_capacity, needed.items);
  }
  if (output->segments && output->segment_capacity < needed.segments) {
    set_counts(output, needed);
    too_small("segment", output->segment_capacity, needed.segments);
  }
}

template <typename To, typename From>
void copy(const std::vector<From>& from, To* to) {
  static_assert(sizeof(To) == sizeof(From));
  if (!from.empty()) std::memcpy(to, from.data(), from.size() * sizeof(From));
}

void build(const umbel_cluster_input* input, const umbel_cluster_config* config_given,
           const umbel_build_options* options_given, umbel_cluster_output* output) {
  read_struct(output, "output");
  set_counts(output, {});
  check_array(output->ranges, output->range_capacity, "range");
  check_array(output->items, output->item_capacity, "item");
  check_array(output->segments, output->segment_capacity, "segment");
  const BuildOptions options = build_options(options_given);
  const ClusterConfig config = cluster_config(config_given);
  ClusterArrays arrays(input);
  check_capacity(output, requirements(arrays.counts(), config));

  Clusters clusters =
      arrays.is_mesh_alone()
          ? cluster_mesh(arrays.mesh(), config, arrays.shared_vertex_weight(), options)
          : build_clusters(arrays.items(options), config, options);

  if (arrays.counts().has_segments && arrays.counts().segments.empty()) clusters.segments.clear();
  umbel_cluster_capacity made{};
  made.ranges = clusters.ranges.size();
  made.items = clusters.items.size();
  made.segments = clusters.segments.size();
  set_counts(output, made);
  if (output->range_capacity < made.ranges) too_small("range", output->range_capacity, made.ranges);
  copy(clusters.ranges, output->ranges);
  copy(clusters.items, output->items);
  if (output->segments) copy(clusters.segments, output->segments);
}

ClusterMetrics measure(const umbel_cluster_input* input, const umbel_cluster_output* clusters,
                       uint32_t max_items) {
  ClusterArrays arrays(input);
  const Clusters copied = given_clusters(clusters);
  return cluster_metrics(arrays.items({}), copied, max_items);
}

umbel_cluster_metrics metrics_as_c(const ClusterMetrics& metrics) {
  umbel_cluster_metrics result{};
  COPY_FIELDS(result, metrics, min_size, max_size, max_vertices, clusters, mean_fill, mean_vertices,
              surface_area_ratio, sah, overlap, ratio_cut);
  return result;
}

static_assert(sizeof(umbel_cluster_bounds) == sizeof(ClusterBounds));
static_assert(offsetof(umbel_cluster_bounds, radius) ==
              offsetof(ClusterBounds, sphere) + offsetof(Sphere, radius));
static_assert(offsetof(umbel_cluster_bounds, cone_apex) == offsetof(ClusterBounds, cone_apex));
static_assert(offsetof(umbel_cluster_bounds, cone_axis) == offsetof(ClusterBounds, cone_axis));
static_assert(offsetof(umbel_cluster_bounds, cone_cutoff) == offsetof(ClusterBounds, cone_cutoff));

const MeshView& mesh_of(const ClusterArrays& arrays) {
  if (!arrays.has_positions() && arrays.item_count() > 0)
    throw Error(ErrorCode::kInvalidArgument,
                "input->positions is NULL: only clusters of triangles have an order and bounds");
  return arrays.mesh();
}

// C++ has a struct for connections, C has none.
std::string in_words_of_c(std::string sentence) {
  constexpr std::string_view kCpp = "connections.", kC = "connection_";
  for (size_t at = 0; (at = sentence.find(kCpp, at)) != std::string::npos; at += kC.size())
    sentence.replace(at, kCpp.size(), kC);
  return sentence;
}

template <typename Work>
umbel_result guard_clusters(const Work& work) noexcept {
  return guard([&] {
    try {
      work();
    } catch (const Error& error) {
      throw Error(error.code(), in_words_of_c(error.what()));
    }
  });
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

void check_meshlet_array(const void* array, size_t capacity, const char* name) {
  if (!array && capacity > 0)
    throw Error(ErrorCode::kInvalidArgument, "meshlets->" + std::string(name) +
                                                 " is NULL, but its capacity is " +
                                                 std::to_string(capacity));
}

void order(const umbel_cluster_input* input, const umbel_cluster_output* clusters, int level,
           const umbel_build_options* options, umbel_cluster_meshlets* out) {
  read_struct(out, "meshlets");
  out->item_count = out->vertex_offset_count = out->vertex_count = out->corner_count = 0;
  check_meshlet_array(out->items, out->item_capacity, "items");
  check_meshlet_array(out->vertex_offsets, out->vertex_offset_capacity, "vertex_offsets");
  check_meshlet_array(out->vertices, out->vertex_capacity, "vertices");
  check_meshlet_array(out->corners, out->corner_capacity, "corners");
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
           const umbel_build_options* options, umbel_cluster_bounds* bounds, size_t capacity) {
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

using namespace umbel;

void umbel_cluster_config_init_sized(umbel_cluster_config* config, size_t size) {
  capi::init_sized(config, size, capi::config_as_c(umbel::ClusterConfig{}));
}

umbel_result umbel_cluster_config_preset(umbel_cluster_config* config, const char* name,
                                         uint32_t max_items) {
  return capi::guard_clusters([&] {
    if (!name) throw Error(ErrorCode::kInvalidArgument, "name is NULL");
    capi::write_struct(capi::config_as_c(cluster_preset(name, max_items)), config, "config");
  });
}

umbel_result umbel_cluster_requirements(const umbel_cluster_input* input,
                                        const umbel_cluster_config* config,
                                        umbel_cluster_capacity* capacity) {
  return capi::guard_clusters([&] {
    const capi::ItemCounts counts(capi::read_struct(input, "input"));
    capi::write_struct(capi::requirements(counts, capi::cluster_config(config)), capacity,
                       "capacity");
  });
}

umbel_result umbel_cluster_build(const umbel_cluster_input* input,
                                 const umbel_cluster_config* config,
                                 const umbel_build_options* options, umbel_cluster_output* output) {
  return capi::guard_clusters([&] { capi::build(input, config, options, output); });
}

umbel_result umbel_cluster_get_metrics(const umbel_cluster_input* input,
                                       const umbel_cluster_output* clusters, uint32_t max_items,
                                       umbel_cluster_metrics* metrics) {
  return capi::guard_clusters([&] {
    capi::write_struct(capi::metrics_as_c(capi::measure(input, clusters, max_items)), metrics,
                       "metrics");
  });
}

umbel_result umbel_cluster_order(const umbel_cluster_input* input,
                                 const umbel_cluster_output* clusters, int level,
                                 const umbel_build_options* options,
                                 umbel_cluster_meshlets* meshlets) {
  return capi::guard_clusters([&] { capi::order(input, clusters, level, options, meshlets); });
}

umbel_result umbel_cluster_get_bounds(const umbel_cluster_input* input,
                                      const umbel_cluster_output* clusters,
                                      const umbel_build_options* options,
                                      umbel_cluster_bounds* bounds, size_t capacity) {
  return capi::guard_clusters([&] { capi::bound(input, clusters, options, bounds, capacity); });
}
