// What every binding shares: arrays in, arrays out, and calls that run without the GIL and can
// be stopped from Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <array>
#include <chrono>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "base/fields.hpp"
#include "base/poll.hpp"
#include "umbel/kdtree.hpp"
#include "umbel/mesh.hpp"
#include "umbel/types.hpp"

namespace umbel::python {

namespace nb = nanobind;
using namespace nb::literals;

/// A contiguous (n, columns) array that is only read.
template <typename Scalar, size_t columns>
using Rows = nb::ndarray<const Scalar, nb::shape<-1, columns>, nb::c_contig, nb::device::cpu>;
/// A contiguous (n,) array that is only read.
template <typename Scalar>
using Flat = nb::ndarray<const Scalar, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

/// An array that is given back.
template <typename Scalar>
using Array = nb::ndarray<nb::numpy, Scalar>;
using Dict = nb::typed<nb::dict, nb::str, nb::any>;

/// What was raised, as "ValueError: ...". Rethrows what is no Exception, such as an interrupt.
std::string sentence_of(const nb::python_error& error);

/// Fields of a struct to a dict, under their names: PUT_FIELDS(dict, tree, nodes, leaves).
#define PUT_FIELDS(dict, from, ...) UMBEL_EACH_FIELD(UMBEL_PUT_FIELD, dict, from, __VA_ARGS__)
#define UMBEL_PUT_FIELD(dict, from, field) (dict)[#field] = (from).field

/// The rows of an array as values of T, which has the same layout.
template <typename T, typename Array>
std::span<const T> rows_of(const Array& array) {
  return {reinterpret_cast<const T*>(array.data()), array.shape(0)};
}
template <typename T, typename Array>
std::span<const T> rows_of(const std::optional<Array>& array) {
  return array ? rows_of<T>(*array) : std::span<const T>{};
}

/// NumPy array over memory that `owner` keeps alive: (n,) where T is a Scalar, else (n, columns).
template <typename Scalar, typename T>
Array<Scalar> array_over(std::span<T> values, nb::handle owner) {
  constexpr size_t size = sizeof(T);
  constexpr size_t columns = size / sizeof(Scalar);
  static std::remove_const_t<Scalar> nothing{};  // an array needs an address even when empty
  Scalar* data = values.empty() ? &nothing : reinterpret_cast<Scalar*>(values.data());
  const size_t shape[2] = {values.size(), columns};
  return Array<Scalar>(data, columns == 1 ? 1 : 2, shape, owner);
}

/// NumPy array that takes the vector over without copying it.
template <typename Scalar, typename T>
Array<Scalar> take(std::vector<T>&& values) {
  auto owner = std::make_unique<std::vector<T>>(std::move(values));
  const std::span<T> span(*owner);
  nb::capsule capsule(owner.get(),
                      [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  owner.release();
  return array_over<Scalar>(span, capsule);
}

/// (n + 1) offsets from ranges that follow each other.
std::vector<uint32_t> offsets_of(std::span<const Range> ranges);

/// A mesh's arrays as Python gave them; keeps them alive for as long as it lives.
struct MeshArrays {
  Rows<float, 3> positions;
  Rows<uint32_t, 3> triangles;
  std::optional<Rows<float, 3>> normals;
  std::optional<Rows<float, 4>> tangents;
  std::optional<Rows<float, 2>> uvs;
  std::optional<Rows<float, 4>> colors;
  std::optional<Flat<uint32_t>> materials;
  std::vector<Extra> extras;
  std::optional<Flat<float>> extra_values;  // see MeshView

  MeshView view() const;
};

/// The arrays of a mesh by name; None where it has none.
Dict dict_of(Mesh&& mesh);

/// Forwards progress to a Python callable and notices Ctrl-C, a few times a second.
class PythonProgress {
 public:
  explicit PythonProgress(const nb::object& callback) : callback_(callback) {}
  /// False if the build should stop. Takes the GIL.
  bool report(float fraction, std::string_view stage);
  /// Raises what stopped the build, if that was a Python exception.
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  const nb::object& callback_;
  std::exception_ptr raised_;
  std::string stage_;
  std::chrono::steady_clock::time_point last_{};
};

/// Runs work(options) without the GIL.
template <typename Work>
auto run(const nb::object& callback, uint32_t threads, const Work& work) {
  PythonProgress progress(callback);
  BuildOptions options;
  options.threads = threads;
  options.progress = [&](float fraction, std::string_view stage) {
    return progress.report(fraction, stage);
  };
  try {
    nb::gil_scoped_release release;
    return work(options);
  } catch (const Error&) {
    progress.rethrow();
    throw;
  }
}

/// Calls work() without the GIL. Ctrl-C ends it where it polls.
template <typename Work>
auto interruptible(const Work& work) {
  const nb::object nothing = nb::none();
  PythonProgress interrupts(nothing);
  const std::function<void()> look = [&] {
    if (!interrupts.report(0, "")) throw Error(ErrorCode::kCancelled, "interrupted");
  };
  try {
    const nb::gil_scoped_release release;
    const PollScope scope(look);
    return work();
  } catch (const Error&) {
    interrupts.rethrow();
    throw;
  }
}

/// Of kd-trees and uniform structures.
Dict statistics_dict(const kdtree::Statistics& statistics);

void bind_errors(nb::module_& module);
void bind_mesh(nb::module_& module);
void bind_obj(nb::module_& module);
void bind_source(nb::module_& module);
void bind_scale(nb::module_& module);
void bind_cluster(nb::module_& module);
void bind_frame_clusters(nb::module_& module);
void bind_lod(nb::module_& module);
void bind_asset(nb::module_& module);
void bind_instance_tree(nb::module_& module);
void bind_stream(nb::module_& module);
void bind_trace(nb::module_& module);
void bind_queries(nb::module_& module);
void bind_bvh(nb::module_& module);
void bind_dynamic_tree(nb::module_& module);
void bind_kdtree(nb::module_& module);
void bind_uniform(nb::module_& module);
void bind_timed_clusters(nb::module_& module);
/// The decoders that compressed glTF needs.
void bind_meshopt(nb::module_& module);
void bind_meshopt_encode(nb::module_& module);

}  // namespace umbel::python
