// Clusters of meshes that change every frame.
#include "umbel/frame_clusters.hpp"

#include "bind.hpp"

namespace umbel::python {
namespace {

FrameClusterConfig config_of(const std::string& method, uint32_t max_triangles,
                             uint32_t min_triangles, uint32_t max_vertices, float underfill_cost,
                             uint32_t code_bits) {
  if (method != "morton" && method != "hybrid")
    throw Error(ErrorCode::kInvalidArgument,
                "method must be 'morton' or 'hybrid', not '" + method + "'");
  return {method == "morton" ? FrameMethod::kMorton : FrameMethod::kHybrid,
          max_triangles,
          min_triangles,
          max_vertices,
          underfill_cost,
          code_bits};
}

std::tuple<double, double> pair_of(const AreaGrowth& growth) {
  return {growth.area_ratio, growth.area_ratio_at_build};
}

using ListArrays = nb::typed<nb::tuple, Array<uint32_t>, Array<uint32_t>, Array<uint8_t>>;

/// A copy: the clusters' own arrays change with the next frame.
template <typename Scalar, typename T>
Array<Scalar> copied(std::span<const T> values) {
  return take<Scalar>(std::vector<T>(values.begin(), values.end()));
}

using Positions = Rows<float, 3>;

/// A method that takes the positions of a frame.
template <auto kMethod>
void over_positions(FrameClusterer& self, const Positions& positions, uint32_t threads) {
  run(nb::none(), threads,
      [&](const BuildOptions& options) { (self.*kMethod)(rows_of<Vec3>(positions), options); });
}

}  // namespace

/// Over 60 lines: a list of methods.
void bind_frame_clusters(nb::module_& module) {
  nb::class_<FrameClusterer>(module, "FrameClusterer")
      .def(
          "__init__",
          [](FrameClusterer* self, const Rows<uint32_t, 3>& triangles, size_t vertices,
             const std::string& method, uint32_t max_triangles, uint32_t min_triangles,
             uint32_t max_vertices, float underfill_cost, uint32_t code_bits) {
            new (self) FrameClusterer(rows_of<Triangle>(triangles), vertices,
                                      config_of(method, max_triangles, min_triangles, max_vertices,
                                                underfill_cost, code_bits));
          },
          "triangles"_a, "vertices"_a, "method"_a, "max_triangles"_a, "min_triangles"_a,
          "max_vertices"_a, "underfill_cost"_a, "code_bits"_a)
      .def("build", over_positions<&FrameClusterer::build>, "positions"_a, "threads"_a = 0)
      .def("update", over_positions<&FrameClusterer::update>, "positions"_a, "threads"_a = 0)
      .def(
          "refit",
          [](FrameClusterer& self, const Positions& positions, uint32_t threads) {
            return run(nb::none(), threads, [&](const BuildOptions& options) {
              return pair_of(self.refit(rows_of<Vec3>(positions), options));
            });
          },
          "positions"_a, "threads"_a = 0)
      .def(
          "rebuild_worst",
          [](FrameClusterer& self, const Positions& positions, uint32_t clusters,
             uint32_t threads) {
            return run(nb::none(), threads, [&](const BuildOptions& options) {
              return pair_of(self.rebuild_worst(rows_of<Vec3>(positions), clusters, options));
            });
          },
          "positions"_a, "clusters"_a, "threads"_a = 0)
      .def("area_growth", [](const FrameClusterer& self) { return pair_of(self.area_growth()); })
      .def("count", &FrameClusterer::count)
      .def("items", [](const FrameClusterer& self) { return copied<uint32_t>(self.items()); })
      .def("triangles",
           [](const FrameClusterer& self) { return copied<uint32_t>(self.triangles()); })
      .def("offsets", [](const FrameClusterer& self) { return copied<uint32_t>(self.offsets()); })
      .def("boxes", [](const FrameClusterer& self) { return copied<float>(self.boxes()); });
  module.def(
      "list_frame_vertices",
      [](const FrameClusterer& clusters, uint32_t threads) -> ListArrays {
        FrameVertexLists lists = run(nb::none(), threads, [&](const BuildOptions& options) {
          return list_frame_vertices(clusters, options);
        });
        return nb::make_tuple(take<uint32_t>(std::move(lists.vertex_offsets)),
                              take<uint32_t>(std::move(lists.vertices)),
                              take<uint8_t>(std::move(lists.corners)));
      },
      "clusters"_a, "threads"_a = 0, "(vertex_offsets, vertices, corners (m, 3))");
}

}  // namespace umbel::python
