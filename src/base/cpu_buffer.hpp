// Large arrays on large pages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace umbel {

inline constexpr size_t kHugePage = size_t(1) << 21;

/// Asks the system to back memory that nobody has touched yet with huge pages. Touching it in
/// small ones can cost more than a pass of a radix sort.
inline void prefer_huge_pages(void* memory, size_t bytes) {
#if defined(__linux__) && defined(MADV_HUGEPAGE)
  const size_t past_a_page = reinterpret_cast<uintptr_t>(memory) % kHugePage;
  const size_t before_a_page = past_a_page == 0 ? 0 : kHugePage - past_a_page;
  if (bytes < before_a_page + kHugePage) return;
  madvise(static_cast<char*>(memory) + before_a_page,
          (bytes - before_a_page) / kHugePage * kHugePage, MADV_HUGEPAGE);
#else
  (void)memory;
  (void)bytes;
#endif
}

/// A vector of `size` elements without a value, or as near as a vector comes to that.
template <typename T>
std::vector<T> large_vector(size_t size) {
  std::vector<T> vector;
  vector.reserve(size);
  prefer_huge_pages(vector.data(), size * sizeof(T));
  vector.resize(size);
  return vector;
}

/// Memory of an executor: `size` elements without a value, given back at the end of the scope.
template <typename T>
class CpuBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  CpuBuffer() = default;
  explicit CpuBuffer(size_t size) : size_(size) {
    if (size == 0) return;
    const size_t bytes = size * sizeof(T);
    alignment_ = std::align_val_t(bytes >= kHugePage ? kHugePage : 64);
    data_ = static_cast<T*>(::operator new(bytes, alignment_));
    prefer_huge_pages(data_, bytes);
  }
  CpuBuffer(CpuBuffer&& o) noexcept
      : data_(std::exchange(o.data_, nullptr)), size_(o.size_), alignment_(o.alignment_) {}
  CpuBuffer& operator=(CpuBuffer&& o) noexcept {
    std::swap(data_, o.data_);
    std::swap(size_, o.size_);
    std::swap(alignment_, o.alignment_);
    return *this;
  }
  ~CpuBuffer() {
    if (data_) ::operator delete(data_, alignment_);
  }

  T* data() const { return data_; }
  size_t size() const { return size_; }
  // The analyzer forgets sizes in parallel loops.
  // NOLINTNEXTLINE(clang-analyzer-security.ArrayBound,clang-analyzer-core.uninitialized.UndefReturn)
  T& operator[](size_t i) const { return data_[i]; }

 private:
  T* data_ = nullptr;
  size_t size_ = 0;
  std::align_val_t alignment_{64};
};

}  // namespace umbel
