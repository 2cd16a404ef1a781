// Sources of triangles that are read in blocks.
#include <nanobind/stl/map.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <map>

#include "bind.hpp"
#include "io/source/checked_source.hpp"
#include "io/source/coherent.hpp"
#include "io/source/face_table.hpp"
#include "io/source/mesh_source.hpp"
#include "io/source/obj_tables.hpp"
#include "io/source/table_source.hpp"

namespace umbel::python {
namespace {

using io::Scalar;
/// Table, type as NumPy has it, offsets, and whether integers stand for fractions.
using ColumnArguments = std::tuple<uint32_t, std::string, std::vector<uint32_t>, bool>;
/// Kind and set of an Extra, and where its values are.
using ExtraArguments = std::tuple<uint32_t, uint32_t, ColumnArguments>;
/// Type, and the type of the length or nothing.
using PropertyArguments = std::tuple<std::string, std::optional<std::string>>;

Scalar scalar_of(const std::string& name) {
  static const std::map<std::string, Scalar> types{
      {"i1", Scalar::kI8},  {"u1", Scalar::kU8},  {"i2", Scalar::kI16}, {"u2", Scalar::kU16},
      {"i4", Scalar::kI32}, {"u4", Scalar::kU32}, {"i8", Scalar::kI64}, {"u8", Scalar::kU64},
      {"f4", Scalar::kF32}, {"f8", Scalar::kF64}};
  const auto found = types.find(name);
  if (found == types.end())
    throw Error(ErrorCode::kInvalidArgument, "'" + name + "' is no type of numbers");
  return found->second;
}

io::Column column_of(const ColumnArguments& given) {
  const auto& [table, type, offsets, unit] = given;
  return {table, scalar_of(type), offsets, unit};
}

io::Column column_of(const std::map<std::string, ColumnArguments>& columns, const char* name) {
  const auto found = columns.find(name);
  if (found == columns.end()) return {};
  return column_of(found->second);
}

uint32_t add_part(io::TableLayout& layout, const std::string& name,
                  const std::map<std::string, ColumnArguments>& columns, uint64_t triangles,
                  std::optional<uint32_t> material, uint32_t default_material,
                  const std::tuple<float, float>& color_scale, bool srgb_colors,
                  const std::optional<std::array<double, 12>>& transform,
                  const std::vector<ExtraArguments>& extras,
                  std::vector<uint32_t> material_numbers) {
  io::TablePart part;
  part.name = name;
  part.positions = column_of(columns, "positions");
  part.normals = column_of(columns, "normals");
  part.tangents = column_of(columns, "tangents");
  part.uvs = column_of(columns, "uvs");
  part.colors = column_of(columns, "colors");
  part.indices = column_of(columns, "indices");
  part.uv_indices = column_of(columns, "uv_indices");
  part.normal_indices = column_of(columns, "normal_indices");
  for (const auto& [kind, set, column] : extras)
    part.extras.push_back({{static_cast<ExtraKind>(kind), set}, column_of(column)});
  part.materials = column_of(columns, "materials");
  part.triangles = triangles;
  part.material = material.value_or(0);
  part.material_numbers = std::move(material_numbers);
  part.default_material = default_material;
  part.color_scale = {std::get<0>(color_scale), std::get<1>(color_scale)};
  part.are_colors_srgb = srgb_colors;
  part.transform = transform;
  layout.has_materials |= material.has_value() || part.materials.is_there();
  layout.parts.push_back(std::move(part));
  return static_cast<uint32_t>(layout.parts.size() - 1);
}

/// Keeps the arrays of a mesh alive.
class HeldMesh final : public io::TriangleSource {
 public:
  HeldMesh(MeshArrays mesh, const std::array<double, 3>& origin, std::string name)
      : arrays_(std::move(mesh)),
        source_(arrays_.view(), {origin[0], origin[1], origin[2]}, std::move(name)) {}
  uint64_t triangles() const override { return source_.triangles(); }
  io::SourceStreams streams() const override { return source_.streams(); }
  io::TriangleBlock read(uint64_t begin, uint64_t end) const override {
    return source_.read(begin, end);
  }

 private:
  MeshArrays arrays_;
  io::MeshSource source_;
};

/// Any range of triangles as a function of Python gives it: the arrays of a block, or None.
class CalledSource final : public io::TriangleSource {
 public:
  CalledSource(nb::object function, uint64_t triangles, std::vector<bool> streams)
      : function_(std::move(function)), triangles_(triangles) {
    streams.resize(5);
    streams_ = {streams[0], streams[1], streams[2], streams[3], streams[4], {}};
  }
  CalledSource(const CalledSource&) = delete;
  ~CalledSource() override {
    const nb::gil_scoped_acquire held;
    function_.reset();
  }
  uint64_t triangles() const override { return triangles_; }
  io::SourceStreams streams() const override { return streams_; }

  io::TriangleBlock read(uint64_t begin, uint64_t end) const override {
    const nb::gil_scoped_acquire held;
    try {
      const nb::object arrays = function_(begin, end);
      io::TriangleBlock block;
      block.first = begin;
      copy<Rows<double, 3>>(arrays[0], block.positions);
      copy<Rows<uint32_t, 3>>(arrays[1], block.triangles);
      copy<Rows<float, 3>>(arrays[2], block.normals);
      copy<Rows<float, 4>>(arrays[3], block.tangents);
      copy<Rows<float, 2>>(arrays[4], block.uvs);
      copy<Rows<float, 4>>(arrays[5], block.colors);
      copy<Flat<uint32_t>>(arrays[6], block.materials);
      return block;
    } catch (const nb::python_error& error) {
      // Blocks are read by other threads, too, which must not keep objects of Python.
      throw Error(ErrorCode::kInvalidArgument, "triangles [" + std::to_string(begin) + ", " +
                                                   std::to_string(end) +
                                                   ") cannot be had: " + sentence_of(error));
    }
  }

 private:
  template <typename Array, typename Element>
  static void copy(const nb::handle& object, std::vector<Element>& out) {
    if (object.is_none()) return;
    const auto array = nb::cast<Array>(object);
    out.resize(array.shape(0));
    if (!out.empty()) std::memcpy(out.data(), array.data(), array.nbytes());
  }

  nb::object function_;
  uint64_t triangles_;
  io::SourceStreams streams_;
};

/// Its blocks are not believed.
class CheckedCalls final : public io::TriangleSource {
 public:
  CheckedCalls(nb::object function, uint64_t triangles, std::vector<bool> streams)
      : source_(std::move(function), triangles, std::move(streams)), checked_(source_) {}
  uint64_t triangles() const override { return checked_.triangles(); }
  io::SourceStreams streams() const override { return checked_.streams(); }
  io::TriangleBlock read(uint64_t begin, uint64_t end) const override {
    return checked_.read(begin, end);
  }

 private:
  CalledSource source_;
  io::CheckedSource checked_;
};

/// Puts parts in order whose triangles jump about; gives how many. Files have names that begin with
/// `prefix`.
size_t put_in_order(io::TableLayout& layout, const std::filesystem::path& prefix,
                    uint64_t least_bytes, uint64_t block) {
  const nb::gil_scoped_release release;
  io::CoherenceConfig config;
  config.least_bytes = least_bytes;
  config.block = block;
  size_t moved = 0;
  for (size_t part = 0; part < layout.parts.size(); ++part) {
    if (!io::is_incoherent(layout, layout.parts[part], config)) continue;
    std::filesystem::create_directories(prefix.parent_path());
    std::filesystem::path own = prefix;
    const size_t before = layout.parts.size();
    io::make_coherent(layout, part, own += std::to_string(moved++), config);
    part += layout.parts.size() - before;
  }
  return moved;
}

/// Appends the tables of a file to a layout: the part, by its columns' names, is for add_part.
Dict add_obj(io::TableLayout& layout, const std::filesystem::path& path, const std::string& name,
             const std::filesystem::path& prefix) {
  io::ObjTables tables;
  {
    const nb::gil_scoped_release release;
    const InputFile file(path);
    tables = io::write_obj_tables(io::ByteSource(file), name, prefix);
  }
  const auto first_file = static_cast<uint32_t>(layout.files.size());
  const auto first_table = static_cast<uint32_t>(layout.tables.size());
  for (const auto& file : tables.layout.files) layout.files.push_back(file);
  for (io::Table table : tables.layout.tables) {
    table.file += first_file;
    layout.tables.push_back(table);
  }
  const io::TablePart& part = tables.layout.parts.front();
  Dict columns;
  const auto add = [&](const char* key, const io::Column& column) {
    if (!column.is_there()) return;
    const char* type = column.type == Scalar::kF64   ? "f8"
                       : column.type == Scalar::kU32 ? "u4"
                                                     : "f4";
    columns[key] = nb::make_tuple(column.table + first_table, type, column.offsets, column.unit);
  };
  add("positions", part.positions);
  add("colors", part.colors);
  add("uvs", part.uvs);
  add("normals", part.normals);
  add("indices", part.indices);
  add("uv_indices", part.uv_indices);
  add("normal_indices", part.normal_indices);
  add("materials", part.materials);
  Dict out;
  out["columns"] = columns;
  out["triangles"] = part.triangles;
  const bool is_indexed_once = !part.uv_indices.is_there() && !part.normal_indices.is_there();
  const uint64_t rows = tables.layout.tables[part.positions.table].rows;
  out["vertices"] = is_indexed_once ? nb::cast(rows) : nb::none();
  out["color_scale"] = nb::make_tuple(part.color_scale.color, part.color_scale.alpha);
  out["has_materials"] = tables.has_materials;
  out["misses_material"] = tables.misses_material;
  const auto bytes_of = [](const std::vector<std::string>& texts) {
    nb::list list;
    for (const std::string& text : texts) list.append(nb::bytes(text.data(), text.size()));
    return list;
  };
  out["material_names"] = bytes_of(tables.material_names);
  out["libraries"] = bytes_of(tables.libraries);
  out["notes"] = bytes_of(tables.notes);
  return out;
}

Dict read(const io::TriangleSource& source, uint64_t begin, uint64_t end) {
  io::TriangleBlock block;
  {
    const nb::gil_scoped_release release;
    block = source.read(begin, end);
  }
  const io::SourceStreams streams = source.streams();
  const auto optional = [](nb::object array, bool is_there) {
    return is_there ? std::move(array) : nb::none();
  };
  Dict out;
  out["positions"] = take<double>(std::move(block.positions));
  out["triangles"] = take<uint32_t>(std::move(block.triangles));
  out["normals"] = optional(nb::cast(take<float>(std::move(block.normals))), streams.normals);
  out["tangents"] = optional(nb::cast(take<float>(std::move(block.tangents))), streams.tangents);
  out["uvs"] = optional(nb::cast(take<float>(std::move(block.uvs))), streams.uvs);
  out["colors"] = optional(nb::cast(take<float>(std::move(block.colors))), streams.colors);
  out["materials"] =
      optional(nb::cast(take<uint32_t>(std::move(block.materials))), streams.materials);
  if (streams.extras.empty()) return out;
  nb::list extras;
  for (const Extra& extra : streams.extras)
    extras.append(nb::make_tuple(static_cast<uint32_t>(extra.kind), extra.set));
  out["extras"] = extras;
  out["extra_values"] = take<float>(std::move(block.extra_values));
  return out;
}

io::FaceRows face_rows(const std::filesystem::path& path, const std::string& name, uint64_t offset,
                       uint64_t rows, bool big_endian,
                       const std::vector<PropertyArguments>& properties, size_t indices,
                       std::optional<size_t> material) {
  io::FaceRows faces{path, name, offset, rows, big_endian, {}, indices, material};
  for (const auto& [type, length] : properties)
    faces.properties.push_back(
        {scalar_of(type), length ? std::optional(scalar_of(*length)) : std::nullopt});
  return faces;
}

void bind_faces(nb::module_& module) {
  nb::class_<io::FaceScan>(module, "FaceScan")
      .def_ro("are_triangles", &io::FaceScan::are_triangles)
      .def_ro("row_bytes", &io::FaceScan::row_bytes)
      .def_ro("index_offset", &io::FaceScan::index_offset)
      .def_ro("material_offset", &io::FaceScan::material_offset)
      .def_ro("triangles", &io::FaceScan::triangles)
      .def_ro("small_faces", &io::FaceScan::small_faces)
      .def_ro("end", &io::FaceScan::end)
      .def_ro("least_material", &io::FaceScan::least_material)
      .def_ro("largest_material", &io::FaceScan::largest_material);
  nb::class_<io::FaceRows>(module, "FaceRows")
      .def(
          "__init__",
          [](io::FaceRows* self, const std::filesystem::path& path, const std::string& name,
             uint64_t offset, uint64_t rows, bool big_endian,
             const std::vector<PropertyArguments>& properties, size_t indices,
             std::optional<size_t> material) {
            new (self) io::FaceRows(
                face_rows(path, name, offset, rows, big_endian, properties, indices, material));
          },
          "path"_a, "name"_a, "offset"_a, "rows"_a, "big_endian"_a, "properties"_a, "indices"_a,
          "material"_a = nb::none(),
          nb::sig("def __init__(self, path: str | os.PathLike[str], name: str, offset: int, "
                  "rows: int, big_endian: bool, properties: "
                  "collections.abc.Sequence[tuple[str, str | None]], indices: int, "
                  "material: int | None = None) -> None"));
  module.def("scan_faces", &io::scan_faces, "faces"_a, nb::call_guard<nb::gil_scoped_release>(),
             "Whether the faces of a binary PLY file are triangles.");
  module.def("write_triangles", &io::write_triangles, "faces"_a, "path"_a,
             nb::call_guard<nb::gil_scoped_release>(),
             nb::sig("def write_triangles(faces: FaceRows, path: str | os.PathLike[str]) -> "
                     "FaceScan"),
             "Writes them as a table of triangles.");
}

}  // namespace

void bind_source(nb::module_& module) {
  bind_faces(module);
  nb::class_<io::TriangleSource>(module, "TriangleSource",
                                 "Triangles that are read in blocks; see umbel.io.blocks.")
      .def_prop_ro("triangles", &io::TriangleSource::triangles)
      .def("read", &read, "begin"_a, "end"_a, "The arrays of the triangles [begin, end).");
  nb::class_<HeldMesh, io::TriangleSource>(module, "MeshSource")
      .def(nb::init<MeshArrays, const std::array<double, 3>&, std::string>(), "mesh"_a, "origin"_a,
           "name"_a);
  nb::class_<CheckedCalls, io::TriangleSource>(module, "CalledSource")
      .def(nb::init<nb::object, uint64_t, std::vector<bool>>(), "function"_a, "triangles"_a,
           "streams"_a);
  nb::class_<io::TableLayout>(module, "TableLayout", "Tables in files, and the meshes of them.")
      .def(nb::init<>())
      .def(
          "add_file",
          [](io::TableLayout& self, const std::filesystem::path& path) {
            self.files.push_back(path);
            return static_cast<uint32_t>(self.files.size() - 1);
          },
          "path"_a, nb::sig("def add_file(self, path: str | os.PathLike[str]) -> int"))
      .def(
          "add_table",
          [](io::TableLayout& self, uint32_t file, uint64_t offset, uint64_t stride, uint64_t rows,
             bool big_endian) {
            self.tables.push_back({file, offset, stride, rows, big_endian});
            return static_cast<uint32_t>(self.tables.size() - 1);
          },
          "file"_a, "offset"_a, "stride"_a, "rows"_a, "big_endian"_a = false)
      .def("put_in_order", &put_in_order, "prefix"_a, "least_bytes"_a,
           "block"_a = io::kBlockTriangles,
           nb::sig("def put_in_order(self, prefix: str | os.PathLike[str], least_bytes: int, "
                   "block: int = ...) -> int"),
           "Sorts the vertices of meshes whose triangles jump about among them.")
      .def("add_obj", &add_obj, "path"_a, "name"_a, "prefix"_a,
           nb::sig("def add_obj(self, path: str | os.PathLike[str], name: str, "
                   "prefix: str | os.PathLike[str]) -> dict[str, typing.Any]"),
           "Writes an OBJ file as tables, and adds those.")
      .def("add_part", &add_part, "name"_a, "columns"_a, "triangles"_a = 0,
           "material"_a = nb::none(), "default_material"_a = kNone,
           "color_scale"_a = nb::make_tuple(1.0f, 1.0f), "srgb_colors"_a = false,
           "transform"_a = nb::none(), "extras"_a = nb::make_tuple(),
           "material_numbers"_a = nb::make_tuple());
  nb::class_<io::TableSource, io::TriangleSource>(module, "TableSource")
      .def(nb::init<io::TableLayout>(), "layout"_a)
      .def("files", &io::TableSource::files, "begin"_a, "end"_a,
           "The numbers of the files that reading the triangles [begin, end) needs.");
}

}  // namespace umbel::python
