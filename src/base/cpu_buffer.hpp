// The arrays of a fixed size without values: scratch memory, and what the executor on the processor
// allocates. base/big_vector.hpp has those that grow.
#pragma once

#include <cstddef>
#include <new>
#include <type_traits>
#include <utility>

#include "base/huge_pages.hpp"

namespace umbel {

enum class Pages {
  kHuge,   ///< for arrays from a huge page on
  kSmall,  ///< as the allocator has them, which may be such as were used before
};

/// `size` elements without a value, given back at the end of the scope.
template <typename T>
class CpuBuffer {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  CpuBuffer() = default;
  explicit CpuBuffer(size_t size, Pages pages = Pages::kHuge) : size_(size) {
    if (size == 0) return;
    const size_t bytes = size * sizeof(T);
    alignment_ = std::align_val_t(pages == Pages::kHuge ? large_alignment(bytes) : alignof(T));
    data_ = static_cast<T*>(::operator new(bytes, alignment_));
    if (pages == Pages::kHuge) prefer_huge_pages(data_, bytes);
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
  std::align_val_t alignment_{alignof(T)};
};

}  // namespace umbel
