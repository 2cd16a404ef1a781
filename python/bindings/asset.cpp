// .umbel files: opening, reading cuts, proving.
#include "umbel/asset.hpp"

#include "lod.hpp"

namespace umbel::python {
namespace {

nb::object tuple_of(const Vec3& v) { return nb::make_tuple(v.x, v.y, v.z); }

Dict info_dict(const AssetInfo& info) {
  Dict result;
  result["format_version"] =
      std::to_string(info.version_major) + "." + std::to_string(info.version_minor);
  result["file_bytes"] = info.file_bytes;
  result["pages"] = info.pages;
  result["normals"] = info.normals;
  result["tangents"] = info.tangents;
  result["uvs"] = info.uvs;
  result["colors"] = info.colors;
  result["position_step"] = info.position_step;
  result["uv_step"] = info.uv_step;
  result["normal_bits"] = info.normal_bits;
  result["tangent_bits"] = info.tangent_bits;
  result["color_bits"] = info.color_bits;
  const bool empty = info.bounds.min.x > info.bounds.max.x;
  result["bounds"] =
      empty ? nb::object(nb::none())
            : nb::object(nb::make_tuple(tuple_of(info.bounds.min), tuple_of(info.bounds.max)));
  result["source_triangles"] = info.source_triangles;
  result["source_vertices"] = info.source_vertices;
  result["source_digest"] = info.source_digest;
  result["max_triangles"] = info.max_triangles;
  result["max_vertices"] = info.max_vertices;
  result["metadata"] = info.metadata;
  return result;
}

}  // namespace

void bind_asset(nb::module_& module) {
  nb::class_<Asset>(module, "Asset", "An open .umbel file.")
      .def(
          "__init__",
          [](Asset* self, const std::filesystem::path& path) {
            nb::gil_scoped_release release;
            new (self) Asset(path);
          },
          "path"_a, nb::sig("def __init__(self, path: str | os.PathLike[str]) -> None"))
      .def_prop_ro("info", [](const Asset& asset) { return info_dict(asset.info()); })
      .def_prop_ro(
          "tables", [](const Asset& asset) -> const lod::Tables& { return asset.tables(); },
          nb::rv_policy::reference_internal)
      .def(
          "geometry",
          [](const Asset& asset, uint32_t cluster) {
            check_cut(asset.tables(), {&cluster, 1});
            return geometry_dict(asset.geometry(cluster));
          },
          "cluster"_a)
      .def(
          "mesh",
          [](const Asset& asset, const Flat<uint32_t>& cut) {
            return cut_dict(
                asset.tables(), [&](uint32_t cluster) { return asset.geometry(cluster); }, cut);
          },
          "cut"_a)
      .def(
          "facing",
          [](const Asset& asset, const nb::object& progress, uint32_t threads) {
            return facing_array(
                asset.tables(), [&](uint32_t cluster) { return asset.geometry(cluster); }, progress,
                threads);
          },
          "progress"_a = nb::none(), "threads"_a = 0);
  module.def(
      "verify_asset",
      [](const std::filesystem::path& path, uint32_t cuts, uint32_t seed,
         const nb::object& progress, uint32_t threads) {
        return report_dict(run(progress, threads, [&](const BuildOptions& options) {
          return verify_asset(path, cuts, seed, options);
        }));
      },
      "path"_a, "cuts"_a = 64, "seed"_a = 1, "progress"_a = nb::none(), "threads"_a = 0,
      nb::sig("def verify_asset(path: str | os.PathLike[str], cuts: int = 64, seed: int = 1, "
              "progress: object | None = None, threads: int = 0) -> dict[str, typing.Any]"));
}

}  // namespace umbel::python
