// Kd-trees that answer rays.
#include "umbel/kdtree.hpp"

#include "bind.hpp"

namespace umbel::python {
namespace {

using kdtree::KdTree;
using kdtree::KdTreeConfig;

/// A number among the settings of the tree's build.
template <typename T>
void tree_property(nb::class_<KdTreeConfig>& config, const char* name, T kdtree::Config::* member) {
  config.def_prop_rw(
      name, [member](const KdTreeConfig& c) { return c.tree.*member; },
      [member](KdTreeConfig& c, T value) { c.tree.*member = value; });
}

void bind_config(nb::module_& module) {
  nb::class_<KdTreeConfig> config(module, "KdTreeConfig", "How a kd-tree is built and traced.");
  config.def(nb::init<>())
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
      .def_rw("compact", &KdTreeConfig::compact);
  tree_property(config, "empty_bonus", &kdtree::Config::empty_bonus);
  tree_property(config, "max_depth", &kdtree::Config::max_depth);
  tree_property(config, "bad_refines", &kdtree::Config::bad_refines);
  tree_property(config, "max_references", &kdtree::Config::max_references);
  tree_property(config, "bins", &kdtree::Config::bins);
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
