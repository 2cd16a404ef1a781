// Clusters of triangles and of anything else that has boxes.
#include "umbel/cluster.hpp"

#include "bind.hpp"
#include "umbel/frame_clusters.hpp"

namespace umbel::python {
namespace {

using ClusterArrays = nb::typed<nb::tuple, Array<uint32_t>, Array<uint32_t>, Array<uint32_t>>;

ClusterArrays tuple_of(Clusters&& clusters) {
  return nb::make_tuple(take<uint32_t>(std::move(clusters.items)),
                        take<uint32_t>(std::move(clusters.ranges)),
                        take<uint32_t>(std::move(clusters.segments)));
}

/// Everything that may go into a ClusterInput, kept alive.
struct InputArrays {
  Rows<float, 6> boxes;
  std::optional<Rows<float, 3>> centroids;
  std::optional<Rows<uint32_t, 2>> connection_ranges;
  std::optional<Flat<uint32_t>> connection_targets;
  std::optional<Flat<float>> connection_weights;
  std::optional<Flat<uint8_t>> connection_vertex_bits;
  uint32_t vertices_per_item;
  std::optional<nb::ndarray<const uint32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>>
      item_vertices;
  float shared_vertex_weight;
  std::optional<Rows<uint32_t, 2>> segments;

  ClusterInput view() const {
    ClusterInput input;
    input.boxes = rows_of<Aabb>(boxes);
    input.centroids = rows_of<Vec3>(centroids);
    input.connections = {rows_of<Range>(connection_ranges), rows_of<uint32_t>(connection_targets),
                         rows_of<float>(connection_weights),
                         rows_of<uint8_t>(connection_vertex_bits)};
    input.vertices_per_item = vertices_per_item;
    if (item_vertices) {
      input.item_vertices = {item_vertices->data(), item_vertices->size()};
      input.vertices_per_item = static_cast<uint32_t>(item_vertices->shape(1));
    }
    input.shared_vertex_weight = shared_vertex_weight;
    input.segments = rows_of<Range>(segments);
    return input;
  }
};

/// The mesh, if it is valid. Progress is only told of the build after it, so that it never falls.
MeshView checked(const MeshArrays& mesh, const BuildOptions& options) {
  const MeshView view = mesh.view();
  validate(view, {nullptr, options.threads});
  return view;
}

/// Clusters as Python holds them; copied, since the library takes vectors.
Clusters clusters_of(const Flat<uint32_t>& items, const Rows<uint32_t, 2>& ranges) {
  const auto item_span = rows_of<uint32_t>(items);
  const auto range_span = rows_of<Range>(ranges);
  for (const Range& range : range_span) {
    if (range.offset > item_span.size() || range.count > item_span.size() - range.offset) {
      throw Error(ErrorCode::kInvalidArgument,
                  "ranges: a cluster reaches past the " + std::to_string(item_span.size()) +
                      " items (offset " + std::to_string(range.offset) + ", count " +
                      std::to_string(range.count) + ")");
    }
  }
  Clusters clusters;
  clusters.items.assign(item_span.begin(), item_span.end());
  clusters.ranges.assign(range_span.begin(), range_span.end());
  clusters.segments = {{0, static_cast<uint32_t>(range_span.size())}};
  return clusters;
}

void check_items(const Clusters& clusters, size_t count) {
  for (size_t i = 0; i < clusters.items.size(); ++i) {
    if (clusters.items[i] >= count) {
      throw Error(ErrorCode::kInvalidArgument,
                  "items[" + std::to_string(i) + "] is " + std::to_string(clusters.items[i]) +
                      ", but there are only " + std::to_string(count) + " items");
    }
  }
}

Dict metrics_dict(const ClusterMetrics& metrics) {
  Dict result;
  PUT_FIELDS(result, metrics, clusters, mean_fill, min_size, max_size, mean_vertices, max_vertices,
             surface_area_ratio, sah, overlap, ratio_cut);
  return result;
}

Dict mesh_metrics(const MeshArrays& mesh, const Flat<uint32_t>& items,
                  const Rows<uint32_t, 2>& ranges, uint32_t max_items, float shared_vertex_weight,
                  uint32_t threads) {
  const Clusters clusters = clusters_of(items, ranges);
  return metrics_dict(run(nb::none(), threads, [&](const BuildOptions& options) {
    const MeshView view = checked(mesh, options);
    check_items(clusters, view.triangles.size());
    const std::vector<Aabb> boxes = triangle_boxes(view, options);
    ClusterInput input;
    input.boxes = boxes;
    input.item_vertices = {reinterpret_cast<const uint32_t*>(view.triangles.data()),
                           view.triangles.size() * 3};
    input.vertices_per_item = 3;
    input.shared_vertex_weight = shared_vertex_weight;
    return cluster_metrics(input, clusters, max_items);
  }));
}

using MeshletArrays =
    nb::typed<nb::tuple, Array<uint32_t>, Array<uint32_t>, Array<uint32_t>, Array<uint8_t>>;

void bind_shapes_of_clusters(nb::module_& module) {
  module.def(
      "order_clusters",
      [](const MeshArrays& mesh, const Flat<uint32_t>& items, const Rows<uint32_t, 2>& ranges,
         int level, const nb::object& progress, uint32_t threads) -> MeshletArrays {
        const Clusters clusters = clusters_of(items, ranges);
        ClusterMeshlets made = run(progress, threads, [&](const BuildOptions& options) {
          return order_clusters(mesh.view(), clusters, level, options);
        });
        return nb::make_tuple(
            take<uint32_t>(std::move(made.items)), take<uint32_t>(std::move(made.vertex_offsets)),
            take<uint32_t>(std::move(made.vertices)), take<uint8_t>(std::move(made.corners)));
      },
      "mesh"_a, "items"_a, "ranges"_a, "level"_a = 0, "progress"_a = nb::none(), "threads"_a = 0,
      "(items, vertex_offsets, vertices, corners (n, 3))");
  module.def(
      "cluster_bounds",
      [](const MeshArrays& mesh, const Flat<uint32_t>& items, const Rows<uint32_t, 2>& ranges,
         const nb::object& progress, uint32_t threads) {
        const Clusters clusters = clusters_of(items, ranges);
        return take<float>(run(progress, threads, [&](const BuildOptions& options) {
          return cluster_bounds(mesh.view(), clusters, options);
        }));
      },
      "mesh"_a, "items"_a, "ranges"_a, "progress"_a = nb::none(), "threads"_a = 0,
      "(k, 11): centre, radius, cone apex, cone axis, cone cutoff");
}

void bind_config(nb::module_& module) {
  nb::class_<ClusterConfig>(module, "ClusterConfig", "Limits and prices of a clustering.")
      .def(nb::init<>())
      .def_rw("min_items", &ClusterConfig::min_items)
      .def_rw("max_items", &ClusterConfig::max_items)
      .def_rw("max_vertices", &ClusterConfig::max_vertices)
      .def_rw("underfill_cost", &ClusterConfig::underfill_cost)
      .def_rw("overlap_cost", &ClusterConfig::overlap_cost)
      .def_rw("vertex_underfill_cost", &ClusterConfig::vertex_underfill_cost)
      .def_rw("presplit_threshold", &ClusterConfig::presplit_threshold)
      .def_rw("coarse", &ClusterConfig::coarse);
  module.def(
      "cluster_preset",
      [](const std::string& name, uint32_t max_items) { return cluster_preset(name, max_items); },
      "name"_a, "max_items"_a = 128, "The config called quality, fast or exact.");
}

/// The clusters of a method without settings of its own.
template <auto kMethod>
auto clusters_along_a_curve(const MeshArrays& mesh, const ClusterConfig& config,
                            const nb::object& progress, uint32_t threads) {
  return tuple_of(run(progress, threads, [&](const BuildOptions& options) {
    return kMethod(checked(mesh, options), config, options);
  }));
}

}  // namespace

/// Over 60 lines: a list of methods.
void bind_cluster(nb::module_& module) {
  bind_config(module);
  bind_shapes_of_clusters(module);
  nb::class_<InputArrays>(module, "ClusterInput", "What build_clusters works on.")
      .def(
          "__init__",
          [](InputArrays* self, Rows<float, 6> boxes, std::optional<Rows<float, 3>> centroids,
             std::optional<Rows<uint32_t, 2>> connection_ranges,
             std::optional<Flat<uint32_t>> connection_targets,
             std::optional<Flat<float>> connection_weights,
             std::optional<Flat<uint8_t>> connection_vertex_bits, uint32_t vertices_per_item,
             std::optional<nb::ndarray<const uint32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>>
                 item_vertices,
             float shared_vertex_weight, std::optional<Rows<uint32_t, 2>> segments) {
            new (self) InputArrays{std::move(boxes),
                                   std::move(centroids),
                                   std::move(connection_ranges),
                                   std::move(connection_targets),
                                   std::move(connection_weights),
                                   std::move(connection_vertex_bits),
                                   vertices_per_item,
                                   std::move(item_vertices),
                                   shared_vertex_weight,
                                   std::move(segments)};
          },
          "boxes"_a, "centroids"_a = nb::none(), "connection_ranges"_a = nb::none(),
          "connection_targets"_a = nb::none(), "connection_weights"_a = nb::none(),
          "connection_vertex_bits"_a = nb::none(), "vertices_per_item"_a = 0,
          "item_vertices"_a = nb::none(), "shared_vertex_weight"_a = 0.0f,
          "segments"_a = nb::none());
  module.def(
      "build_clusters",
      [](const InputArrays& input, const ClusterConfig& config, const nb::object& progress,
         uint32_t threads) {
        return tuple_of(run(progress, threads, [&](const BuildOptions& options) {
          return build_clusters(input.view(), config, options);
        }));
      },
      "input"_a, "config"_a, "progress"_a = nb::none(), "threads"_a = 0,
      "(items, ranges (k, 2), segments (s, 2))");
  module.def(
      "cluster_mesh",
      [](const MeshArrays& mesh, const ClusterConfig& config, float shared_vertex_weight,
         const nb::object& progress, uint32_t threads) {
        return tuple_of(run(progress, threads, [&](const BuildOptions& options) {
          const MeshView view = checked(mesh, options);
          return cluster_mesh(view, config, shared_vertex_weight, options);
        }));
      },
      "mesh"_a, "config"_a, "shared_vertex_weight"_a = 0.0f, "progress"_a = nb::none(),
      "threads"_a = 0, "(items, ranges (k, 2), segments (s, 2))");
  module.def("cluster_mesh_morton", clusters_along_a_curve<cluster_mesh_morton>, "mesh"_a,
             "config"_a, "progress"_a = nb::none(), "threads"_a = 0,
             "(items, ranges (k, 2), segments (s, 2))");
  module.def("cluster_mesh_hybrid", clusters_along_a_curve<cluster_mesh_hybrid>, "mesh"_a,
             "config"_a, "progress"_a = nb::none(), "threads"_a = 0,
             "(items, ranges (k, 2), segments (s, 2))");
  module.def(
      "cluster_metrics",
      [](const InputArrays& input, const Flat<uint32_t>& items, const Rows<uint32_t, 2>& ranges,
         uint32_t max_items) {
        const Clusters clusters = clusters_of(items, ranges);
        check_items(clusters, input.boxes.shape(0));
        nb::gil_scoped_release release;
        const ClusterMetrics metrics = cluster_metrics(input.view(), clusters, max_items);
        nb::gil_scoped_acquire acquire;
        return metrics_dict(metrics);
      },
      "input"_a, "items"_a, "ranges"_a, "max_items"_a);
  module.def("mesh_cluster_metrics", &mesh_metrics, "mesh"_a, "items"_a, "ranges"_a, "max_items"_a,
             "shared_vertex_weight"_a = 0.0f, "threads"_a = 0);
}

}  // namespace umbel::python
