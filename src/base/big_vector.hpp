// A vector for arrays that are read at random: aligned to cache lines, and on large pages where
// the system has them, because page-table misses cost as much as cache misses there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <vector>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace umbel {

template <typename T>
struct BigAllocator {
  using value_type = T;  // NOLINT(readability-identifier-naming): the standard's name
  static constexpr size_t kLine = 64, kPage = size_t{1} << 21;

  BigAllocator() = default;
  template <typename U>
  BigAllocator(const BigAllocator<U>& /*other*/) {}  // NOLINT(google-explicit-constructor)

  T* allocate(size_t count) {
    if (count > (static_cast<size_t>(-1) - kPage) / sizeof(T)) throw std::bad_alloc();
    const size_t bytes = count * sizeof(T);
    const size_t alignment = bytes >= kPage ? kPage : kLine;
    void* memory = ::operator new(bytes, std::align_val_t{alignment});
#if defined(__linux__)
    // Only advice: where it is refused, small pages do.
    if (bytes >= kPage) (void)madvise(memory, bytes, MADV_HUGEPAGE);
#endif
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, size_t count) {
    const size_t alignment = count * sizeof(T) >= kPage ? kPage : kLine;
    ::operator delete(memory, std::align_val_t{alignment});
  }
  bool operator==(const BigAllocator&) const { return true; }
};

template <typename T>
using BigVector = std::vector<T, BigAllocator<T>>;

/// Room for `count` elements of an ordinary vector, on large pages as far as it covers whole ones:
/// a small page costs its first touch. To be called before the vector is filled.
template <typename T>
void reserve_big(std::vector<T>& vector, size_t count) {
  vector.reserve(count);
#if defined(__linux__)
  constexpr size_t kPage = BigAllocator<T>::kPage;
  char* const memory = reinterpret_cast<char*>(vector.data());
  const size_t bytes = vector.capacity() * sizeof(T);
  const size_t before = (kPage - reinterpret_cast<uintptr_t>(memory) % kPage) % kPage;
  if (before + kPage <= bytes)
    (void)madvise(memory + before, (bytes - before) / kPage * kPage, MADV_HUGEPAGE);
#endif
}

}  // namespace umbel
