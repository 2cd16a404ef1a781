// The arrays that grow: vectors on huge pages. base/cpu_buffer.hpp has those of a fixed size.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

#include "base/huge_pages.hpp"

namespace umbel {

template <typename T>
struct BigAllocator {
  using value_type = T;  // NOLINT(readability-identifier-naming): the standard's name

  BigAllocator() = default;
  template <typename U>
  BigAllocator(const BigAllocator<U>& /*other*/) {}  // NOLINT(google-explicit-constructor)

  T* allocate(size_t count) {
    if (count > (static_cast<size_t>(-1) - kHugePage) / sizeof(T)) throw std::bad_alloc();
    const size_t bytes = count * sizeof(T);
    void* memory = ::operator new(bytes, std::align_val_t{large_alignment(bytes)});
    prefer_huge_pages(memory, bytes);
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, size_t count) {
    ::operator delete(memory, std::align_val_t{large_alignment(count * sizeof(T))});
  }
  bool operator==(const BigAllocator&) const { return true; }
};

/// Aligned to cache lines; for arrays that are read at random.
template <typename T>
using BigVector = std::vector<T, BigAllocator<T>>;

/// Reserves an ordinary vector, which a public type holds, on huge pages. To be called before the
/// vector is filled.
template <typename T>
void reserve_big(std::vector<T>& vector, size_t count) {
  vector.reserve(count);
  prefer_huge_pages(vector.data(), vector.capacity() * sizeof(T));
}

}  // namespace umbel
