// Binary trees from every builder, and hierarchies over triangles that answer rays, distances and
// overlaps.
#include "umbel/bvh.hpp"

#include <nanobind/stl/vector.h>

#include "bind.hpp"
#include "umbel/bvh_presets.hpp"
#include "umbel/collision.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::python {
namespace {

Dict statistics_dict(const bvh::Statistics& s) {
  Dict result;
  PUT_FIELDS(result, s, nodes, leaves, max_depth, references, sah_cost, bytes);
  return result;
}

Dict statistics_dict(const BvhStatistics& s) {
  Dict result;
  PUT_FIELDS(result, s, width, nodes, leaves, max_depth, references, sah_cost, bytes);
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
      .def_rw("ploc_sweep", &Config::ploc_sweep)
      .def_rw("atrbvh_bits", &Config::atrbvh_bits)
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
  define("forwarded_clusters", [](Config& c) -> uint32_t& { return c.kmeans.forwarded_clusters; });
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

Dict kmeans_times(const MeshArrays& mesh, const bvh::Config& config, const nb::object& progress) {
  std::vector<std::pair<std::string, double>> stages;
  run(progress, 1, [&](const BuildOptions& options) {
    bvh::build(mesh.view(), config, options, [&](std::string_view stage, double seconds) {
      stages.emplace_back(stage, seconds);
    });
  });
  Dict result;
  for (const auto& [stage, seconds] : stages) result[stage.c_str()] = seconds;
  return result;
}

/// The tables and statistics that binary trees and trees of many children share.
template <typename Tree, typename Node>
nb::class_<Tree> tree_class(nb::module_& module, const char* name, const char* what) {
  return nb::class_<Tree>(module, name, what)
      .def_prop_ro("nodes",
                   [](nb::handle self) {
                     const auto& tree = nb::cast<const Tree&>(self);
                     return array_over<const uint32_t>(std::span<const Node>(tree.nodes), self);
                   })
      .def_prop_ro("primitives",
                   [](nb::handle self) {
                     const auto& tree = nb::cast<const Tree&>(self);
                     return array_over<const uint32_t>(std::span<const uint32_t>(tree.primitives),
                                                       self);
                   })
      .def(
          "statistics",
          [](const Tree& tree, float traversal, float intersection) {
            return statistics_dict(bvh::statistics(tree, {traversal, intersection}));
          },
          "traversal"_a, "intersection"_a);
}

/// Functions `NAME_boxes` and `NAME_mesh`, that build by `build(boxes or mesh, config, options)`.
template <typename Build>
void bind_builder(nb::module_& module, const std::string& name, Build build) {
  module.def((name + "_boxes").c_str(),
             [build](const Rows<float, 6>& boxes, const bvh::Config& config,
                     const nb::object& progress, uint32_t threads) {
               return run(progress, threads, [&](const BuildOptions& options) {
                 return build(rows_of<Aabb>(boxes), config, options);
               });
             },
             "boxes"_a, "config"_a, "progress"_a = nb::none(), "threads"_a = 0);
  module.def((name + "_mesh").c_str(),
             [build](const MeshArrays& mesh, const bvh::Config& config, const nb::object& progress,
                     uint32_t threads) {
               return run(progress, threads, [&](const BuildOptions& options) {
                 return build(mesh.view(), config, options);
               });
             },
             "mesh"_a, "config"_a, "progress"_a = nb::none(), "threads"_a = 0);
}

void bind_tree(nb::module_& module) {
  using bvh::Bvh2;
  tree_class<Bvh2, bvh::Node>(module, "Bvh2", "A binary tree over boxes.")
      .def(
          "end_point_overlap",
          [](const Bvh2& tree, const MeshArrays& mesh, float traversal, float intersection,
             uint32_t threads) {
            return run(nb::none(), threads, [&](const BuildOptions& options) {
              return bvh::end_point_overlap(tree, mesh.view(), {traversal, intersection}, options);
            });
          },
          "mesh"_a, "traversal"_a, "intersection"_a, "threads"_a = 0);
  bind_builder(module, "build_bvh2",
               [](const auto& input, const bvh::Config& config, const BuildOptions& options) {
                 return bvh::build(input, config, options);
               });
  module.def("kmeans_times", &kmeans_times, "mesh"_a, "config"_a, "progress"_a = nb::none(),
             "Seconds of each stage of a build on one thread.");
}

void bind_kary(nb::module_& module) {
  tree_class<bvh::KaryTree, bvh::KaryNode>(module, "KaryTree",
                                           "A tree with up to 64 children a node.");
  bind_builder(module, "build_kary",
               [](const auto& input, const bvh::Config& config, const BuildOptions& options) {
                 return bvh::build_kmeans_kary(input, config, options);
               });
}

BvhConfig triangle_config(const bvh::Config& tree, uint32_t width, bool compact,
                          const std::string& simd) {
  BvhConfig config;
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

template <typename Tree>
Bvh widen(const Tree& given, const MeshArrays& mesh, const bvh::Config& tree, uint32_t width,
          bool compact, const std::string& simd, const std::optional<Flat<uint32_t>>& masks,
          const nb::object& progress, uint32_t threads) {
  const BvhConfig config = triangle_config(tree, width, compact, simd);
  return run(progress, threads, [&](const BuildOptions& options) {
    return Bvh::widen(given, mesh.view(), config, rows_of<uint32_t>(masks), options);
  });
}

void bind_builds(nb::class_<Bvh, TriangleQueries>& bvh) {
  bvh.def_static(
         "build",
         [](const MeshArrays& mesh, const bvh::Config& tree, uint32_t width, bool compact,
            const std::string& simd, const std::optional<Flat<uint32_t>>& masks,
            const nb::object& progress, uint32_t threads) {
           const BvhConfig config = triangle_config(tree, width, compact, simd);
           return run(progress, threads, [&](const BuildOptions& options) {
             return Bvh::build(mesh.view(), config, rows_of<uint32_t>(masks), options);
           });
         },
         "mesh"_a, "config"_a, "width"_a, "compact"_a, "simd"_a, "masks"_a = nb::none(),
         "progress"_a = nb::none(), "threads"_a = 0)
      .def_static("widen", &widen<bvh::Bvh2>, "tree"_a, "mesh"_a, "config"_a, "width"_a,
                  "compact"_a, "simd"_a, "masks"_a = nb::none(), "progress"_a = nb::none(),
                  "threads"_a = 0)
      .def_static("widen", &widen<bvh::KaryTree>, "tree"_a, "mesh"_a, "config"_a, "width"_a,
                  "compact"_a, "simd"_a, "masks"_a = nb::none(), "progress"_a = nb::none(),
                  "threads"_a = 0)
      .def_static(
          "load",
          [](const std::filesystem::path& path, const std::string& simd) {
            const Simd wanted = triangle_config({}, 8, false, simd).simd;
            nb::gil_scoped_release release;
            return Bvh::load(path.string(), wanted);
          },
          "path"_a, "simd"_a = "auto",
          nb::sig("def load(path: str | os.PathLike[str], simd: str = 'auto') -> Bvh"))
      .def(
          "save",
          [](const Bvh& self, const std::filesystem::path& path) {
            nb::gil_scoped_release release;
            self.save(path.string());
          },
          "path"_a, nb::sig("def save(self, path: str | os.PathLike[str]) -> None"))
      .def(
          "refit",
          [](Bvh& self, const MeshArrays& mesh, const nb::object& progress, uint32_t threads) {
            const RefitReport report = run(progress, threads, [&](const BuildOptions& options) {
              return self.refit(mesh.view(), options);
            });
            return std::tuple{report.sah_cost, report.built_sah_cost, report.rebuild_advised};
          },
          "mesh"_a, "progress"_a = nb::none(), "threads"_a = 0,
          "(sah_cost, built_sah_cost, rebuild_advised)");
}

/// With the progress of a run that has no function to call, so that an interrupt ends it.
CollisionOptions collision_options(const std::array<double, 12>& second_to_first,
                                   const BuildOptions& options) {
  CollisionOptions how;
  how.second_to_first = second_to_first;
  how.threads = options.threads;
  how.progress = options.progress;
  return how;
}

void bind_collisions(nb::class_<Bvh, TriangleQueries>& bvh) {
  bvh.def(
         "collide",
         [](const Bvh& self, const Bvh& other, const std::array<double, 12>& rows,
            uint32_t threads) {
           auto pairs = run(nb::none(), threads, [&](const BuildOptions& options) {
             return collide(self, other, collision_options(rows, options));
           });
           return take<int32_t>(std::move(pairs));
         },
         "other"_a, "second_to_first"_a, "threads"_a = 0)
      .def(
          "collides",
          [](const Bvh& self, const Bvh& other, const std::array<double, 12>& rows,
             uint32_t threads) {
            return run(nb::none(), threads, [&](const BuildOptions& options) {
              return collides(self, other, collision_options(rows, options));
            });
          },
          "other"_a, "second_to_first"_a, "threads"_a = 0);
}

}  // namespace

void bind_bvh(nb::module_& module) {
  bind_config(module);
  bind_tree(module);
  bind_kary(module);
  nb::class_<Bvh, TriangleQueries> bvh(module, "Bvh", "A hierarchy over triangles.");
  bind_builds(bvh);
  bind_collisions(bvh);
  bvh.def("statistics", [](const Bvh& self) { return statistics_dict(self.statistics()); });
}

}  // namespace umbel::python
