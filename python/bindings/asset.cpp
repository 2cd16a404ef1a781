// .umbel files: opening, reading cuts, proving.
#include "umbel/asset.hpp"

#include <cstring>

#include "base/progress.hpp"
#include "lod.hpp"

namespace umbel::python {
namespace {

nb::object tuple_of(const Vec3& v, const Vec3d& origin = {}) {
  return nb::make_tuple(origin.x + v.x, origin.y + v.y, origin.z + v.z);
}

Dict info_dict(const Asset& asset) {
  const AssetInfo& info = asset.info();
  // Instances say where meshes are, and without them the origin alone.
  const Vec3d shift = asset.instances().empty() ? info.origin : Vec3d{};
  Dict result;
  result["format_version"] =
      std::to_string(info.version_major) + "." + std::to_string(info.version_minor);
  PUT_FIELDS(result, info, file_bytes, header_bytes, checksum, pages, page_bytes, normals, tangents,
             uvs, colors, position_step, uv_step, normal_bits, tangent_bits, color_bits);
  const bool empty = info.bounds.min.x > info.bounds.max.x;
  result["bounds"] = empty ? nb::object(nb::none())
                           : nb::object(nb::make_tuple(tuple_of(info.bounds.min, shift),
                                                       tuple_of(info.bounds.max, shift)));
  result["origin"] = nb::make_tuple(info.origin.x, info.origin.y, info.origin.z);
  PUT_FIELDS(result, info, source_triangles, source_vertices, source_digest, max_triangles,
             max_vertices, metadata);
  return result;
}

/// Bytes that a Python callable gives: read(offset, size) -> bytes.
class PythonSource : public ByteSource {
 public:
  PythonSource(uint64_t size, nb::object read) : size_(size), read_(std::move(read)) {}
  PythonSource(const PythonSource&) = delete;
  ~PythonSource() override {
    const nb::gil_scoped_acquire acquire;
    read_.reset();
  }
  nb::handle callable() const { return read_; }
  uint64_t size() const override { return size_; }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    const nb::gil_scoped_acquire acquire;
    std::string problem;
    try {
      const nb::object answer = read_(offset, out.size());
      const nb::bytes bytes(answer);
      if (bytes.size() == out.size()) {
        if (!out.empty()) std::memcpy(out.data(), bytes.data(), out.size());
        return;
      }
      problem = "gave " + std::to_string(bytes.size()) + " bytes";
    } catch (const nb::python_error& error) {
      problem = "failed: " + sentence_of(error);
    } catch (const std::exception& error) {
      problem = std::string("failed: ") + error.what();
    }
    throw Error(ErrorCode::kIo, "reading " + std::to_string(out.size()) + " bytes at byte " +
                                    std::to_string(offset) + " " + problem);
  }

 private:
  uint64_t size_;
  nb::object read_;
};

/// An asset of bytes that Python gives.
class SourceAsset : public Asset {
 public:
  SourceAsset(std::shared_ptr<const PythonSource> source, std::string name)
      : Asset(source, std::move(name)), source_(std::move(source)) {}
  nb::handle held() const { return source_->callable(); }

 private:
  std::shared_ptr<const PythonSource> source_;
};

/// Tables that may have to be read, for which other threads may need the GIL.
const lod::Tables& tables_of(const Asset& asset, uint32_t mesh) {
  const nb::gil_scoped_release release;
  return asset.tables(mesh);
}

/// They keep the asset's object where the collector sees it.
nb::typed<nb::object, lod::Tables> tables_object(nb::handle_t<Asset> asset, uint32_t mesh) {
  nb::object tables =
      nb::cast(tables_of(nb::cast<const Asset&>(asset), mesh), nb::rv_policy::reference);
  tables.attr("asset") = asset;
  return nb::borrow<nb::typed<nb::object, lod::Tables>>(tables);
}

Array<float> transforms_of(const Asset& asset) {
  std::vector<std::array<float, 12>> rows;
  for (const Instance& instance : asset.instances()) rows.push_back(instance.transform.rows);
  return take<float>(std::move(rows));
}

Array<uint32_t> instance_meshes_of(const Asset& asset) {
  std::vector<uint32_t> meshes;
  for (const Instance& instance : asset.instances()) meshes.push_back(instance.mesh);
  return take<uint32_t>(std::move(meshes));
}

nb::typed<nb::list, Dict> meshes_of(const Asset& asset) {
  nb::typed<nb::list, Dict> list;
  for (const AssetMesh& mesh : asset.meshes()) {
    Dict entry;
    const bool empty = mesh.bounds.min.x > mesh.bounds.max.x;
    entry["bounds"] =
        empty ? nb::object(nb::none())
              : nb::object(nb::make_tuple(tuple_of(mesh.bounds.min), tuple_of(mesh.bounds.max)));
    PUT_FIELDS(entry, mesh, source_triangles, source_vertices, source_digest, groups, clusters,
               normals, tangents, uvs, colors);
    entry["levels"] = asset.levels(static_cast<uint32_t>(&mesh - asset.meshes().data())).size();
    list.append(entry);
  }
  return list;
}

/// A cut as a walk has found it.
struct FoundCut {
  uint32_t mesh;
  std::vector<CutCluster> clusters;
  WalkReport report;
};

FoundCut find_cut(const Asset& asset, const lod::View& view, uint32_t mesh,
                  const std::optional<Rows<float, 4>>& planes) {
  const nb::gil_scoped_release release;
  FoundCut found{mesh, {}, {}};
  found.clusters = clusters_of_cut(asset, view, mesh, rows_of<Plane>(planes), &found.report);
  return found;
}

/// The boxes and triangle counts of a cut's clusters, read page by page.
std::tuple<Array<float>, Array<uint32_t>> cut_boxes(const Asset& asset, const lod::View& view,
                                                    uint32_t mesh) {
  std::vector<float> boxes;
  std::vector<uint32_t> triangles;
  {
    const nb::gil_scoped_release release;
    asset.walk(
        view,
        [&](const CutGroup& group) {
          for (const uint32_t c : group.clusters) {
            const lod::Cluster& cluster = group.page.groups[group.index].clusters[c];
            const auto& [low, high] = cluster.box;
            boxes.insert(boxes.end(), {low.x, low.y, low.z, high.x, high.y, high.z});
            triangles.push_back(cluster.triangle_count);
          }
        },
        mesh);
  }
  return {take<float>(std::move(boxes)), take<uint32_t>(std::move(triangles))};
}

lod::View find_view(const Asset& asset, const lod::View& view, uint64_t triangles,
                    const Flat<uint32_t>& meshes, const Rows<float, 12>& transforms) {
  const auto rows = rows_of<std::array<float, 12>>(transforms);
  const auto indices = rows_of<uint32_t>(meshes);
  std::vector<Instance> instances;
  for (size_t i = 0; i < std::min(rows.size(), indices.size()); ++i)
    instances.push_back({indices[i], rows[i]});
  const nb::gil_scoped_release release;
  return view_for_triangles(asset, view, triangles, instances);
}

Dict mesh_of_found(const Asset& asset, const FoundCut& found) {
  return dict_of(interruptible([&] { return mesh_of_clusters(asset, found.clusters); }));
}

nb::typed<nb::list, Dict> summaries_of(const Asset& asset, const nb::object& progress) {
  nb::typed<nb::list, Dict> list;
  for (const MeshSummary& mesh :
       run(progress, 1, [&](const BuildOptions& options) { return summarize(asset, options); })) {
    Dict entry;
    PUT_FIELDS(entry, mesh, triangles, root_groups, root_clusters, root_triangles, max_triangles,
               max_vertices, max_material);
    list.append(entry);
  }
  return list;
}

/// Bits of normals, tangents and colours, and the step of texture coordinates.
using AttributePrecision = std::tuple<uint32_t, uint32_t, uint32_t, float>;

uint64_t write(const std::filesystem::path& path, const nb::typed<nb::list, lod::Dag>& dags,
               const std::string& metadata, const std::string& materials,
               const Flat<uint32_t>& first_materials, const nb::typed<nb::list, nb::bytes>& files,
               const Flat<uint32_t>& instance_meshes, const Rows<float, 12>& transforms,
               const AttributePrecision& precision, uint32_t page_bytes, const nb::object& progress,
               uint32_t threads, const std::array<double, 3>& origin, const std::string& scene) {
  AssetContents contents;
  for (const nb::handle dag : dags) contents.meshes.push_back(nb::cast<const lod::Dag*>(dag));
  contents.metadata = metadata;
  contents.materials = materials;
  contents.origin = {origin[0], origin[1], origin[2]};
  contents.scene = scene;
  const auto firsts = rows_of<uint32_t>(first_materials);
  contents.first_materials.assign(firsts.begin(), firsts.end());
  for (const nb::handle file : files) {
    const auto bytes = nb::cast<nb::bytes>(file);
    const auto* first = static_cast<const std::byte*>(bytes.data());
    contents.files.emplace_back(first, first + bytes.size());
  }
  const auto rows = rows_of<std::array<float, 12>>(transforms);
  const auto meshes = rows_of<uint32_t>(instance_meshes);
  if (rows.size() != meshes.size())
    throw Error(ErrorCode::kInvalidArgument, "there must be a transform for each of the " +
                                                 std::to_string(meshes.size()) +
                                                 " instances, not " + std::to_string(rows.size()));
  for (size_t i = 0; i < rows.size(); ++i) contents.instances.push_back({meshes[i], rows[i]});
  AssetConfig config;
  std::tie(config.normal_bits, config.tangent_bits, config.color_bits, config.uv_step) = precision;
  config.page_bytes = page_bytes;
  return run(progress, threads, [&](const BuildOptions& options) {
    return write_asset(path, contents, options, config);
  });
}

/// Whether every checksum holds. Throws kCorrupt for what cannot be read at all.
bool is_whole(const Asset& asset, const BuildOptions& options) {
  Progress progress(options);
  if (!asset.header_is_whole()) return false;
  for (uint32_t page = 0; page < asset.info().pages; ++page) {
    progress.report(0, "reading pages");
    if (!asset.page_is_whole(page)) return false;
  }
  for (uint32_t mesh = 0; mesh < asset.meshes().size(); ++mesh) {
    asset.nodes(mesh);
    asset.refinement(0, mesh);
  }
  for (uint32_t file = 0; file < asset.files(); ++file) asset.file(file);
  if (asset.has_instance_tree())
    for (uint32_t node = 0; node < asset.instance_nodes().size(); ++node) asset.placements(node);
  return true;
}

}  // namespace

/// Over 60 lines: a list of methods.
void bind_asset(nb::module_& module) {
  nb::class_<FoundCut>(module, "FoundCut", "A cut, and where its clusters are in the file.")
      .def("clusters",
           [](const FoundCut& found) {
             std::vector<uint32_t> ids;
             for (const CutCluster& cluster : found.clusters) ids.push_back(cluster.id);
             return take<uint32_t>(std::move(ids));
           })
      .def_prop_ro("triangles", [](const FoundCut& found) { return found.report.triangles; })
      .def_prop_ro("error", [](const FoundCut& found) { return found.report.error; })
      .def_prop_ro("pages", [](const FoundCut& found) { return found.report.pages; })
      .def_prop_ro("cut_pages", [](const FoundCut& found) { return found.report.cut_pages; });
  nb::class_<Asset>(module, "Asset", "An open .umbel file.")
      .def(
          "__init__",
          [](Asset* self, const std::filesystem::path& path) {
            nb::gil_scoped_release release;
            new (self) Asset(path);
          },
          "path"_a, nb::sig("def __init__(self, path: str | os.PathLike[str]) -> None"))
      .def_prop_ro("info", [](const Asset& asset) { return info_dict(asset); })
      .def_prop_ro("meshes", &meshes_of)
      .def("page_sizes",
           [](const Asset& asset) {
             std::vector<uint32_t> sizes(asset.info().pages);
             {
               const nb::gil_scoped_release release;
               for (uint32_t p = 0; p < sizes.size(); ++p) sizes[p] = asset.page_bytes(p);
             }
             return take<uint32_t>(std::move(sizes));
           })
      .def("transforms", &transforms_of)
      .def("instance_meshes", &instance_meshes_of)
      .def_prop_ro("materials", [](const Asset& asset) { return asset.materials(); })
      .def_prop_ro("scene", [](const Asset& asset) { return asset.scene(); })
      .def("is_whole",
           [](const Asset& asset) {
             // Without a function to call, so that an interrupt ends it.
             return run(nb::none(), 1,
                        [&](const BuildOptions& options) { return is_whole(asset, options); });
           })
      .def_prop_ro("files", &Asset::files)
      .def(
          "file",
          [](const Asset& asset, uint32_t index) {
            std::vector<std::byte> bytes;
            {
              const nb::gil_scoped_release release;
              bytes = asset.file(index);
            }
            return nb::bytes(bytes.data(), bytes.size());
          },
          "index"_a)
      .def("find_cut", &find_cut, "view"_a, "mesh"_a = 0, "planes"_a = nb::none())
      .def("cut_boxes", &cut_boxes, "view"_a, "mesh"_a = 0)
      .def("view_for_triangles", &find_view, "view"_a, "triangles"_a, "meshes"_a, "transforms"_a)
      .def("found_mesh", &mesh_of_found, "found"_a)
      .def("summaries", &summaries_of, "progress"_a = nb::none())
      .def_prop_ro("tables", [](nb::handle_t<Asset> asset) { return tables_object(asset, 0); })
      .def("mesh_tables", &tables_object, "mesh"_a = 0)
      .def(
          "geometry",
          [](const Asset& asset, uint32_t cluster, uint32_t mesh) {
            lod::ClusterGeometry geometry;
            {
              const nb::gil_scoped_release release;
              check_cut(asset.tables(mesh), {&cluster, 1});
              geometry = asset.geometry(cluster, mesh);
            }
            return geometry_dict(std::move(geometry));
          },
          "cluster"_a, "mesh"_a = 0)
      .def(
          "mesh",
          [](const Asset& asset, const Flat<uint32_t>& cut, uint32_t mesh) {
            return cut_dict(
                tables_of(asset, mesh),
                [&](uint32_t cluster) { return asset.geometry(cluster, mesh); }, cut);
          },
          "cut"_a, "mesh"_a = 0)
      .def(
          "normal_cones",
          [](const Asset& asset, const nb::object& progress, uint32_t threads, uint32_t mesh) {
            return normal_cone_array(
                tables_of(asset, mesh),
                [&](uint32_t cluster) { return asset.geometry(cluster, mesh); }, progress, threads);
          },
          "progress"_a = nb::none(), "threads"_a = 0, "mesh"_a = 0)
      .def(
          "verify",
          [](const Asset& asset, uint32_t cuts, uint32_t seed, const nb::object& progress,
             uint32_t threads, uint64_t memory) {
            return report_dict(run(progress, threads, [&](const BuildOptions& options) {
              return memory > 0 ? verify_asset_within(memory, asset, cuts, seed, options)
                                : verify_asset(asset, cuts, seed, options);
            }));
          },
          "cuts"_a = 64, "seed"_a = 1, "progress"_a = nb::none(), "threads"_a = 0, "memory"_a = 0);
  PyType_Slot slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(&traverse<SourceAsset>)},
                         {0, nullptr}};
  nb::class_<SourceAsset, Asset>(module, "SourceAsset", "An asset of bytes that a callable gives.",
                                 nb::type_slots(slots))
      .def(
          "__init__",
          [](SourceAsset* self, uint64_t size, nb::object read, std::string name) {
            auto source = std::make_shared<const PythonSource>(size, std::move(read));
            const nb::gil_scoped_release release;
            new (self) SourceAsset(std::move(source), std::move(name));
          },
          "size"_a, "read"_a, "name"_a);
  module.def(
      "write_asset", &write, "path"_a, "dags"_a, "metadata"_a, "materials"_a, "first_materials"_a,
      "files"_a, "instance_meshes"_a, "transforms"_a, "precision"_a, "page_bytes"_a,
      "progress"_a = nb::none(), "threads"_a = 0, "origin"_a = std::array<double, 3>{},
      "scene"_a = "",
      nb::sig("def write_asset(path: str | os.PathLike[str], dags: list[Dag], metadata: str, "
              "materials: str, first_materials: typing.Any, files: list[bytes], instance_meshes: "
              "typing.Any, "
              "transforms: typing.Any, precision: tuple[int, int, int, float], page_bytes: int, "
              "progress: object | None = None, threads: int = 0, "
              "origin: typing.Sequence[float] = (0, 0, 0), scene: str = '') -> int"));
  module.def(
      "verify_asset",
      [](const std::filesystem::path& path, uint32_t cuts, uint32_t seed,
         const nb::object& progress, uint32_t threads, uint64_t memory) {
        return report_dict(run(progress, threads, [&](const BuildOptions& options) {
          return memory > 0 ? verify_asset_within(memory, path, cuts, seed, options)
                            : verify_asset(path, cuts, seed, options);
        }));
      },
      "path"_a, "cuts"_a = 64, "seed"_a = 1, "progress"_a = nb::none(), "threads"_a = 0,
      "memory"_a = 0,
      nb::sig("def verify_asset(path: str | os.PathLike[str], cuts: int = 64, seed: int = 1, "
              "progress: object | None = None, threads: int = 0, memory: int = 0) "
              "-> dict[str, typing.Any]"));
}

}  // namespace umbel::python
