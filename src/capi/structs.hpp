// Reading and writing the structs of the C interface, whose first field says how large the caller's
// are.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>

#include "umbel/types.hpp"

namespace umbel::capi {

/// No struct will ever be as large; more means that `struct_size` was never set.
inline constexpr uint32_t kMaxStructSize = 1 << 12;

/// The struct's `struct_size`, checked. `first` is the size of its first version: all that any
/// caller can have. (Structs have one version so far, so it is their size.)
inline uint32_t struct_size_of(const void* given, const char* name, uint32_t first) {
  if (!given) throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is NULL");
  uint32_t size;
  std::memcpy(&size, given, sizeof size);
  if (size < first || size > kMaxStructSize)
    throw Error(ErrorCode::kInvalidArgument,
                std::string(name) + "->struct_size is " + std::to_string(size) +
                    ", which no version of this struct has: call its init function first");
  return size;
}

/// The struct as this version knows it. Fields that the caller does not know keep their defaults;
/// fields that only the caller knows must be zero.
template <typename T>
T read_struct(const T* given, const char* name, T defaults = {}) {
  const uint32_t size = struct_size_of(given, name, sizeof(T));
  const auto* bytes = reinterpret_cast<const unsigned char*>(given);
  if (size > sizeof(T) &&
      std::any_of(bytes + sizeof(T), bytes + size, [](unsigned char b) { return b != 0; }))
    throw Error(ErrorCode::kUnsupported,
                std::string(name) + " uses fields that this version of the library does not know");
  std::memcpy(&defaults, given, std::min<size_t>(size, sizeof(T)));
  return defaults;
}

/// Writes as much of the struct as the caller has, but for `struct_size`.
template <typename T>
void write_struct(T value, T* given, const char* name) {
  value.struct_size = struct_size_of(given, name, sizeof(T));
  std::memcpy(given, &value, std::min<size_t>(value.struct_size, sizeof(T)));
}

/// Defaults, and `size` as the caller's struct_size.
template <typename T>
void init_sized(T* given, size_t size, const T& defaults) {
  if (!given) return;
  std::memset(given, 0, size);
  std::memcpy(given, &defaults, std::min(size, sizeof defaults));
  const auto struct_size = static_cast<uint32_t>(size);
  std::memcpy(given, &struct_size, std::min(size, sizeof struct_size));
}

}  // namespace umbel::capi
