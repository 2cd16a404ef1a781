// The decoders of EXT_meshopt_compression and KHR_meshopt_compression for Python: vertex and index
// streams, and the filters after them.
// The bit streams are specified in those extensions (Kapoulkine, Khronos Group, 2020 and 2025).
#include <meshoptimizer.h>
#include <nanobind/stl/string.h>

#include <algorithm>

#include "bind.hpp"
#include "meshopt_streams.hpp"

namespace umbel::python {
namespace {

// No stream of these codecs grows by more; larger claims are damage, not worth an allocation.
constexpr size_t kMostExpansion = 4096;

const unsigned char* bytes_of(const nb::bytes& data) {
  return reinterpret_cast<const unsigned char*>(data.c_str());
}

void check_count(const nb::bytes& data, size_t count, size_t size) {
  if (count > kMostExpansion * data.size() / size) {
    fail("meshopt: " + std::to_string(count) + " elements cannot come from " +
         std::to_string(data.size()) + " bytes");
  }
}

auto decode_vertex(const nb::bytes& data, size_t count, size_t stride) {
  check_stride(stride);
  check_count(data, count, stride);
  auto out = allocate<uint8_t>(count * stride);
  int error = 0;
  {
    nb::gil_scoped_release release;
    if (count > 0) {
      error = meshopt_decodeVertexBuffer(out.get(), count, stride, bytes_of(data), data.size());
    }
  }
  if (error != 0) {
    fail("meshopt: the vertex stream is corrupt (code " + std::to_string(error) + ")");
  }
  return owned(std::move(out), {count, stride});
}

using IndexDecoder = int (*)(void*, size_t, size_t, const unsigned char*, size_t);

template <typename T>
nb::object decode_indices(const nb::bytes& data, size_t count, IndexDecoder decoder) {
  auto out = allocate<T>(count);
  int error = 0;
  {
    nb::gil_scoped_release release;
    if (count > 0) {
      error = decoder(out.get(), count, sizeof(T), bytes_of(data), data.size());
    }
  }
  if (error != 0) {
    fail("meshopt: the index stream is corrupt (code " + std::to_string(error) + ")");
  }
  return nb::cast(owned(std::move(out), {count}));
}

nb::object decode_any(const nb::bytes& data, size_t count, size_t size, IndexDecoder decoder) {
  if (size != 2 && size != 4) {
    fail("meshopt: index size " + std::to_string(size) + " is neither 2 nor 4");
  }
  check_count(data, count, size);
  return size == 2 ? decode_indices<uint16_t>(data, count, decoder)
                   : decode_indices<uint32_t>(data, count, decoder);
}

nb::object decode_index(const nb::bytes& data, size_t count, size_t size) {
  if (count % 3 != 0) {
    fail("meshopt: " + std::to_string(count) + " indices are no whole triangles");
  }
  return decode_any(data, count, size, meshopt_decodeIndexBuffer);
}

nb::object decode_index_sequence(const nb::bytes& data, size_t count, size_t size) {
  return decode_any(data, count, size, meshopt_decodeIndexSequence);
}

auto filter(ByteView array, const std::string& name, size_t stride) {
  const size_t count = array.shape(0);
  if (array.shape(1) != stride) {
    fail("meshopt: the array's rows have " + std::to_string(array.shape(1)) + " bytes, not " +
         std::to_string(stride));
  }
  const bool four_or_eight = stride == 4 || stride == 8;
  void (*apply)(void*, size_t, size_t) = nullptr;
  if (name == "OCTAHEDRAL" && four_or_eight) {
    apply = meshopt_decodeFilterOct;
  } else if (name == "QUATERNION" && stride == 8) {
    apply = meshopt_decodeFilterQuat;
  } else if (name == "EXPONENTIAL" && stride % 4 == 0) {
    apply = meshopt_decodeFilterExp;
  } else if (name == "COLOR" && four_or_eight) {
    apply = meshopt_decodeFilterColor;
  } else {
    fail("meshopt: no filter '" + name + "' for a stride of " + std::to_string(stride));
  }
  auto out = allocate<uint8_t>(count * stride);
  std::copy_n(array.data(), count * stride, out.get());
  {
    nb::gil_scoped_release release;
    apply(out.get(), count, stride);
  }
  return owned(std::move(out), {count, stride});
}

}  // namespace

void bind_meshopt(nb::module_& module) {
  module.def(
      "meshopt_decode_vertex", &decode_vertex, nb::arg("data"), nb::arg("count"), nb::arg("stride"),
      "Decodes a vertex stream to a (count, stride) uint8 array. ValueError if it is corrupt.");
  module.def(
      "meshopt_decode_index", &decode_index, nb::arg("data"), nb::arg("count"),
      nb::arg("index_size"),
      "Decodes a triangle list to (count,) uint16 or uint32 (index_size 2 or 4). The indices "
      "of damaged data may be anything.");
  module.def("meshopt_decode_index_sequence", &decode_index_sequence, nb::arg("data"),
             nb::arg("count"), nb::arg("index_size"),
             "Decodes an index sequence to (count,) uint16 or uint32 (index_size 2 or 4).");
  module.def(
      "meshopt_filter", &filter, nb::arg("array"), nb::arg("filter"), nb::arg("stride"),
      "A filtered copy of a (count, stride) uint8 array: OCTAHEDRAL, QUATERNION, EXPONENTIAL "
      "or COLOR.");
}

}  // namespace umbel::python
