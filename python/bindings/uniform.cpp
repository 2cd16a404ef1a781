// Uniform structures that answer rays, distances and overlaps.
#include "umbel/uniform.hpp"

#include "bind.hpp"

namespace umbel::python {
namespace {

using Cost = std::tuple<float, float>;
using Masks = std::optional<Flat<uint32_t>>;

/// Builds a structure with a config that has what is its own; sets what all of them have.
template <typename Structure, typename Config>
Structure build(Config config, const MeshArrays& mesh, bool compact, const Cost& cost,
                bool drop_invalid, const Masks& masks, const nb::object& progress,
                uint32_t threads) {
  config.compact = compact;
  config.cost = {std::get<0>(cost), std::get<1>(cost)};
  if (drop_invalid) config.invalid = bvh::InvalidTriangles::kDrop;
  return run(progress, threads, [&](const BuildOptions& options) {
    return Structure::build(mesh.view(), config, rows_of<uint32_t>(masks), options);
  });
}

uniform::TwoLevelGrid build_grid(const MeshArrays& mesh, float density, float leaf_density,
                                 float max_references, bool compact, const Cost& cost,
                                 bool drop_invalid, const Masks& masks, const nb::object& progress,
                                 uint32_t threads) {
  const uniform::GridConfig config{
      .density = density, .leaf_density = leaf_density, .max_references = max_references};
  return build<uniform::TwoLevelGrid>(config, mesh, compact, cost, drop_invalid, masks, progress,
                                      threads);
}

uniform::Octree build_octree(const MeshArrays& mesh, uint32_t max_leaf_size, uint32_t max_depth,
                             float max_references, bool compact, const Cost& cost,
                             bool drop_invalid, const Masks& masks, const nb::object& progress,
                             uint32_t threads) {
  const uniform::OctreeConfig config{
      .max_leaf_size = max_leaf_size, .max_depth = max_depth, .max_references = max_references};
  return build<uniform::Octree>(config, mesh, compact, cost, drop_invalid, masks, progress,
                                threads);
}

uniform::IntervalHierarchy build_intervals(const MeshArrays& mesh, uint32_t max_leaf_size,
                                           bool compact, const Cost& cost, bool drop_invalid,
                                           const Masks& masks, const nb::object& progress,
                                           uint32_t threads) {
  return build<uniform::IntervalHierarchy>(uniform::IntervalConfig{.max_leaf_size = max_leaf_size},
                                           mesh, compact, cost, drop_invalid, masks, progress,
                                           threads);
}

}  // namespace

void bind_uniform(nb::module_& module) {
  nb::class_<uniform::TwoLevelGrid, TriangleQueries>(module, "TwoLevelGrid", "A two-level grid.")
      .def_static("build", &build_grid, "mesh"_a, "density"_a, "leaf_density"_a, "max_references"_a,
                  "compact"_a, "cost"_a, "drop_invalid"_a, "masks"_a = nb::none(),
                  "progress"_a = nb::none(), "threads"_a = 0)
      .def("statistics",
           [](const uniform::TwoLevelGrid& grid) { return statistics_dict(grid.statistics()); });
  nb::class_<uniform::Octree, TriangleQueries>(module, "Octree", "An octree.")
      .def_static("build", &build_octree, "mesh"_a, "max_leaf_size"_a, "max_depth"_a,
                  "max_references"_a, "compact"_a, "cost"_a, "drop_invalid"_a,
                  "masks"_a = nb::none(), "progress"_a = nb::none(), "threads"_a = 0)
      .def("statistics",
           [](const uniform::Octree& tree) { return statistics_dict(tree.statistics()); });
  nb::class_<uniform::IntervalHierarchy, TriangleQueries>(module, "IntervalHierarchy",
                                                          "A bounding interval hierarchy.")
      .def_static("build", &build_intervals, "mesh"_a, "max_leaf_size"_a, "compact"_a, "cost"_a,
                  "drop_invalid"_a, "masks"_a = nb::none(), "progress"_a = nb::none(),
                  "threads"_a = 0)
      .def("statistics", [](const uniform::IntervalHierarchy& tree) {
        return statistics_dict(tree.statistics());
      });
}

}  // namespace umbel::python
