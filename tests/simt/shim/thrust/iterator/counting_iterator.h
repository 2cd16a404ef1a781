#pragma once

#include <cstddef>

namespace thrust {

template <typename T>
struct counting_iterator {
  T first;
  explicit counting_iterator(T value) : first(value) {}
  T operator[](size_t i) const { return T(first + T(i)); }
};

}  // namespace thrust
