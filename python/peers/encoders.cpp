// The encoders of EXT_meshopt_compression and KHR_meshopt_compression, which make test files.
#include <meshoptimizer.h>
#include <nanobind/stl/string.h>

#include <vector>

#include "meshopt_streams.hpp"
#include "peers.hpp"

namespace umbel::python {
namespace {

using IndexView = nb::ndarray<const uint32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using FloatView = nb::ndarray<const float, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;

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

void bind_encoders(nb::module_& module) {
  module.def("encode_vertex", &encode_vertex, nb::arg("array"),
             "Encodes a (count, stride) uint8 array as a vertex stream.");
  module.def("encode_index", &encode_index, nb::arg("indices"), nb::arg("vertices"),
             "Encodes a triangle list of uint32 indices below `vertices`.");
  module.def("encode_index_sequence", &encode_index_sequence, nb::arg("indices"),
             nb::arg("vertices"), "Encodes any uint32 indices below `vertices`.");
  module.def("encode_filter", &encode_filter, nb::arg("values"), nb::arg("filter"),
             nb::arg("stride"), nb::arg("bits"),
             "What `umbel._umbel.meshopt_filter` turns back into (count, 4) float32 values, as "
             "(count, stride) "
             "uint8.");
}

}  // namespace umbel::python
