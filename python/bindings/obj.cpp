// Reading OBJ.
#include "io/obj.hpp"

#include <vector>

#include "bind.hpp"

namespace umbel::python {
namespace {

/// Names are bytes: a file may have them in any encoding.
nb::list bytes_of(const std::vector<std::string>& texts) {
  nb::list list;
  for (const std::string& text : texts) list.append(nb::bytes(text.data(), text.size()));
  return list;
}

Dict dict_of(io::ObjMesh&& mesh) {
  const auto optional = [](nb::object array, bool is_there) {
    return is_there ? std::move(array) : nb::none();
  };
  const bool has_colors = !mesh.colors.empty(), has_uvs = !mesh.uvs.empty();
  const bool has_normals = !mesh.normals.empty(), has_materials = !mesh.materials.empty();
  Dict out;
  out["positions"] = take<double>(std::move(mesh.positions));
  out["triangles"] = take<uint32_t>(std::move(mesh.triangles));
  out["colors"] = optional(nb::cast(take<float>(std::move(mesh.colors))), has_colors);
  out["uvs"] = optional(nb::cast(take<float>(std::move(mesh.uvs))), has_uvs);
  out["normals"] = optional(nb::cast(take<float>(std::move(mesh.normals))), has_normals);
  out["without_normal"] = take<uint32_t>(std::move(mesh.without_normal));
  out["materials"] = optional(nb::cast(take<uint32_t>(std::move(mesh.materials))), has_materials);
  out["material_names"] = bytes_of(mesh.material_names);
  out["libraries"] = bytes_of(mesh.libraries);
  out["notes"] = bytes_of(mesh.notes);
  out["fault"] = nb::bytes(mesh.fault.data(), mesh.fault.size());
  return out;
}

io::ObjMesh read(const io::ByteSource& source, const std::string& name) {
  const nb::gil_scoped_release release;
  return io::read_obj(source, name);
}

}  // namespace

void bind_obj(nb::module_& module) {
  module.def(
      "read_obj",
      [](const std::filesystem::path& path, const std::string& name) {
        const InputFile file(path);
        return dict_of(read(io::ByteSource(file), name));
      },
      "path"_a, "name"_a,
      nb::sig("def read_obj(path: str | os.PathLike[str], name: str) -> dict[str, typing.Any]"),
      "The arrays of an OBJ file; `name` names it in errors.");
  module.def(
      "read_obj_bytes",
      [](const nb::bytes& data, const std::string& name) {
        const std::span text(static_cast<const std::byte*>(data.data()), data.size());
        return dict_of(read(io::ByteSource(text), name));
      },
      "data"_a, "name"_a, "The same of a file's bytes.");
}

}  // namespace umbel::python
