// Ray queries of any structure over triangles, for Python.
#pragma once

#include "bind.hpp"
#include "umbel/ray_arrays.hpp"

namespace umbel::python {

using FlatFloats = std::optional<Flat<float>>;
using HitTuple = nb::typed<nb::tuple, Array<float>, Array<int32_t>, Array<float>, Array<float>>;

/// Rays between two looks at whether Ctrl-C was pressed.
inline constexpr size_t kSlice = size_t{1} << 20;

template <typename T>
Array<T> take_as(std::vector<T>&& values) {
  return take<T>(std::move(values));
}

/// Primitive indices as signed numbers, kNone as -1.
inline Array<int32_t> signed_indices(std::vector<uint32_t>&& indices) {
  return take<int32_t>(std::move(indices));
}

template <typename T>
std::span<T> part(std::span<T> values, size_t begin, size_t count) {
  return values.size() <= 1 ? values : values.subspan(begin, count);
}

inline RayArrays slice(const RayArrays& rays, size_t begin, size_t count) {
  return {part(rays.origins, begin, count), part(rays.directions, begin, count),
          part(rays.t_min, begin, count), part(rays.t_max, begin, count)};
}

/// Calls work(begin, count) for slices without the GIL; between them Ctrl-C is noticed.
template <typename Work>
void sliced(size_t total, const Work& work) {
  for (size_t begin = 0; begin < total; begin += kSlice) {
    if (begin > 0 && PyErr_CheckSignals() != 0) throw nb::python_error();
    nb::gil_scoped_release release;
    work(begin, std::min(kSlice, total - begin));
  }
}

/// Rays as Python gave them, kept alive.
struct RayInput {
  Rows<float, 3> origins, directions;
  FlatFloats t_min, t_max;

  RayArrays view() const {
    return {rows_of<Vec3>(origins), rows_of<Vec3>(directions), rows_of<float>(t_min),
            rows_of<float>(t_max)};
  }
};

template <typename Tree>
HitTuple intersect_rays(const Tree& tree, const RayInput& input, uint32_t mask, bool cull,
                        uint32_t threads) {
  const RayArrays rays = input.view();
  const size_t count = ray_count(rays);
  std::vector<float> t(count), u(count), v(count);
  std::vector<uint32_t> primitive(count);
  sliced(count, [&](size_t begin, size_t n) {
    const auto of = [&](auto& values) { return std::span(values).subspan(begin, n); };
    intersect(tree, slice(rays, begin, n), {of(t), of(primitive), of(u), of(v)}, {mask, cull},
              threads);
  });
  return nb::make_tuple(take_as(std::move(t)), signed_indices(std::move(primitive)),
                        take_as(std::move(u)), take_as(std::move(v)));
}

inline Array<bool> bools(std::vector<uint8_t>&& values) { return take<bool>(std::move(values)); }

template <typename Tree>
Array<bool> occluded_rays(const Tree& tree, const RayInput& input, uint32_t mask, bool cull,
                          uint32_t threads) {
  const RayArrays rays = input.view();
  std::vector<uint8_t> results(ray_count(rays));
  sliced(results.size(), [&](size_t begin, size_t n) {
    occluded(tree, slice(rays, begin, n), std::span(results).subspan(begin, n), {mask, cull},
             threads);
  });
  return bools(std::move(results));
}

using AllHitsTuple =
    nb::typed<nb::tuple, Array<int64_t>, Array<float>, Array<int32_t>, Array<float>, Array<float>>;

template <typename Tree>
AllHitsTuple all_hits_of(const Tree& tree, const RayInput& input, size_t max_hits, uint32_t mask,
                         bool cull, uint32_t threads) {
  std::vector<float> t, u, v;
  std::vector<uint32_t> primitive;
  AllHits found;
  {
    nb::gil_scoped_release release;
    found = all_hits(tree, input.view(), max_hits, {mask, cull}, threads);
    for (auto* values : {&t, &u, &v}) values->reserve(found.hits.size());
    primitive.reserve(found.hits.size());
    for (const Hit& hit : found.hits) {
      t.push_back(hit.t);
      primitive.push_back(hit.primitive);
      u.push_back(hit.u);
      v.push_back(hit.v);
    }
  }
  return nb::make_tuple(take<int64_t>(std::move(found.offsets)), take_as(std::move(t)),
                        signed_indices(std::move(primitive)), take_as(std::move(u)),
                        take_as(std::move(v)));
}

/// Defines intersect, occluded and all_hits.
template <typename Tree>
void bind_rays(nb::class_<Tree>& structure) {
  const auto define = [&](const char* name, auto&& function) {
    structure.def(
        name,
        [function](const Tree& self, Rows<float, 3> origins, Rows<float, 3> directions,
                   FlatFloats t_min, FlatFloats t_max, uint32_t mask, bool cull_back_faces,
                   uint32_t threads) {
          return function(self,
                          RayInput{std::move(origins), std::move(directions), std::move(t_min),
                                   std::move(t_max)},
                          mask, cull_back_faces, threads);
        },
        "origins"_a, "directions"_a, "t_min"_a = nb::none(), "t_max"_a = nb::none(),
        "mask"_a = 0xffffffffu, "cull_back_faces"_a = false, "threads"_a = 0);
  };
  define("intersect", &intersect_rays<Tree>);
  define("occluded", &occluded_rays<Tree>);
  structure.def(
      "all_hits",
      [](const Tree& self, Rows<float, 3> origins, Rows<float, 3> directions, FlatFloats t_min,
         FlatFloats t_max, size_t max_hits, uint32_t mask, bool cull_back_faces, uint32_t threads) {
        return all_hits_of(
            self,
            RayInput{std::move(origins), std::move(directions), std::move(t_min), std::move(t_max)},
            max_hits, mask, cull_back_faces, threads);
      },
      "origins"_a, "directions"_a, "t_min"_a = nb::none(), "t_max"_a = nb::none(), "max_hits"_a = 0,
      "mask"_a = 0xffffffffu, "cull_back_faces"_a = false, "threads"_a = 0);
}

}  // namespace umbel::python
