// Kd-trees that answer rays.
#include "umbel/kdtree.hpp"

#include "bind.hpp"
#include "umbel/kdtree_traverse.hpp"

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
  tree_property(config, "target_leaf_size", &kdtree::Config::target_leaf_size);
}

/// A tree and the boxes that it was built over.
struct BoxTree {
  kdtree::Tree tree;
  std::vector<Aabb> boxes;
  bvh::CostModel cost;
};

BoxTree build_boxes(const Rows<float, 6>& boxes, const KdTreeConfig& config,
                    const nb::object& progress, uint32_t threads) {
  const auto given = rows_of<Aabb>(boxes);
  return run(progress, threads, [&](const BuildOptions& options) {
    return BoxTree{
        kdtree::build(given, config.tree, options), {given.begin(), given.end()}, config.tree.cost};
  });
}

using Candidates = nb::typed<nb::tuple, Array<int64_t>, Array<int32_t>>;

/// The primitives in the leaves that rays pass through, in the order of the leaves.
Candidates candidates(const BoxTree& self, const Rows<float, 3>& origins,
                      const Rows<float, 3>& directions, const Flat<float>& t_min,
                      const Flat<float>& t_max) {
  const auto from = rows_of<Vec3>(origins), along = rows_of<Vec3>(directions);
  const auto begins = rows_of<float>(t_min), ends = rows_of<float>(t_max);
  std::vector<int64_t> offsets{0};
  std::vector<uint32_t> found;
  {
    nb::gil_scoped_release release;
    for (size_t i = 0; i < from.size(); ++i) {
      const Ray ray{from[i], begins[i], along[i], ends[i]};
      kdtree::traverse(self.tree, ray, [&](std::span<const uint32_t> primitives) {
        found.insert(found.end(), primitives.begin(), primitives.end());
        return ray.t_max;
      });
      offsets.push_back(static_cast<int64_t>(found.size()));
    }
  }
  return nb::make_tuple(take<int64_t>(std::move(offsets)), take<int32_t>(std::move(found)));
}

void bind_box_tree(nb::module_& module) {
  nb::class_<BoxTree>(module, "BoxKdTree", "A kd-tree over boxes.")
      .def_static("build", &build_boxes, "boxes"_a, "config"_a, "progress"_a = nb::none(),
                  "threads"_a = 0)
      .def_prop_ro("nodes",
                   [](nb::handle self) {
                     const auto& tree = nb::cast<const BoxTree&>(self).tree;
                     return array_over<const uint32_t>(std::span<const kdtree::Node>(tree.nodes),
                                                       self);
                   })
      .def_prop_ro("references",
                   [](nb::handle self) {
                     const auto& tree = nb::cast<const BoxTree&>(self).tree;
                     return array_over<const uint32_t>(std::span<const uint32_t>(tree.references),
                                                       self);
                   })
      .def_prop_ro("bounds",
                   [](const BoxTree& self) {
                     const Aabb& b = self.tree.bounds;
                     return std::array<float, 6>{b.min.x, b.min.y, b.min.z,
                                                 b.max.x, b.max.y, b.max.z};
                   })
      .def("candidates", &candidates, "origins"_a, "directions"_a, "t_min"_a, "t_max"_a)
      .def(
          "overlaps_box",
          [](const BoxTree& self, const std::array<float, 6>& b) {
            return take<int32_t>(
                kdtree::overlaps(self.tree, self.boxes, {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}}));
          },
          "box"_a)
      .def("statistics", [](const BoxTree& self) {
        return statistics_dict(kdtree::statistics(self.tree, self.cost));
      });
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
  bind_box_tree(module);
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
          [](const KdTree& self, const std::filesystem::path& path) {
            nb::gil_scoped_release release;
            self.save(path.string());
          },
          "path"_a, nb::sig("def save(self, path: str | os.PathLike[str]) -> None"))
      .def_static(
          "load",
          [](const std::filesystem::path& path, const std::string& traversal) {
            const kdtree::Traversal wanted = kdtree::traversal_by_name(traversal);
            nb::gil_scoped_release release;
            return KdTree::load(path.string(), wanted);
          },
          "path"_a, "traversal"_a,
          nb::sig("def load(path: str | os.PathLike[str], traversal: str) -> KdTree"))
      .def("statistics", [](const KdTree& tree) { return statistics_dict(tree.statistics()); });
}

}  // namespace umbel::python
