// Selection from tables alone: cuts, culling, instances, budgets.
#include "lod.hpp"
#include "umbel/lod.hpp"

namespace umbel::python {
namespace {

using lod::Tables;
using lod::View;
using Planes = std::optional<Rows<float, 4>>;
using NormalCones = std::optional<Rows<float, 11>>;
using Transforms = Rows<float, 12>;

static_assert(sizeof(ClusterBounds) == 11 * sizeof(float));
static_assert(sizeof(Plane) == 4 * sizeof(float));
static_assert(sizeof(Transform) == 12 * sizeof(float));

lod::Culling culling_of(const Planes& planes, const NormalCones& normal_cones) {
  return {rows_of<Plane>(planes), rows_of<ClusterBounds>(normal_cones)};
}

std::vector<uint32_t> select_by(const std::string& method, const Tables& tables, const View& view,
                                const lod::Culling& culling) {
  if (method == "flat") return lod::select(tables, view, culling);
  if (method == "hierarchy") return lod::select_hierarchy(tables, view, culling);
  if (method == "breadth_first") return lod::select_breadth_first(tables, view, culling);
  throw Error(ErrorCode::kInvalidArgument,
              "method must be 'flat', 'hierarchy' or 'breadth_first', not '" + method + "'");
}

void bind_views(nb::module_& module) {
  nb::class_<View>(module, "View", "What decides whether a group must be refined.")
      .def_rw("error", &View::error)
      .def_rw("threshold", &View::threshold)
      .def_ro("level", &View::level)
      .def_prop_ro(
          "eye",
          [](const View& view) { return std::array<float, 3>{view.eye.x, view.eye.y, view.eye.z}; })
      .def_prop_ro("kind", [](const View& view) {
        constexpr const char* kKinds[] = {"error", "camera", "level"};
        return kKinds[static_cast<size_t>(view.kind)];
      });
  module.def("view_error", &lod::view_error, "error"_a);
  module.def(
      "view_camera",
      [](std::array<float, 3> eye, float fov_y, uint32_t height, float pixel_error) {
        return lod::view_camera({eye[0], eye[1], eye[2]}, fov_y, height, pixel_error);
      },
      "eye"_a, "fov_y"_a, "height"_a, "pixel_error"_a);
  module.def("view_level", &lod::view_level, "level"_a);
  module.def(
      "view_in_instance",
      [](const View& view, const Transforms& transform) {
        return lod::to_object(view, rows_of<Transform>(transform).front());
      },
      "view"_a, "transform"_a);
  module.def(
      "frustum_planes",
      [](std::array<float, 3> eye, std::array<float, 3> target, std::array<float, 3> up,
         float fov_y, float aspect, float near_plane, float far_plane) {
        return take<float>(lod::frustum_planes({{eye[0], eye[1], eye[2]},
                                                {target[0], target[1], target[2]},
                                                {up[0], up[1], up[2]},
                                                fov_y},
                                               aspect, near_plane, far_plane));
      },
      "eye"_a, "target"_a, "up"_a, "fov_y"_a, "aspect"_a, "near_plane"_a, "far_plane"_a,
      "(5 or 6, 4) inward unit normal and offset: left, right, bottom, top, near, far");
  module.def("angular_error", &lod::angular_error, "error"_a, "distance"_a);
  module.def("pixel_error", &lod::pixel_error, "error"_a, "distance"_a, "fov_y"_a, "height"_a);
}

}  // namespace

void bind_select(nb::module_& module) {
  bind_views(module);
  module.def(
      "select",
      [](const Tables& tables, const View& view, const std::string& method, const Planes& planes,
         const NormalCones& normal_cones) {
        std::vector<uint32_t> cut;
        {
          nb::gil_scoped_release release;
          cut = select_by(method, tables, view, culling_of(planes, normal_cones));
        }
        return take<uint32_t>(std::move(cut));
      },
      "tables"_a, "view"_a, "method"_a = "hierarchy", "planes"_a = nb::none(),
      "normal_cones"_a = nb::none(), "(c,) clusters of the cut, ascending");
  module.def(
      "select_instances",
      [](const Tables& tables, const View& view, const Transforms& transforms, const Planes& planes,
         const NormalCones& normal_cones) -> std::tuple<Array<uint32_t>, Array<uint32_t>> {
        lod::InstanceCuts cuts;
        {
          nb::gil_scoped_release release;
          cuts = lod::select_instances(tables, view, culling_of(planes, normal_cones),
                                       rows_of<Transform>(transforms));
        }
        return {take<uint32_t>(std::move(cuts.offsets)), take<uint32_t>(std::move(cuts.clusters))};
      },
      "tables"_a, "view"_a, "transforms"_a, "planes"_a = nb::none(), "normal_cones"_a = nb::none());
  module.def(
      "view_for_budget",
      [](const Tables& tables, const View& view, const Flat<uint32_t>& costs, uint64_t budget,
         const Planes& planes, const NormalCones& normal_cones,
         const std::optional<Transforms>& transforms,
         const std::optional<Flat<uint32_t>>& group_costs) {
        nb::gil_scoped_release release;
        return lod::view_for_budget(
            tables, view, {rows_of<uint32_t>(costs), rows_of<uint32_t>(group_costs)}, budget,
            culling_of(planes, normal_cones), rows_of<Transform>(transforms));
      },
      "tables"_a, "view"_a, "costs"_a, "budget"_a, "planes"_a = nb::none(),
      "normal_cones"_a = nb::none(), "transforms"_a = nb::none(), "group_costs"_a = nb::none());
  module.def(
      "select_for_budget",
      [](const Tables& tables, const View& view, const Flat<uint32_t>& costs, uint64_t budget,
         const Planes& planes, const NormalCones& normal_cones,
         const std::optional<Transforms>& transforms,
         const std::optional<Flat<uint32_t>>& group_costs)
          -> std::tuple<Array<uint32_t>, Array<uint32_t>> {
        lod::BudgetCuts made;
        {
          nb::gil_scoped_release release;
          made = lod::select_for_budget(
              tables, view, {rows_of<uint32_t>(costs), rows_of<uint32_t>(group_costs)}, budget,
              culling_of(planes, normal_cones), rows_of<Transform>(transforms));
        }
        return {take<uint32_t>(std::move(made.cuts.offsets)),
                take<uint32_t>(std::move(made.cuts.clusters))};
      },
      "tables"_a, "view"_a, "costs"_a, "budget"_a, "planes"_a = nb::none(),
      "normal_cones"_a = nb::none(), "transforms"_a = nb::none(), "group_costs"_a = nb::none());
  module.def(
      "byte_costs",
      [](const Tables& tables, uint32_t vertex_bytes, uint32_t triangle_bytes) {
        return take<uint32_t>(lod::byte_costs(tables, vertex_bytes, triangle_bytes));
      },
      "tables"_a, "vertex_bytes"_a, "triangle_bytes"_a = 3);
}

}  // namespace umbel::python
