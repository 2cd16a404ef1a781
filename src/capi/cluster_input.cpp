#include "capi/cluster_input.hpp"

#include <cstddef>
#include <string>

#include "base/fields.hpp"
#include "base/refuse.hpp"
#include "capi/arguments.hpp"
#include "capi/structs.hpp"

namespace umbel::capi {
namespace {

// The structs of umbel_cluster.h stand for the C++ ones in arrays.
static_assert(sizeof(umbel_vec3) == sizeof(Vec3) && alignof(umbel_vec3) == alignof(Vec3));
static_assert(sizeof(umbel_aabb) == sizeof(Aabb) && alignof(umbel_aabb) == alignof(Aabb));
static_assert(offsetof(umbel_aabb, max) == offsetof(Aabb, max));
static_assert(sizeof(umbel_range) == sizeof(Range) && alignof(umbel_range) == alignof(Range));
static_assert(offsetof(umbel_range, count) == offsetof(Range, count));
static_assert(sizeof(Triangle) == 3 * sizeof(uint32_t) && alignof(Triangle) == alignof(uint32_t));

template <typename To, typename From>
std::span<const To> view(const From* array, size_t count, const char* name) {
  if (!array && count > 0)
    refuse(std::string(name) + " is NULL, but has " + std::to_string(count) + " elements");
  return {reinterpret_cast<const To*>(array), array ? count : 0};
}

}  // namespace

BuildOptions build_options(const umbel_build_options* options) {
  BuildOptions result;
  if (!options) return result;
  const umbel_build_options given = read_struct(options, "options");
  result.threads = given.threads;
  if (given.progress)
    result.progress = [given](float fraction, std::string_view stage) {
      return given.progress(fraction, std::string(stage).c_str(), given.progress_user) != 0;
    };
  return result;
}

ClusterConfig cluster_config(const umbel_cluster_config* config) {
  ClusterConfig result;
  if (!config) return result;
  const umbel_cluster_config given = read_struct(config, "config");
  COPY_FIELDS(result, given, CLUSTER_CONFIG_FIELDS);
  result.max_vertices = limit(given.max_vertices);
  return result;
}

Clusters given_clusters(const umbel_cluster_output* clusters) {
  const umbel_cluster_output given = read_struct(clusters, "clusters");
  check_nameable(given.range_count, "clusters->range_count");
  check_nameable(given.item_count, "clusters->item_count");
  if ((!given.ranges && given.range_count > 0) || (!given.items && given.item_count > 0))
    refuse("clusters->ranges or clusters->items is NULL");
  Clusters copied;
  const auto* ranges = reinterpret_cast<const Range*>(given.ranges);
  copied.ranges.assign(ranges, ranges + given.range_count);
  copied.items.assign(given.items, given.items + given.item_count);
  return copied;
}

ItemCounts::ItemCounts(const umbel_cluster_input& in) : items(in.item_count) {
  check_nameable(in.item_count, "input->item_count");
  check_nameable(in.segment_count, "input->segment_count");
  has_segments = in.segments != nullptr;
  segments = view<Range>(in.segments, in.segment_count, "input->segments");
}

ClusterArrays::ClusterArrays(const umbel_cluster_input* input)
    : ClusterArrays(read_struct(input, "input")) {}

ClusterArrays::ClusterArrays(const umbel_cluster_input& in) : counts_(in) {
  item_count_ = counts_.items;
  has_positions_ = in.positions != nullptr;
  check_nameable(in.position_count, "input->position_count");
  check_nameable(in.connection_count, "input->connection_count");
  if (in.item_vertices) {
    if (in.vertices_per_item == 0) refuse("input->vertices_per_item must be at least 1, not 0");
    input_.item_vertices = {in.item_vertices, in.item_count * in.vertices_per_item};
    input_.vertices_per_item = in.vertices_per_item;
  }
  if (has_positions_) {
    read_positions(in);
  } else {
    input_.boxes = view<Aabb>(in.boxes, item_count_, "input->boxes");
  }
  if (in.centroids) input_.centroids = view<Vec3>(in.centroids, item_count_, "input->centroids");
  if (in.connection_ranges) {
    input_.connections.ranges = view<Range>(in.connection_ranges, item_count_, "");
    input_.connections.targets =
        view<uint32_t>(in.connection_targets, in.connection_count, "input->connection_targets");
    if (in.connection_weights)
      input_.connections.weights = {in.connection_weights, in.connection_count};
    if (in.connection_vertex_bits) {
      input_.connections.vertex_bits = {in.connection_vertex_bits, in.connection_count};
      input_.vertices_per_item = in.vertices_per_item;
    }
  } else if (in.connection_targets || in.connection_weights || in.connection_vertex_bits ||
             in.connection_count > 0) {
    refuse("input->connection_ranges is NULL, but there are connections");
  }
  input_.segments = counts_.segments;
  // For the library none at all would be one of everything.
  static constexpr Range kNothing{0, 0};
  if (counts_.has_segments && counts_.segments.empty()) input_.segments = {&kNothing, 1};
  input_.shared_vertex_weight = in.shared_vertex_weight;
}

void ClusterArrays::read_positions(const umbel_cluster_input& in) {
  if (in.boxes) refuse("input has both boxes and positions: give one of them");
  if (item_count_ > 0 && !in.item_vertices)
    refuse("input->positions are given, but input->item_vertices is NULL");
  if (in.item_vertices && in.vertices_per_item != 3)
    refuse("input->vertices_per_item must be 3 where positions are given, not " +
           std::to_string(in.vertices_per_item));
  mesh_.positions =
      strided(in.positions, in.position_count, in.position_stride, "input->positions", positions_);
  mesh_.triangles = view<Triangle>(in.item_vertices, item_count_, "input->item_vertices");
}

bool ClusterArrays::is_mesh_alone() const {
  return has_positions_ && input_.centroids.empty() && input_.segments.empty() &&
         input_.connections.ranges.empty();
}

const ClusterInput& ClusterArrays::items(const BuildOptions& options) {
  if (has_positions_ && boxes_.size() != item_count_) {
    BuildOptions quiet;  // progress must not start again with what comes after
    quiet.threads = options.threads;
    validate(mesh_, quiet);
    boxes_ = triangle_boxes(mesh_, quiet);
    input_.boxes = boxes_;
  }
  return input_;
}

}  // namespace umbel::capi
