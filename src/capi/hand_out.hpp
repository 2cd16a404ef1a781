// What a C caller is given: a handle to own, or as much of an array as it has room for.
#pragma once

#include <algorithm>
#include <vector>

#include "capi/bvh_input.hpp"
#include "capi/guard.hpp"

namespace umbel::capi {

/// Runs make() and hands the caller what it made; NULL if it throws.
template <typename Handle, typename Make>
umbel_result hand_out(Handle** handle, const char* name, const Make& make) {
  if (handle) *handle = nullptr;
  return guard([&] {
    Handle*& result = required(handle, name);
    result = new Handle(make());
  });
}

/// How many there are, and all of them where the caller has an array for them.
template <typename T>
void hand_out_all(const std::vector<T>& found, T* to, const char* name, size_t capacity,
                  size_t* count) {
  required(count, "count") = found.size();
  const auto room = elements<T>(to, capacity, name);
  if (!to) return;
  if (found.size() > capacity)
    throw CapacityError{std::string(name) + " has room for " + std::to_string(capacity) + " of " +
                        std::to_string(found.size())};
  std::copy(found.begin(), found.end(), room.begin());
}

/// Runs find() and hands the caller all that it found.
template <typename Find>
umbel_result hand_out_found(uint32_t* to, const char* name, size_t capacity, size_t* count,
                            const Find& find) noexcept {
  if (count) *count = 0;
  return guard([&] {
    required(count, "count");
    hand_out_all(find(), to, name, capacity, count);
  });
}

}  // namespace umbel::capi
