// Pointers that C callers give.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::capi {

/// Throws where 32-bit indices cannot name so many elements: before any size is multiplied. The
/// last index is kNone, "no such element".
inline void check_nameable(size_t count, const char* name) {
  if (count >= kNone)
    throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is " + std::to_string(count) +
                                                 ", more than 32-bit indices can name");
}

/// `count` elements of the caller's array; throws if that is NULL and `count` is not 0.
template <typename To, typename From>
std::span<To> elements(From* array, size_t count, const char* name) {
  static_assert(sizeof(To) == sizeof(From) && alignof(To) == alignof(From));
  if (!array && count > 0)
    throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is NULL, but there are " +
                                                 std::to_string(count) + " elements");
  return {reinterpret_cast<To*>(array), array ? count : 0};
}

/// The same of rows of `width` elements, `stride` bytes from one to the next (0: one right after
/// the other). They are copied to `copies` where there is anything between them, or where they are
/// not aligned as elements must be.
template <typename To, typename From>
std::span<const To> strided_rows(const From* array, size_t count, size_t width, size_t stride,
                                 const char* name, std::vector<To>& copies) {
  const auto all = elements<const To>(array, count * width, name);
  const size_t bytes = width * sizeof(To);
  const size_t step = stride == 0 ? bytes : stride;
  const bool is_aligned = reinterpret_cast<uintptr_t>(array) % alignof(To) == 0;
  if (step == bytes && is_aligned) return all;
  if (step < bytes)
    throw Error(ErrorCode::kInvalidArgument, std::string(name) + " has a stride of " +
                                                 std::to_string(stride) + " bytes, but values of " +
                                                 std::to_string(bytes));
  copies.resize(count * width);
  const auto* from = reinterpret_cast<const unsigned char*>(array);
  for (size_t i = 0; i < count; ++i) std::memcpy(&copies[i * width], from + i * step, bytes);
  return copies;
}
template <typename To, typename From>
std::span<const To> strided(const From* array, size_t count, size_t stride, const char* name,
                            std::vector<To>& copies) {
  return strided_rows(array, count, 1, stride, name, copies);
}

/// A limit as the library has it: 0 where there is none.
template <typename Number>
Number limit(Number given) {
  return given == kNone ? 0 : given;
}

/// Throws if an argument that must be there is not.
template <typename T>
T& required(T* pointer, const char* name) {
  if (!pointer) throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is NULL");
  return *pointer;
}

}  // namespace umbel::capi
