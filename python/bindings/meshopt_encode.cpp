// The encoders of EXT_meshopt_compression and KHR_meshopt_compression for Python, and the order of
// triangles and vertices that they compress best.
#include <meshoptimizer.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>

#include <utility>
#include <vector>

#include "bind.hpp"
#include "meshopt_streams.hpp"

namespace umbel::python {
namespace {

using IndexView = nb::ndarray<const uint32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Words = nb::ndarray<nb::numpy, uint32_t>;
using FloatView = nb::ndarray<const float, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;

nb::bytes as_bytes(const std::vector<unsigned char>& data, size_t size) {
  return nb::bytes(reinterpret_cast<const char*>(data.data()), size);
}

nb::bytes encode_vertex(ByteView array, int version) {
  const size_t count = array.shape(0), stride = array.shape(1);
  check_stride(stride);
  if (version != 0 && version != 1) {
    fail("meshopt: no version " + std::to_string(version) + " of vertex streams");
  }
  constexpr int kLevel = 2;  // the encoder's default
  std::vector<unsigned char> out(meshopt_encodeVertexBufferBound(count, stride));
  size_t size = 0;
  {
    nb::gil_scoped_release release;
    size = meshopt_encodeVertexBufferLevel(out.data(), out.size(), array.data(), count, stride,
                                           kLevel, version);
  }
  return as_bytes(out, size);
}

void check_indices(IndexView indices, size_t vertices) {
  const size_t count = indices.shape(0);
  if (count % 3 != 0) {
    fail("meshopt: " + std::to_string(count) + " indices are no whole triangles");
  }
  for (size_t i = 0; i < count; ++i) {
    if (indices.data()[i] >= vertices) {
      fail("meshopt: the index " + std::to_string(indices.data()[i]) + " is beyond the " +
           std::to_string(vertices) + " vertices");
    }
  }
}

nb::bytes encode_index(IndexView indices, size_t vertices) {
  check_indices(indices, vertices);
  const size_t count = indices.shape(0);
  std::vector<unsigned char> out(meshopt_encodeIndexBufferBound(count, vertices));
  size_t size = 0;
  {
    nb::gil_scoped_release release;
    size = meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), count);
  }
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

/// Triangles in an order for the vertex cache, and which vertex each vertex then is, in the order
/// in which the triangles need them.
std::pair<Words, Words> reorder(IndexView indices, size_t vertices) {
  check_indices(indices, vertices);
  const size_t count = indices.shape(0);
  auto triangles = allocate<uint32_t>(count);
  auto order = allocate<uint32_t>(vertices);
  size_t used = 0;
  {
    nb::gil_scoped_release release;
    std::vector<unsigned int> remap(vertices);
    meshopt_optimizeVertexCache(triangles.get(), indices.data(), count, vertices);
    used = meshopt_optimizeVertexFetchRemap(remap.data(), triangles.get(), count, vertices);
    meshopt_remapIndexBuffer(triangles.get(), triangles.get(), count, remap.data());
    for (size_t v = 0; v < vertices; ++v) {
      if (remap[v] != ~0U) order[remap[v]] = static_cast<uint32_t>(v);
    }
  }
  return {owned(std::move(triangles), {count}), owned(std::move(order), {used})};
}

}  // namespace

void bind_meshopt_encode(nb::module_& module) {
  module.def("meshopt_encode_vertex", &encode_vertex, nb::arg("array"), nb::arg("version") = 1,
             "Encodes a (count, stride) uint8 array as a vertex stream: of version 0 for "
             "EXT_meshopt_compression, of 1 for KHR_meshopt_compression.");
  module.def("meshopt_encode_index", &encode_index, nb::arg("indices"), nb::arg("vertices"),
             "Encodes a triangle list of uint32 indices below `vertices`.");
  module.def("meshopt_encode_index_sequence", &encode_index_sequence, nb::arg("indices"),
             nb::arg("vertices"), "Encodes any uint32 indices below `vertices`.");
  module.def("meshopt_encode_filter", &encode_filter, nb::arg("values"), nb::arg("filter"),
             nb::arg("stride"), nb::arg("bits"),
             "What `meshopt_filter` turns back into (count, 4) float32 values, as (count, stride) "
             "uint8.");
  module.def("meshopt_reorder", &reorder, nb::arg("indices"), nb::arg("vertices"),
             "A triangle list in an order that suits vertex caches and compresses well: the new "
             "list, and (used,) uint32, the old number of each new vertex.");
}

}  // namespace umbel::python
