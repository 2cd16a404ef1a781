#include "bind.hpp"

namespace umbel::python {

std::vector<uint32_t> offsets_of(std::span<const Range> ranges) {
  std::vector<uint32_t> offsets;
  offsets.reserve(ranges.size() + 1);
  offsets.push_back(ranges.empty() ? 0 : ranges.front().offset);
  for (const Range& range : ranges) offsets.push_back(range.offset + range.count);
  return offsets;
}

MeshView MeshArrays::view() const {
  return {rows_of<Vec3>(positions),     rows_of<Triangle>(triangles),
          rows_of<Vec3>(normals),       rows_of<Vec4>(tangents),
          rows_of<Vec2>(uvs),           rows_of<Vec4>(colors),
          rows_of<uint32_t>(materials), extras,
          rows_of<float>(extra_values)};
}

namespace {

template <typename Scalar, typename T>
nb::object take_or_none(std::vector<T>&& values) {
  return values.empty() ? nb::none() : nb::cast(take<Scalar>(std::move(values)));
}

}  // namespace

Dict dict_of(Mesh&& mesh) {
  Dict result;
  result["positions"] = take<float>(std::move(mesh.positions));
  result["triangles"] = take<uint32_t>(std::move(mesh.triangles));
  result["normals"] = take_or_none<float>(std::move(mesh.normals));
  result["tangents"] = take_or_none<float>(std::move(mesh.tangents));
  result["uvs"] = take_or_none<float>(std::move(mesh.uvs));
  result["colors"] = take_or_none<float>(std::move(mesh.colors));
  if (!mesh.extras.empty()) {
    nb::list extras;
    for (const Extra& extra : mesh.extras)
      extras.append(nb::make_tuple(static_cast<uint32_t>(extra.kind), extra.set));
    result["extras"] = extras;
    result["extra_values"] = take<float>(std::move(mesh.extra_values));
  }
  result["materials"] = take_or_none<uint32_t>(std::move(mesh.materials));
  return result;
}

std::string sentence_of(const nb::python_error& error) {
  if (!error.matches(PyExc_Exception)) throw;
  const nb::str said = nb::str("{}: {}").format(error.type().attr("__name__"), error.value());
  // It may have file names that are not valid UTF-8.
  const nb::object bytes =
      nb::steal(PyUnicode_AsEncodedString(said.ptr(), "utf-8", "backslashreplace"));
  if (!bytes) throw nb::python_error();
  const nb::bytes utf8(bytes);
  return {utf8.c_str(), utf8.size()};
}

bool PythonProgress::report(float fraction, std::string_view stage) {
  using std::chrono::steady_clock;
  const auto now = steady_clock::now();
  if (stage == stage_ && fraction < 1.0f && now - last_ < std::chrono::milliseconds(20)) {
    return true;
  }
  last_ = now;
  stage_ = stage;
  nb::gil_scoped_acquire acquire;
  try {
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
    if (callback_.is_none()) return true;
    const nb::object answer = callback_(fraction, nb::str(stage.data(), stage.size()));
    if (answer.is_none() || PyBool_Check(answer.ptr())) return !answer.is(nb::bool_(false));
    // Comparisons with numbers of NumPy give its own kind of bool.
    return !nb::isinstance(answer, nb::module_::import_("numpy").attr("bool_")) ||
           PyObject_IsTrue(answer.ptr()) != 0;
  } catch (...) {
    raised_ = std::current_exception();
    return false;
  }
}

}  // namespace umbel::python
