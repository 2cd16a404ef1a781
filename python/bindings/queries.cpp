// The queries of every structure over triangles, for Python.
#include <algorithm>

#include "base/poll.hpp"
#include "bind.hpp"
#include "umbel/ray_arrays.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel::python {
namespace {

using FlatFloats = std::optional<Flat<float>>;
using HitTuple = nb::typed<nb::tuple, Array<float>, Array<int32_t>, Array<float>, Array<float>>;

/// Rays or points at once, which bounds memory.
constexpr size_t kSlice = size_t{1} << 20;

template <typename T>
Array<T> take_as(std::vector<T>&& values) {
  return take<T>(std::move(values));
}

/// Primitive indices as signed numbers, kNone as -1.
Array<int32_t> signed_indices(std::vector<uint32_t>&& indices) {
  return take<int32_t>(std::move(indices));
}

template <typename T>
std::span<T> part(std::span<T> values, size_t begin, size_t count) {
  return values.size() <= 1 ? values : values.subspan(begin, count);
}

RayArrays slice(const RayArrays& rays, size_t begin, size_t count) {
  return {part(rays.origins, begin, count), part(rays.directions, begin, count),
          part(rays.t_min, begin, count), part(rays.t_max, begin, count)};
}

/// Calls work(begin, count) for slices without the GIL. Ctrl-C ends it.
template <typename Work>
void sliced(size_t total, const Work& work) {
  interruptible([&] {
    for (size_t begin = 0; begin < total; begin += kSlice) {
      poll();
      work(begin, std::min(kSlice, total - begin));
    }
  });
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

HitTuple intersect_rays(const TriangleQueries& structure, const RayInput& input, uint32_t mask,
                        bool cull, uint32_t threads) {
  const RayArrays rays = input.view();
  const size_t count = ray_count(rays);
  std::vector<float> t(count), u(count), v(count);
  std::vector<uint32_t> primitive(count);
  sliced(count, [&](size_t begin, size_t n) {
    const auto of = [&](auto& values) { return std::span(values).subspan(begin, n); };
    intersect(structure, slice(rays, begin, n), {of(t), of(primitive), of(u), of(v)}, {mask, cull},
              threads);
  });
  return nb::make_tuple(take_as(std::move(t)), signed_indices(std::move(primitive)),
                        take_as(std::move(u)), take_as(std::move(v)));
}

Array<bool> bools(std::vector<uint8_t>&& values) { return take<bool>(std::move(values)); }

Array<bool> occluded_rays(const TriangleQueries& structure, const RayInput& input, uint32_t mask,
                          bool cull, uint32_t threads) {
  const RayArrays rays = input.view();
  std::vector<uint8_t> results(ray_count(rays));
  sliced(results.size(), [&](size_t begin, size_t n) {
    occluded(structure, slice(rays, begin, n), std::span(results).subspan(begin, n), {mask, cull},
             threads);
  });
  return bools(std::move(results));
}

using AllHitsTuple =
    nb::typed<nb::tuple, Array<int64_t>, Array<float>, Array<int32_t>, Array<float>, Array<float>>;

AllHitsTuple all_hits_of(const TriangleQueries& structure, const RayInput& input, size_t max_hits,
                         uint32_t mask, bool cull, uint32_t threads) {
  const RayArrays rays = input.view();
  std::vector<int64_t> offsets{0};
  std::vector<float> t, u, v;
  std::vector<uint32_t> primitive;
  sliced(ray_count(rays), [&](size_t begin, size_t n) {
    const AllHits found =
        all_hits(structure, slice(rays, begin, n), max_hits, {mask, cull}, threads);
    if (begin == 0) {
      for (auto* values : {&t, &u, &v}) values->reserve(found.hits.size());
      primitive.reserve(found.hits.size());
    }
    const int64_t before = offsets.back();
    for (size_t i = 1; i <= n; ++i)
      offsets.push_back(before + static_cast<int64_t>(found.offsets[i]));
    for (const Hit& hit : found.hits) {
      t.push_back(hit.t);
      primitive.push_back(hit.primitive);
      u.push_back(hit.u);
      v.push_back(hit.v);
    }
  });
  return nb::make_tuple(take<int64_t>(std::move(offsets)), take_as(std::move(t)),
                        signed_indices(std::move(primitive)), take_as(std::move(u)),
                        take_as(std::move(v)));
}

using ClosestTuple =
    nb::typed<nb::tuple, Array<float>, Array<float>, Array<int32_t>, Array<float>, Array<float>>;

ClosestTuple closest_points(const TriangleQueries& structure, const Rows<float, 3>& points,
                            float max_distance, uint32_t threads) {
  const auto given = rows_of<Vec3>(points);
  std::vector<Vec3> point(given.size());
  std::vector<float> distance(given.size()), u(given.size()), v(given.size());
  std::vector<uint32_t> primitive(given.size());
  std::vector<ClosestPoint> found(std::min(given.size(), kSlice));
  sliced(given.size(), [&](size_t begin, size_t n) {
    structure.closest_point(given.subspan(begin, n), std::span(found).first(n), max_distance,
                            threads);
    for (size_t i = 0; i < n; ++i) {
      point[begin + i] = found[i].point;
      distance[begin + i] = found[i].distance;
      primitive[begin + i] = found[i].primitive;
      u[begin + i] = found[i].u;
      v[begin + i] = found[i].v;
    }
  });
  return nb::make_tuple(take<float>(std::move(point)), take_as(std::move(distance)),
                        signed_indices(std::move(primitive)), take_as(std::move(u)),
                        take_as(std::move(v)));
}

Array<bool> contains_points(const TriangleQueries& structure, const Rows<float, 3>& points,
                            uint32_t threads) {
  const auto given = rows_of<Vec3>(points);
  std::vector<uint8_t> results(given.size());
  sliced(given.size(), [&](size_t begin, size_t n) {
    structure.contains(given.subspan(begin, n), std::span(results).subspan(begin, n), threads);
  });
  return bools(std::move(results));
}

Array<float> signed_distances(const TriangleQueries& structure, const Rows<float, 3>& points,
                              uint32_t threads) {
  const auto given = rows_of<Vec3>(points);
  std::vector<float> results(given.size());
  sliced(given.size(), [&](size_t begin, size_t n) {
    structure.signed_distance(given.subspan(begin, n), std::span(results).subspan(begin, n),
                              threads);
  });
  return take_as(std::move(results));
}

template <typename Region>
Array<int32_t> overlapping(const TriangleQueries& structure, const Region& region) {
  std::vector<uint32_t> found;
  {
    nb::gil_scoped_release release;
    found = structure.overlaps(region);
  }
  return signed_indices(std::move(found));
}

/// Defines intersect, occluded and all_hits.
void bind_rays(nb::class_<TriangleQueries>& structure) {
  const auto define = [&](const char* name, auto&& function) {
    structure.def(
        name,
        [function](const TriangleQueries& self, Rows<float, 3> origins, Rows<float, 3> directions,
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
  define("intersect", &intersect_rays);
  define("occluded", &occluded_rays);
  structure.def(
      "all_hits",
      [](const TriangleQueries& self, Rows<float, 3> origins, Rows<float, 3> directions,
         FlatFloats t_min, FlatFloats t_max, size_t max_hits, uint32_t mask, bool cull_back_faces,
         uint32_t threads) {
        return all_hits_of(
            self,
            RayInput{std::move(origins), std::move(directions), std::move(t_min), std::move(t_max)},
            max_hits, mask, cull_back_faces, threads);
      },
      "origins"_a, "directions"_a, "t_min"_a = nb::none(), "t_max"_a = nb::none(), "max_hits"_a = 0,
      "mask"_a = 0xffffffffu, "cull_back_faces"_a = false, "threads"_a = 0);
}

void bind_shapes(nb::class_<TriangleQueries>& structure) {
  structure.def("closest_point", &closest_points, "points"_a, "max_distance"_a, "threads"_a = 0)
      .def("contains", &contains_points, "points"_a, "threads"_a = 0)
      .def("signed_distance", &signed_distances, "points"_a, "threads"_a = 0)
      .def(
          "overlaps_box",
          [](const TriangleQueries& self, const std::array<float, 3>& low,
             const std::array<float, 3>& high) {
            return overlapping(self, Aabb{{low[0], low[1], low[2]}, {high[0], high[1], high[2]}});
          },
          "min"_a, "max"_a)
      .def(
          "overlaps_sphere",
          [](const TriangleQueries& self, const std::array<float, 3>& center, float radius) {
            return overlapping(self, Sphere{{center[0], center[1], center[2]}, radius});
          },
          "center"_a, "radius"_a)
      .def(
          "overlaps_frustum",
          [](const TriangleQueries& self,
             nb::ndarray<const float, nb::shape<6, 4>, nb::c_contig, nb::device::cpu> planes) {
            Frustum frustum;
            for (size_t i = 0; i < frustum.size(); ++i) {
              const float* p = planes.data() + 4 * i;
              frustum[i] = {{p[0], p[1], p[2]}, p[3]};
            }
            return overlapping(self, frustum);
          },
          "planes"_a);
}

}  // namespace

void bind_queries(nb::module_& module) {
  nb::class_<TriangleQueries> structure(module, "TriangleQueries", "Queries over triangles.");
  bind_rays(structure);
  bind_shapes(structure);
  structure
      .def_prop_ro("bounds",
                   [](const TriangleQueries& self) {
                     const Aabb box = self.bounds();
                     return std::tuple{std::array{box.min.x, box.min.y, box.min.z},
                                       std::array{box.max.x, box.max.y, box.max.z}};
                   })
      .def_prop_ro("triangle_count", &TriangleQueries::triangle_count);
}

}  // namespace umbel::python
