// The codecs of EXT_meshopt_compression and KHR_meshopt_compression for Python: decoders of
// vertex and index streams, the filters after them, and the encoders, which make test files.
// The bit streams are specified in those extensions (Kapoulkine, Khronos Group, 2020 and 2025).
#include <meshoptimizer.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace nb = nanobind;

namespace {

using ByteView = nb::ndarray<const uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using IndexView = nb::ndarray<const uint32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using FloatView = nb::ndarray<const float, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;

// No stream of these codecs grows by more; larger claims are damage, not worth an allocation.
constexpr size_t kMostExpansion = 4096;

[[noreturn]] void fail(const std::string& message) { throw nb::value_error(message.c_str()); }

template <typename T>
auto owned(std::unique_ptr<T[]> data, std::initializer_list<size_t> shape) {
  T* raw = data.release();
  nb::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return nb::ndarray<nb::numpy, T>(raw, shape, owner);
}

template <typename T>
std::unique_ptr<T[]> allocate(size_t count) {
  return std::make_unique<T[]>(count > 0 ? count : 1);
}

const unsigned char* bytes_of(const nb::bytes& data) {
  return reinterpret_cast<const unsigned char*>(data.c_str());
}

void check_stride(size_t stride) {
  if (stride == 0 || stride > 256 || stride % 4 != 0) {
    fail("meshopt: stride " + std::to_string(stride) + " is no multiple of 4 up to 256");
  }
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

nb::bytes as_bytes(const std::vector<unsigned char>& data, size_t size) {
  return nb::bytes(reinterpret_cast<const char*>(data.data()), size);
}

nb::bytes encode_vertex(ByteView array) {
  const size_t count = array.shape(0), stride = array.shape(1);
  check_stride(stride);
  std::vector<unsigned char> out(meshopt_encodeVertexBufferBound(count, stride));
  const size_t size =
      meshopt_encodeVertexBuffer(out.data(), out.size(), array.data(), count, stride);
  return as_bytes(out, size);
}

nb::bytes encode_index(IndexView indices, size_t vertices) {
  const size_t count = indices.shape(0);
  if (count % 3 != 0) {
    fail("meshopt: " + std::to_string(count) + " indices are no whole triangles");
  }
  std::vector<unsigned char> out(meshopt_encodeIndexBufferBound(count, vertices));
  const size_t size = meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), count);
  return as_bytes(out, size);
}

nb::bytes encode_index_sequence(IndexView indices, size_t vertices) {
  const size_t count = indices.shape(0);
  std::vector<unsigned char> out(meshopt_encodeIndexSequenceBound(count, vertices));
  const size_t size = meshopt_encodeIndexSequence(out.data(), out.size(), indices.data(), count);
  return as_bytes(out, size);
}

auto encode_filter(FloatView values, const std::string& name, size_t stride, int bits) {
  const size_t count = values.shape(0);
  const bool four_or_eight = stride == 4 || stride == 8;
  const int most = stride == 4 ? 8 : 16;
  auto out = allocate<uint8_t>(count * stride);
  if (name == "OCTAHEDRAL" && four_or_eight && bits >= 2 && bits <= most) {
    meshopt_encodeFilterOct(out.get(), count, stride, bits, values.data());
  } else if (name == "QUATERNION" && stride == 8 && bits >= 4 && bits <= 16) {
    meshopt_encodeFilterQuat(out.get(), count, stride, bits, values.data());
  } else if (name == "EXPONENTIAL" && stride == 16 && bits >= 1 && bits <= 24) {
    meshopt_encodeFilterExp(out.get(), count, stride, bits, values.data(),
                            meshopt_EncodeExpSeparate);
  } else if (name == "COLOR" && four_or_eight && bits >= 2 && bits <= most) {
    meshopt_encodeFilterColor(out.get(), count, stride, bits, values.data());
  } else {
    fail("meshopt: no filter '" + name + "' for a stride of " + std::to_string(stride) + " and " +
         std::to_string(bits) + " bits");
  }
  return owned(std::move(out), {count, stride});
}

}  // namespace

void bind_meshopt(nb::module_& m) {
  m.def("meshopt_decode_vertex", &decode_vertex, nb::arg("data"), nb::arg("count"),
        nb::arg("stride"),
        "Decodes a vertex stream to a (count, stride) uint8 array. ValueError if it is corrupt.");
  m.def("meshopt_decode_index", &decode_index, nb::arg("data"), nb::arg("count"),
        nb::arg("index_size"),
        "Decodes a triangle list to (count,) uint16 or uint32 (index_size 2 or 4). The indices "
        "of damaged data may be anything.");
  m.def("meshopt_decode_index_sequence", &decode_index_sequence, nb::arg("data"), nb::arg("count"),
        nb::arg("index_size"),
        "Decodes an index sequence to (count,) uint16 or uint32 (index_size 2 or 4).");
  m.def("meshopt_filter", &filter, nb::arg("array"), nb::arg("filter"), nb::arg("stride"),
        "A filtered copy of a (count, stride) uint8 array: OCTAHEDRAL, QUATERNION, EXPONENTIAL "
        "or COLOR.");
  m.def("meshopt_encode_vertex", &encode_vertex, nb::arg("array"),
        "Encodes a (count, stride) uint8 array as a vertex stream.");
  m.def("meshopt_encode_index", &encode_index, nb::arg("indices"), nb::arg("vertices"),
        "Encodes a triangle list of uint32 indices below `vertices`.");
  m.def("meshopt_encode_index_sequence", &encode_index_sequence, nb::arg("indices"),
        nb::arg("vertices"), "Encodes any uint32 indices below `vertices`.");
  m.def("meshopt_encode_filter", &encode_filter, nb::arg("values"), nb::arg("filter"),
        nb::arg("stride"), nb::arg("bits"),
        "What `meshopt_filter` turns back into (count, 4) float32 values, as (count, stride) "
        "uint8.");
}
