// Uniform structures that answer rays, distances and overlaps.
#include "umbel/uniform.hpp"

#include "bind.hpp"

namespace umbel::python {
namespace {

using Cost = std::tuple<float, float>;
using Masks = std::optional<Flat<uint32_t>>;

template <typename Config>
void set_common(Config& config, bool compact, const Cost& cost, bool drop_invalid) {
  config.compact = compact;
  config.cost = {std::get<0>(cost), std::get<1>(cost)};
  if (drop_invalid) config.invalid = bvh::InvalidTriangles::kDrop;
}

uniform::TwoLevelGrid build_grid(const MeshArrays& mesh, float density, float leaf_density,
                                 float max_references, bool compact, const Cost& cost,
                                 bool drop_invalid, const Masks& masks, const nb::object& progress,
                                 uint32_t threads) {
  uniform::GridConfig config;
  config.density = density;
  config.leaf_density = leaf_density;
  config.max_references = max_references;
  set_common(config, compact, cost, drop_invalid);
  return run(progress, threads, [&](const BuildOptions& options) {
    return uniform::TwoLevelGrid::build(mesh.view(), config, rows_of<uint32_t>(masks), options);
  });
}

uniform::Octree build_octree(const MeshArrays& mesh, uint32_t max_leaf_size, uint32_t max_depth,
                             float max_references, bool compact, const Cost& cost,
                             bool drop_invalid, const Masks& masks, const nb::object& progress,
                             uint32_t threads) {
  uniform::OctreeConfig config;
  config.max_leaf_size = max_leaf_size;
  config.max_depth = max_depth;
  config.max_references = max_references;
  set_common(config, compact, cost, drop_invalid);
  return run(progress, threads, [&](const BuildOptions& options) {
    return uniform::Octree::build(mesh.view(), config, rows_of<uint32_t>(masks), options);
  });
}

uniform::IntervalHierarchy build_intervals(const MeshArrays& mesh, uint32_t max_leaf_size,
                                           bool compact, const Cost& cost, bool drop_invalid,
                                           const Masks& masks, const nb::object& progress,
                                           uint32_t threads) {
  uniform::IntervalConfig config;
  config.max_leaf_size = max_leaf_size;
  set_common(config, compact, cost, drop_invalid);
  return run(progress, threads, [&](const BuildOptions& options) {
    return uniform::IntervalHierarchy::build(mesh.view(), config, rows_of<uint32_t>(masks),
                                             options);
  });
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
