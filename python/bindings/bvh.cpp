// Binary trees from every builder, and hierarchies over triangles that answer rays, distances and
// overlaps.
#include "umbel/bvh.hpp"

#include <nanobind/stl/vector.h>

#include "bind.hpp"
#include "umbel/bvh_presets.hpp"
#include "umbel/ray_arrays.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::python {
namespace {

using FlatFloats = std::optional<Flat<float>>;
using HitTuple = nb::typed<nb::tuple, Array<float>, Array<int32_t>, Array<float>, Array<float>>;

/// Rays between two looks at whether Ctrl-C was pressed.
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

HitTuple intersect_rays(const TriangleBvh& bvh, const RayInput& input, uint32_t mask, bool cull,
                        uint32_t threads) {
  const RayArrays rays = input.view();
  const size_t count = ray_count(rays);
  std::vector<float> t(count), u(count), v(count);
  std::vector<uint32_t> primitive(count);
  sliced(count, [&](size_t begin, size_t n) {
    const auto of = [&](auto& values) { return std::span(values).subspan(begin, n); };
    intersect(bvh, slice(rays, begin, n), {of(t), of(primitive), of(u), of(v)}, {mask, cull},
              threads);
  });
  return nb::make_tuple(take_as(std::move(t)), signed_indices(std::move(primitive)),
                        take_as(std::move(u)), take_as(std::move(v)));
}

Array<bool> bools(std::vector<uint8_t>&& values) { return take<bool>(std::move(values)); }

Array<bool> occluded_rays(const TriangleBvh& bvh, const RayInput& input, uint32_t mask, bool cull,
                          uint32_t threads) {
  const RayArrays rays = input.view();
  std::vector<uint8_t> results(ray_count(rays));
  sliced(results.size(), [&](size_t begin, size_t n) {
    occluded(bvh, slice(rays, begin, n), std::span(results).subspan(begin, n), {mask, cull},
             threads);
  });
  return bools(std::move(results));
}

using AllHitsTuple =
    nb::typed<nb::tuple, Array<int64_t>, Array<float>, Array<int32_t>, Array<float>, Array<float>>;

AllHitsTuple all_hits_of(const TriangleBvh& bvh, const RayInput& input, size_t max_hits,
                         uint32_t mask, bool cull, uint32_t threads) {
  std::vector<float> t, u, v;
  std::vector<uint32_t> primitive;
  AllHits found;
  {
    nb::gil_scoped_release release;
    found = all_hits(bvh, input.view(), max_hits, {mask, cull}, threads);
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

using ClosestTuple =
    nb::typed<nb::tuple, Array<float>, Array<float>, Array<int32_t>, Array<float>, Array<float>>;

ClosestTuple closest_points(const TriangleBvh& bvh, const Rows<float, 3>& points,
                            float max_distance, uint32_t threads) {
  const auto given = rows_of<Vec3>(points);
  std::vector<Vec3> point(given.size());
  std::vector<float> distance(given.size()), u(given.size()), v(given.size());
  std::vector<uint32_t> primitive(given.size());
  std::vector<ClosestPoint> found(std::min(given.size(), kSlice));
  sliced(given.size(), [&](size_t begin, size_t n) {
    bvh.closest_point(given.subspan(begin, n), std::span(found).first(n), max_distance, threads);
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

Array<bool> contains_points(const TriangleBvh& bvh, const Rows<float, 3>& points,
                            uint32_t threads) {
  const auto given = rows_of<Vec3>(points);
  std::vector<uint8_t> results(given.size());
  sliced(given.size(), [&](size_t begin, size_t n) {
    bvh.contains(given.subspan(begin, n), std::span(results).subspan(begin, n), threads);
  });
  return bools(std::move(results));
}

Array<float> signed_distances(const TriangleBvh& bvh, const Rows<float, 3>& points,
                              uint32_t threads) {
  const auto given = rows_of<Vec3>(points);
  std::vector<float> results(given.size());
  sliced(given.size(), [&](size_t begin, size_t n) {
    bvh.signed_distance(given.subspan(begin, n), std::span(results).subspan(begin, n), threads);
  });
  return take_as(std::move(results));
}

template <typename Region>
Array<int32_t> overlapping(const TriangleBvh& bvh, const Region& region) {
  std::vector<uint32_t> found;
  {
    nb::gil_scoped_release release;
    found = bvh.overlaps(region);
  }
  return signed_indices(std::move(found));
}

Dict statistics_dict(const bvh::Statistics& s) {
  Dict result;
  result["nodes"] = s.nodes;
  result["leaves"] = s.leaves;
  result["max_depth"] = s.max_depth;
  result["references"] = s.references;
  result["sah_cost"] = s.sah_cost;
  result["bytes"] = s.bytes;
  return result;
}

Dict statistics_dict(const TriangleBvhStatistics& s) {
  Dict result;
  result["width"] = s.width;
  result["nodes"] = s.nodes;
  result["leaves"] = s.leaves;
  result["max_depth"] = s.max_depth;
  result["references"] = s.references;
  result["sah_cost"] = s.sah_cost;
  result["bytes"] = s.bytes;
  return result;
}

std::vector<std::string> builder_names() {
  std::vector<std::string> names;
  for (const bvh::Builder builder : bvh::builders()) names.emplace_back(bvh::name(builder));
  return names;
}

void bind_config(nb::module_& module) {
  using bvh::Config;
  nb::class_<Config> config(module, "BvhConfig", "How a tree is built.");
  config.def(nb::init<>())
      .def_prop_rw(
          "builder", [](const Config& c) { return std::string(bvh::name(c.builder)); },
          [](Config& c, const std::string& name) { c.builder = bvh::builder_by_name(name); })
      .def_prop_rw(
          "cost", [](const Config& c) { return std::tuple{c.cost.traversal, c.cost.intersection}; },
          [](Config& c, const std::tuple<float, float>& cost) {
            c.cost = {std::get<0>(cost), std::get<1>(cost)};
          })
      .def_prop_rw(
          "drop_invalid", [](const Config& c) { return c.invalid == bvh::InvalidTriangles::kDrop; },
          [](Config& c, bool drop) {
            c.invalid = drop ? bvh::InvalidTriangles::kDrop : bvh::InvalidTriangles::kRefuse;
          })
      .def_rw("max_leaf_size", &Config::max_leaf_size)
      .def_rw("max_depth", &Config::max_depth)
      .def_rw("bins", &Config::bins)
      .def_rw("spatial_budget", &Config::spatial_budget)
      .def_rw("spatial_overlap", &Config::spatial_overlap)
      .def_rw("morton_bits", &Config::morton_bits)
      .def_rw("hlbvh_bits", &Config::hlbvh_bits)
      .def_rw("ploc_radius", &Config::ploc_radius)
      .def_rw("treelet_size", &Config::treelet_size)
      .def_rw("treelet_rounds", &Config::treelet_rounds)
      .def_rw("reinsertion_rounds", &Config::reinsertion_rounds)
      .def_prop_rw(
          "manhattan",
          [](const Config& c) { return c.kmeans.distance == bvh::KmeansDistance::kManhattan; },
          [](Config& c, bool manhattan) {
            c.kmeans.distance =
                manhattan ? bvh::KmeansDistance::kManhattan : bvh::KmeansDistance::kEuclidean;
          });
  const auto define = [&](const char* name, auto of) {
    using Value = std::remove_reference_t<decltype(of(std::declval<Config&>()))>;
    config.def_prop_rw(
        name, [of](Config& c) { return of(c); }, [of](Config& c, Value value) { of(c) = value; });
  };
  define("clusters", [](Config& c) -> uint32_t& { return c.kmeans.clusters; });
  define("candidates", [](Config& c) -> uint32_t& { return c.kmeans.candidates; });
  define("iterations", [](Config& c) -> uint32_t& { return c.kmeans.iterations; });
  define("aac_leaf_size", [](Config& c) -> uint32_t& { return c.aac.leaf_size; });
  define("aac_epsilon", [](Config& c) -> float& { return c.aac.epsilon; });
  module.def(
      "bvh_preset", [](const std::string& name) { return bvh::preset(name); }, "name"_a,
      "The config called fast, quality or best.");
  module.def(
      "bvh_builder_preset", [](const std::string& name) { return bvh::builder_preset(name); },
      "name"_a, "A builder with its defaults, or with settings that have a name.");
  module.def("bvh_builders", &builder_names, "The names of all builders.");
}

void bind_tree(nb::module_& module) {
  using bvh::Bvh2;
  nb::class_<Bvh2>(module, "Bvh2", "A binary tree over boxes.")
      .def_prop_ro("nodes",
                   [](nb::handle self) {
                     const auto& tree = nb::cast<const Bvh2&>(self);
                     return array_over<const uint32_t>(std::span<const bvh::Node>(tree.nodes),
                                                       self);
                   })
      .def_prop_ro("primitives",
                   [](nb::handle self) {
                     const auto& tree = nb::cast<const Bvh2&>(self);
                     return array_over<const uint32_t>(std::span<const uint32_t>(tree.primitives),
                                                       self);
                   })
      .def(
          "statistics",
          [](const Bvh2& tree, float traversal, float intersection) {
            return statistics_dict(bvh::statistics(tree, {traversal, intersection}));
          },
          "traversal"_a, "intersection"_a)
      .def(
          "end_point_overlap",
          [](const Bvh2& tree, const MeshArrays& mesh, float traversal, float intersection,
             uint32_t threads) {
            return run(nb::none(), threads, [&](const BuildOptions& options) {
              return bvh::end_point_overlap(tree, mesh.view(), {traversal, intersection}, options);
            });
          },
          "mesh"_a, "traversal"_a, "intersection"_a, "threads"_a = 0);
  module.def(
      "build_bvh2_boxes",
      [](const Rows<float, 6>& boxes, const bvh::Config& config, const nb::object& progress,
         uint32_t threads) {
        return run(progress, threads, [&](const BuildOptions& options) {
          return bvh::build(rows_of<Aabb>(boxes), config, options);
        });
      },
      "boxes"_a, "config"_a, "progress"_a = nb::none(), "threads"_a = 0);
  module.def(
      "build_bvh2_mesh",
      [](const MeshArrays& mesh, const bvh::Config& config, const nb::object& progress,
         uint32_t threads) {
        return run(progress, threads, [&](const BuildOptions& options) {
          return bvh::build(mesh.view(), config, options);
        });
      },
      "mesh"_a, "config"_a, "progress"_a = nb::none(), "threads"_a = 0);
}

TriangleBvhConfig triangle_config(const bvh::Config& tree, uint32_t width, bool compact,
                                  const std::string& simd) {
  TriangleBvhConfig config;
  config.tree = tree;
  config.width = width;
  config.compact = compact;
  constexpr std::pair<std::string_view, Simd> kNames[] = {{"auto", Simd::kAuto},
                                                          {"portable", Simd::kPortable},
                                                          {"avx2", Simd::kAvx2},
                                                          {"avx512", Simd::kAvx512}};
  for (const auto& [name, value] : kNames)
    if (name == simd) {
      config.simd = value;
      return config;
    }
  throw Error(ErrorCode::kInvalidArgument,
              "simd must be auto, portable, avx2 or avx512, not " + simd);
}

void bind_builds(nb::class_<TriangleBvh>& bvh) {
  bvh.def_static(
         "build",
         [](const MeshArrays& mesh, const bvh::Config& tree, uint32_t width, bool compact,
            const std::string& simd, const std::optional<Flat<uint32_t>>& masks,
            const nb::object& progress, uint32_t threads) {
           const TriangleBvhConfig config = triangle_config(tree, width, compact, simd);
           return run(progress, threads, [&](const BuildOptions& options) {
             return TriangleBvh::build(mesh.view(), config, rows_of<uint32_t>(masks), options);
           });
         },
         "mesh"_a, "config"_a, "width"_a, "compact"_a, "simd"_a, "masks"_a = nb::none(),
         "progress"_a = nb::none(), "threads"_a = 0)
      .def_static(
          "widen",
          [](const bvh::Bvh2& given, const MeshArrays& mesh, const bvh::Config& tree,
             uint32_t width, bool compact, const std::string& simd,
             const std::optional<Flat<uint32_t>>& masks, const nb::object& progress,
             uint32_t threads) {
            const TriangleBvhConfig config = triangle_config(tree, width, compact, simd);
            return run(progress, threads, [&](const BuildOptions& options) {
              return TriangleBvh::widen(given, mesh.view(), config, rows_of<uint32_t>(masks),
                                        options);
            });
          },
          "tree"_a, "mesh"_a, "config"_a, "width"_a, "compact"_a, "simd"_a, "masks"_a = nb::none(),
          "progress"_a = nb::none(), "threads"_a = 0)
      .def_static(
          "load",
          [](const std::string& path, const std::string& simd) {
            const Simd wanted = triangle_config({}, 8, false, simd).simd;
            nb::gil_scoped_release release;
            return TriangleBvh::load(path, wanted);
          },
          "path"_a, "simd"_a = "auto")
      .def(
          "save",
          [](const TriangleBvh& self, const std::string& path) {
            nb::gil_scoped_release release;
            self.save(path);
          },
          "path"_a)
      .def(
          "refit",
          [](TriangleBvh& self, const MeshArrays& mesh, const nb::object& progress,
             uint32_t threads) {
            const RefitReport report = run(progress, threads, [&](const BuildOptions& options) {
              return self.refit(mesh.view(), options);
            });
            return std::tuple{report.sah_cost, report.built_sah_cost, report.rebuild_advised};
          },
          "mesh"_a, "progress"_a = nb::none(), "threads"_a = 0,
          "(sah_cost, built_sah_cost, rebuild_advised)");
}

void bind_queries(nb::class_<TriangleBvh>& bvh) {
  const auto define = [&](const char* name, auto&& function) {
    bvh.def(
        name,
        [function](const TriangleBvh& self, Rows<float, 3> origins, Rows<float, 3> directions,
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
  bvh.def(
         "all_hits",
         [](const TriangleBvh& self, Rows<float, 3> origins, Rows<float, 3> directions,
            FlatFloats t_min, FlatFloats t_max, size_t max_hits, uint32_t mask,
            bool cull_back_faces, uint32_t threads) {
           return all_hits_of(self,
                              RayInput{std::move(origins), std::move(directions), std::move(t_min),
                                       std::move(t_max)},
                              max_hits, mask, cull_back_faces, threads);
         },
         "origins"_a, "directions"_a, "t_min"_a = nb::none(), "t_max"_a = nb::none(),
         "max_hits"_a = 0, "mask"_a = 0xffffffffu, "cull_back_faces"_a = false, "threads"_a = 0)
      .def("closest_point", &closest_points, "points"_a, "max_distance"_a, "threads"_a = 0)
      .def("contains", &contains_points, "points"_a, "threads"_a = 0)
      .def("signed_distance", &signed_distances, "points"_a, "threads"_a = 0)
      .def(
          "overlaps_box",
          [](const TriangleBvh& self, const std::array<float, 3>& low,
             const std::array<float, 3>& high) {
            return overlapping(self, Aabb{{low[0], low[1], low[2]}, {high[0], high[1], high[2]}});
          },
          "min"_a, "max"_a)
      .def(
          "overlaps_sphere",
          [](const TriangleBvh& self, const std::array<float, 3>& center, float radius) {
            return overlapping(self, Sphere{{center[0], center[1], center[2]}, radius});
          },
          "center"_a, "radius"_a)
      .def(
          "overlaps_frustum",
          [](const TriangleBvh& self,
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

void bind_bvh(nb::module_& module) {
  bind_config(module);
  bind_tree(module);
  nb::class_<TriangleBvh> bvh(module, "TriangleBvh", "A hierarchy over triangles.");
  bind_builds(bvh);
  bind_queries(bvh);
  bvh.def("statistics", [](const TriangleBvh& self) { return statistics_dict(self.statistics()); })
      .def_prop_ro("bounds",
                   [](const TriangleBvh& self) {
                     const Aabb box = self.bounds();
                     return std::tuple{std::array{box.min.x, box.min.y, box.min.z},
                                       std::array{box.max.x, box.max.y, box.max.z}};
                   })
      .def_prop_ro("triangle_count", &TriangleBvh::triangle_count);
}

}  // namespace umbel::python
