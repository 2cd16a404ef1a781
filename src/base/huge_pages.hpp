// Huge pages for large arrays: with small ones, each first touch of a page costs a fault, and
// access at random misses the address cache (the TLB).
#pragma once

#include <cstddef>
#include <cstdint>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace umbel {

inline constexpr size_t kHugePage = size_t(1) << 21;
inline constexpr size_t kCacheLine = 64;

/// What arrays of `bytes` are aligned to.
constexpr size_t large_alignment(size_t bytes) {
  return bytes >= kHugePage ? kHugePage : kCacheLine;
}

/// Asks the system to back memory that nobody has touched yet with huge pages, as far as it covers
/// whole ones. Only advice: where it is refused, small pages do.
inline void prefer_huge_pages(void* memory, size_t bytes) {
#if defined(__linux__) && defined(MADV_HUGEPAGE)
  const size_t past_a_page = reinterpret_cast<uintptr_t>(memory) % kHugePage;
  const size_t before_a_page = past_a_page == 0 ? 0 : kHugePage - past_a_page;
  if (bytes < before_a_page + kHugePage) return;
  (void)madvise(static_cast<char*>(memory) + before_a_page,
                (bytes - before_a_page) / kHugePage * kHugePage, MADV_HUGEPAGE);
#else
  (void)memory;
  (void)bytes;
#endif
}

}  // namespace umbel
