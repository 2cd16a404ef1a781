// Kd-trees that answer rays.
#include "umbel/kdtree.hpp"

#include "bind.hpp"

namespace umbel::python {
namespace {

using kdtree::KdTree;
using kdtree::KdTreeConfig;

void bind_config(nb::module_& module) {
  nb::class_<KdTreeConfig>(module, "KdTreeConfig", "How a kd-tree is built and traced.")
      .def(nb::init<>())
      .def_prop_rw(
          "builder", [](const KdTreeConfig& c) { return std::string(name(c.tree.builder)); },
          [](KdTreeConfig& c, const std::string& name) {
            c.tree.builder = kdtree::builder_by_name(name);
          })
      .def_prop_rw(
          "traversal", [](const KdTreeConfig& c) { return std::string(name(c.traversal)); },
          [](KdTreeConfig& c, const std::string& name) {
            c.traversal = kdtree::traversal_by_name(name);
          })
      .def_prop_rw(
          "cost",
          [](const KdTreeConfig& c) {
            return std::tuple{c.tree.cost.traversal, c.tree.cost.intersection};
          },
          [](KdTreeConfig& c, const std::tuple<float, float>& cost) {
            c.tree.cost = {std::get<0>(cost), std::get<1>(cost)};
          })
      .def_prop_rw(
          "drop_invalid",
          [](const KdTreeConfig& c) { return c.tree.invalid == bvh::InvalidTriangles::kDrop; },
          [](KdTreeConfig& c, bool drop) {
            c.tree.invalid = drop ? bvh::InvalidTriangles::kDrop : bvh::InvalidTriangles::kRefuse;
          })
      .def_rw("compact", &KdTreeConfig::compact)
      .def_prop_rw(
          "empty_bonus", [](const KdTreeConfig& c) { return c.tree.empty_bonus; },
          [](KdTreeConfig& c, float value) { c.tree.empty_bonus = value; })
      .def_prop_rw(
          "max_depth", [](const KdTreeConfig& c) { return c.tree.max_depth; },
          [](KdTreeConfig& c, uint32_t value) { c.tree.max_depth = value; })
      .def_prop_rw(
          "bad_refines", [](const KdTreeConfig& c) { return c.tree.bad_refines; },
          [](KdTreeConfig& c, uint32_t value) { c.tree.bad_refines = value; })
      .def_prop_rw(
          "max_references", [](const KdTreeConfig& c) { return c.tree.max_references; },
          [](KdTreeConfig& c, float value) { c.tree.max_references = value; })
      .def_prop_rw(
          "bins", [](const KdTreeConfig& c) { return c.tree.bins; },
          [](KdTreeConfig& c, uint32_t value) { c.tree.bins = value; });
}

}  // namespace

Dict statistics_dict(const kdtree::Statistics& s) {
  Dict result;
  PUT_FIELDS(result, s, nodes, leaves, empty_leaves, max_depth, references, sah_cost, inner_visits,
             leaf_visits, tests, bytes);
  return result;
}

void bind_kdtree(nb::module_& module) {
  bind_config(module);
  nb::class_<KdTree, TriangleQueries> tree(module, "KdTree", "A kd-tree over triangles.");
  tree.def_static(
          "build",
          [](const MeshArrays& mesh, const KdTreeConfig& config,
             const std::optional<Flat<uint32_t>>& masks, const nb::object& progress,
             uint32_t threads) {
            return run(progress, threads, [&](const BuildOptions& options) {
              return KdTree::build(mesh.view(), config, rows_of<uint32_t>(masks), options);
            });
          },
          "mesh"_a, "config"_a, "masks"_a = nb::none(), "progress"_a = nb::none(), "threads"_a = 0)
      .def_prop_rw(
          "traversal", [](const KdTree& self) { return std::string(name(self.traversal())); },
          [](KdTree& self, const std::string& name) {
            self.set_traversal(kdtree::traversal_by_name(name));
          })
      .def(
          "save",
          [](const KdTree& self, const std::string& path) {
            nb::gil_scoped_release release;
            self.save(path);
          },
          "path"_a)
      .def_static(
          "load",
          [](const std::string& path, const std::string& traversal) {
            const kdtree::Traversal wanted = kdtree::traversal_by_name(traversal);
            nb::gil_scoped_release release;
            return KdTree::load(path, wanted);
          },
          "path"_a, "traversal"_a)
      .def("statistics", [](const KdTree& tree) { return statistics_dict(tree.statistics()); });
}

}  // namespace umbel::python
