// Trees that boxes join and leave one at a time.
#include "bind.hpp"
#include "umbel/dynamic_bvh.hpp"

namespace umbel::python {
namespace {

using bvh::DynamicTree;
using Boxes = Rows<float, 6>;
using Numbers = Flat<uint32_t>;

/// A binary tree of the same type that builders give.
bvh::Bvh2 snapshot(const DynamicTree& tree, uint32_t max_leaf_size) {
  nb::gil_scoped_release release;
  return tree.snapshot(max_leaf_size);
}

void bind_changes(nb::class_<DynamicTree>& tree) {
  tree.def(
          "insert",
          [](DynamicTree& self, const Boxes& boxes) {
            std::vector<uint32_t> numbers;
            numbers.reserve(boxes.shape(0));
            {
              nb::gil_scoped_release release;
              for (const Aabb& box : rows_of<Aabb>(boxes)) numbers.push_back(self.insert(box));
            }
            return take<uint32_t>(std::move(numbers));
          },
          "boxes"_a)
      .def(
          "remove",
          [](DynamicTree& self, const Numbers& numbers) {
            nb::gil_scoped_release release;
            for (const uint32_t number : rows_of<uint32_t>(numbers)) self.remove(number);
          },
          "numbers"_a)
      .def(
          "move",
          [](DynamicTree& self, const Numbers& numbers, const Boxes& boxes) {
            const auto some = rows_of<uint32_t>(numbers);
            const auto there = rows_of<Aabb>(boxes);
            nb::gil_scoped_release release;
            for (size_t i = 0; i < some.size(); ++i) self.move(some[i], there[i]);
          },
          "numbers"_a, "boxes"_a)
      .def(
          "refit",
          [](DynamicTree& self, const Numbers& numbers, const Boxes& boxes) {
            nb::gil_scoped_release release;
            self.refit(rows_of<uint32_t>(numbers), rows_of<Aabb>(boxes));
          },
          "numbers"_a, "boxes"_a)
      .def(
          "rebuild",
          [](DynamicTree& self, const bvh::Config& config, uint32_t threads) {
            run(nb::none(), threads, [&](const BuildOptions& options) {
              self.rebuild(config, options);
              return 0;
            });
          },
          "config"_a, "threads"_a = 0);
}

}  // namespace

void bind_dynamic_tree(nb::module_& module) {
  nb::class_<DynamicTree> tree(module, "DynamicTree", "A tree over boxes that come and go.");
  tree.def_static(
          "build",
          [](const Boxes& boxes, const bvh::Config& config, uint32_t threads) {
            return run(nb::none(), threads, [&](const BuildOptions& options) {
              return DynamicTree::build(rows_of<Aabb>(boxes), config, options);
            });
          },
          "boxes"_a, "config"_a, "threads"_a = 0)
      .def_prop_ro("size", &DynamicTree::size)
      .def("contains", &DynamicTree::contains, "number"_a)
      .def(
          "box",
          [](const DynamicTree& self, uint32_t number) {
            const Aabb b = self.box(number);
            return std::array<float, 6>{b.min.x, b.min.y, b.min.z, b.max.x, b.max.y, b.max.z};
          },
          "number"_a)
      .def("quality",
           [](const DynamicTree& self) {
             const bvh::DynamicQuality q = self.quality();
             return std::tuple{q.sah_cost, q.built_sah_cost, q.rebuild_advised};
           })
      .def(
          "overlaps_box",
          [](const DynamicTree& self, const std::array<float, 6>& b) {
            return take<uint32_t>(self.overlaps({{b[0], b[1], b[2]}, {b[3], b[4], b[5]}}));
          },
          "box"_a)
      .def("snapshot", &snapshot, "max_leaf_size"_a);
  bind_changes(tree);
}

}  // namespace umbel::python
