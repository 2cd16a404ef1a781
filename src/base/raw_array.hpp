// An array without values, on pages of the usual size, which may be such as were used before.
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>

namespace umbel {

template <typename T>
class RawArray {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  explicit RawArray(size_t size) : data_(static_cast<T*>(::operator new(size * sizeof(T)))) {}
  T* data() const { return data_.get(); }
  T& operator[](size_t i) const { return data_[i]; }

 private:
  struct Delete {
    void operator()(T* data) const { ::operator delete(data); }
  };
  std::unique_ptr<T[], Delete> data_;
};

}  // namespace umbel
