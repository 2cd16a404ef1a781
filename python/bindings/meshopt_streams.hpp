// What the decoders and the encoders of meshopt streams share.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>

namespace umbel::python {

namespace nb = nanobind;

using ByteView = nb::ndarray<const uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

[[noreturn]] inline void fail(const std::string& message) {
  throw nb::value_error(message.c_str());
}

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

inline void check_stride(size_t stride) {
  if (stride == 0 || stride > 256 || stride % 4 != 0) {
    fail("meshopt: stride " + std::to_string(stride) + " is no multiple of 4 up to 256");
  }
}

}  // namespace umbel::python
