// Pointers that C callers give.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "umbel/types.hpp"

namespace umbel::capi {

/// `count` elements of the caller's array; throws if that is NULL and `count` is not 0.
template <typename To, typename From>
std::span<To> elements(From* array, size_t count, const char* name) {
  static_assert(sizeof(To) == sizeof(From) && alignof(To) == alignof(From));
  if (!array && count > 0)
    throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is NULL, but there are " +
                                                 std::to_string(count) + " elements");
  return {reinterpret_cast<To*>(array), array ? count : 0};
}

/// Throws if an argument that must be there is not.
template <typename T>
T& required(T* pointer, const char* name) {
  if (!pointer) throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is NULL");
  return *pointer;
}

}  // namespace umbel::capi
