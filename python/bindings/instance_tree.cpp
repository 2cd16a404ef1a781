// Trees of instances: what a view shows of millions of them.
#include "umbel/instance_tree.hpp"

#include "lod.hpp"

namespace umbel::python {
namespace {

/// (r, 4): a run's node, first placement, number of placements, and whether the coarsest will do.
using RunRow = std::array<uint32_t, 4>;

using StepTuple = std::tuple<Array<uint32_t>, Array<uint32_t>, uint64_t, uint64_t, uint64_t>;

StepTuple tuple_of(const InstanceStep& step) {
  std::vector<RunRow> rows;
  rows.reserve(step.runs.size());
  for (const InstanceRun& run : step.runs)
    rows.push_back({run.node, run.placements.offset, run.placements.count, run.is_coarsest});
  std::vector<uint32_t> missing = step.missing;
  return {take<uint32_t>(std::move(rows)), take<uint32_t>(std::move(missing)), step.shown,
          step.refined, step.stand_ins};
}

using PlacementArrays = std::tuple<Array<uint32_t>, Array<float>>;

PlacementArrays arrays_of(std::span<const Instance> instances) {
  std::vector<uint32_t> meshes;
  std::vector<std::array<float, 12>> rows;
  for (const Instance& instance : instances) {
    meshes.push_back(instance.mesh);
    rows.push_back(instance.transform.rows);
  }
  return {take<uint32_t>(std::move(meshes)), take<float>(std::move(rows))};
}

class PythonSelector : public AssetUser, public InstanceSelector {
 public:
  PythonSelector(nb::object object, const Asset& asset, size_t max_bytes)
      : AssetUser(std::move(object)), InstanceSelector(asset, max_bytes) {}
};

PlacementArrays placements_of(const PythonSelector& selector, const Rows<uint32_t, 4>& runs) {
  return arrays_of(selector.alone([&] {
    std::vector<Instance> all;
    for (const RunRow& row : rows_of<RunRow>(runs)) {
      const auto some = selector.placements({row[0], {row[1], row[2]}, row[3] != 0});
      all.insert(all.end(), some.begin(), some.end());
    }
    return all;
  }));
}

/// Nodes that may have to be read, for which other threads may need the GIL.
const std::vector<InstanceNode>& all_nodes(const Asset& asset) {
  const nb::gil_scoped_release release;
  return asset.instance_nodes();
}

Dict nodes_of(const Asset& asset) {
  std::vector<Sphere> spheres;
  std::vector<float> errors;
  std::vector<Range> children;
  std::vector<uint32_t> instances, placements;
  for (const InstanceNode& node : all_nodes(asset)) {
    spheres.push_back(node.sphere);
    errors.push_back(node.error);
    children.push_back(node.children);
    instances.push_back(node.instances);
    placements.push_back(node.placements);
  }
  Dict result;
  result["spheres"] = take<float>(std::move(spheres));
  result["errors"] = take<float>(std::move(errors));
  result["children"] = take<uint32_t>(std::move(children));
  result["instances"] = take<uint32_t>(std::move(instances));
  result["placements"] = take<uint32_t>(std::move(placements));
  return result;
}

}  // namespace

void bind_instance_tree(nb::module_& module) {
  PyType_Slot slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(&traverse<PythonSelector>)},
                         {0, nullptr}};
  nb::class_<PythonSelector>(module, "InstanceSelector", "Selects from a tree of instances.",
                             nb::type_slots(slots))
      .def(
          "__init__",
          [](PythonSelector* self, const Asset& asset, size_t max_bytes) {
            nb::object object = nb::find(asset);
            const nb::gil_scoped_release release;
            new (self) PythonSelector(std::move(object), asset, max_bytes);
          },
          "asset"_a, "max_bytes"_a)
      .def(
          "step",
          [](PythonSelector& selector, const lod::View& view,
             const std::optional<Rows<float, 4>>& planes) {
            return tuple_of(
                selector.alone([&] { return selector.step(view, rows_of<Plane>(planes)); }));
          },
          "view"_a, "planes"_a = nb::none())
      .def(
          "settle",
          [](PythonSelector& selector, const lod::View& view,
             const std::optional<Rows<float, 4>>& planes) {
            return tuple_of(
                selector.alone([&] { return selector.settle(view, rows_of<Plane>(planes)); }));
          },
          "view"_a, "planes"_a = nb::none())
      .def(
          "load",
          [](PythonSelector& selector, const Flat<uint32_t>& nodes, size_t most) {
            selector.alone([&] { selector.load(rows_of<uint32_t>(nodes), most); });
          },
          "nodes"_a, "most"_a)
      .def("placements", &placements_of, "runs"_a)
      .def_prop_ro("bytes", [](const PythonSelector& selector) {
        return selector.alone([&] { return selector.bytes(); });
      });
  module.def("has_instance_tree", &Asset::has_instance_tree, "asset"_a);
  module.def("instance_nodes", &nodes_of, "asset"_a);
  module.def(
      "placement_page_bytes",
      [](const Asset& asset) {
        std::vector<uint32_t> bytes(all_nodes(asset).size());
        for (uint32_t n = 0; n < bytes.size(); ++n) bytes[n] = asset.placement_bytes(n);
        return take<uint32_t>(std::move(bytes));
      },
      "asset"_a);
  module.def(
      "placements_of_node",
      [](const Asset& asset, uint32_t node) {
        std::vector<Instance> placements;
        {
          const nb::gil_scoped_release release;
          placements = asset.placements(node);
        }
        return arrays_of(placements);
      },
      "asset"_a, "node"_a);
}

}  // namespace umbel::python
