// Scratch memory of trivial elements, uninitialised, on huge pages where the system gives them:
// scattering into many megabytes otherwise misses the address cache at every other write.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace umbel::cluster {

template <typename T>
class HugeArray {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  explicit HugeArray(size_t count) {
    constexpr size_t kPage = size_t(1) << 21;
    const size_t bytes = count * sizeof(T);
    const bool huge = bytes >= 2 * kPage;
    const size_t alignment = huge ? kPage : 64;
    const size_t rounded = (bytes + alignment) / alignment * alignment;
    data_.reset(static_cast<T*>(std::aligned_alloc(alignment, rounded)));
    if (!data_) throw std::bad_alloc();
#if defined(__linux__) && defined(MADV_HUGEPAGE)
    if (huge) madvise(data_.get(), rounded, MADV_HUGEPAGE);
#endif
  }
  T* get() const { return data_.get(); }
  T& operator[](size_t i) const { return data_.get()[i]; }

 private:
  struct Free {
    void operator()(T* p) const { std::free(p); }
  };
  std::unique_ptr<T, Free> data_;
};

}  // namespace umbel::cluster
