// Validation, welding, snapping and the procedural shapes.
#include "umbel/mesh.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include "base/parallel.hpp"
#include "base/srgb.hpp"
#include "bind.hpp"

namespace umbel::python {
namespace {

using Point = std::tuple<float, float, float>;

std::optional<std::tuple<Point, Point>> bounds_of(const MeshArrays& mesh) {
  const Aabb box = bounds(mesh.view());
  if (box.min.x > box.max.x) return std::nullopt;
  return std::tuple{Point{box.min.x, box.min.y, box.min.z}, Point{box.max.x, box.max.y, box.max.z}};
}

std::tuple<Array<float>, float> snapped(const Rows<float, 3>& positions, float step) {
  const auto given = rows_of<Vec3>(positions);
  std::vector<Vec3> copy(given.begin(), given.end());
  const float moved = snap_to_grid(copy, step);
  return {take<float>(std::move(copy)), moved};
}

std::tuple<double, uint64_t> loss_of(const Rows<double, 3>& world,
                                     const std::array<double, 3>& origin,
                                     const Rows<float, 3>& rounded,
                                     const Rows<uint32_t, 3>& triangles) {
  const nb::gil_scoped_release release;
  const RoundingLoss loss = rounding_loss(rows_of<Vec3d>(world), {origin[0], origin[1], origin[2]},
                                          rows_of<Vec3>(rounded), rows_of<Triangle>(triangles));
  return {loss.largest_move, loss.degenerate};
}

void bind_shapes(nb::module_& module) {
  module.def(
      "shape_grid", [](uint32_t c, uint32_t r) { return dict_of(shapes::grid(c, r)); }, "columns"_a,
      "rows"_a);
  module.def(
      "shape_sphere", [](uint32_t n) { return dict_of(shapes::sphere(n)); }, "subdivisions"_a);
  module.def(
      "shape_torus", [](uint32_t r, uint32_t s) { return dict_of(shapes::torus(r, s)); }, "rings"_a,
      "sides"_a);
  module.def(
      "shape_moebius", [](uint32_t s, uint32_t w) { return dict_of(shapes::moebius(s, w)); },
      "segments"_a, "width"_a);
  module.def("shape_fan", [](uint32_t n) { return dict_of(shapes::fan(n)); }, "triangles"_a);
  module.def(
      "shape_soup", [](uint32_t n, uint32_t seed) { return dict_of(shapes::soup(n, seed)); },
      "triangles"_a, "seed"_a = 1);
  module.def(
      "shape_tetrahedra", [](uint32_t n) { return dict_of(shapes::tetrahedra(n)); }, "count"_a);
  module.def(
      "shape_terrain",
      [](uint32_t c, uint32_t r, uint32_t seed) { return dict_of(shapes::terrain(c, r, seed)); },
      "columns"_a, "rows"_a, "seed"_a = 1);
  module.def(
      "shape_blob", [](uint32_t n, uint32_t seed) { return dict_of(shapes::blob(n, seed)); },
      "subdivisions"_a, "seed"_a = 1);
}

// A function of every value.
Array<float> each(const Flat<float>& values, float (*function)(float)) {
  std::vector<float> out(values.size());
  {
    const nb::gil_scoped_release release;
    parallel_for(out.size(), 4096, [&](size_t i) { out[i] = function(values.data()[i]); });
  }
  return take<float>(std::move(out));
}

}  // namespace

/// Over 60 lines: a list of methods.
void bind_mesh(nb::module_& module) {
  nb::class_<MeshArrays>(module, "MeshArrays",
                         "A mesh's arrays, checked for type and shape and kept alive.")
      .def(
          "__init__",
          [](MeshArrays* self, Rows<float, 3> positions, Rows<uint32_t, 3> triangles,
             std::optional<Rows<float, 3>> normals, std::optional<Rows<float, 4>> tangents,
             std::optional<Rows<float, 2>> uvs, std::optional<Rows<float, 4>> colors,
             std::optional<Flat<uint32_t>> materials,
             const std::vector<std::pair<uint32_t, uint32_t>>& extras,
             std::optional<Flat<float>> extra_values) {
            new (self) MeshArrays{std::move(positions),   std::move(triangles),
                                  std::move(normals),     std::move(tangents),
                                  std::move(uvs),         std::move(colors),
                                  std::move(materials),   {},
                                  std::move(extra_values)};
            for (const auto& [kind, set] : extras)
              self->extras.push_back({static_cast<ExtraKind>(kind), set});
          },
          "positions"_a, "triangles"_a, "normals"_a = nb::none(), "tangents"_a = nb::none(),
          "uvs"_a = nb::none(), "colors"_a = nb::none(), "materials"_a = nb::none(),
          "extras"_a = nb::make_tuple(), "extra_values"_a = nb::none());
  module.def(
      "validate",
      [](const MeshArrays& mesh, const nb::object& progress, uint32_t threads) {
        run(progress, threads, [&](const BuildOptions& o) { validate(mesh.view(), o); });
      },
      "mesh"_a, "progress"_a = nb::none(), "threads"_a = 0,
      "Raises umbel.Error naming the first triangle or vertex at fault.");
  module.def(
      "drop_invalid",
      [](const MeshArrays& mesh, const nb::object& progress, uint32_t threads) {
        DropResult result = run(
            progress, threads, [&](const BuildOptions& o) { return drop_invalid(mesh.view(), o); });
        return std::tuple{dict_of(std::move(result.mesh)), result.dropped};
      },
      "mesh"_a, "progress"_a = nb::none(), "threads"_a = 0, "(mesh, triangles dropped)");
  module.def(
      "weld",
      [](const MeshArrays& mesh, const nb::object& progress, uint32_t threads) {
        return dict_of(
            run(progress, threads, [&](const BuildOptions& o) { return weld(mesh.view(), o); }));
      },
      "mesh"_a, "progress"_a = nb::none(), "threads"_a = 0,
      "Equal vertices become one, unused ones go; triangles keep their order.");
  module.def("snap_to_grid", &snapped, "positions"_a, "step"_a,
             "(positions rounded to multiples of step, largest distance moved)");
  module.def(
      "from_srgb", [](const Flat<float>& values) { return each(values, from_srgb); }, "values"_a,
      "(n,) linear values of those of sRGB");
  module.def(
      "to_srgb", [](const Flat<float>& values) { return each(values, to_srgb); }, "values"_a,
      "(n,) the inverse of from_srgb");
  module.def("rounding_loss", &loss_of, "world"_a, "origin"_a, "rounded"_a, "triangles"_a,
             "(largest move of a vertex, triangles that lost their area)");
  module.def("bounds", &bounds_of, "mesh"_a, "((x, y, z), (x, y, z)), or None if empty");
  module.def(
      "position_ids",
      [](const Rows<float, 3>& positions) {
        return take<uint32_t>(position_ids(rows_of<Vec3>(positions)));
      },
      "positions"_a, "(n,) lowest index of a vertex at the same position");
  module.def(
      "triangle_boxes",
      [](const MeshArrays& mesh, uint32_t threads) {
        return take<float>(run(nb::none(), threads, [&](const BuildOptions& o) {
          return triangle_boxes(mesh.view(), o);
        }));
      },
      "mesh"_a, "threads"_a = 0, "(m, 6) min x, y, z, max x, y, z of each triangle");
  module.def(
      "triangle_set_digest",
      [](const MeshArrays& mesh) { return triangle_set_digest(mesh.view()); }, "mesh"_a,
      "64-bit digest of the triangles as a set of positions, whatever their order");
  bind_shapes(module);
}

}  // namespace umbel::python
