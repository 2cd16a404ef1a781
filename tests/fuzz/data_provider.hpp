// Numbers made of a fuzzer's bytes, as libFuzzer's FuzzedDataProvider makes them, which comes with
// clang alone: integers are taken from the end, and once there are no bytes left all are 0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace umbel::fuzz {

class DataProvider {
 public:
  DataProvider(const uint8_t* data, size_t size) : data_(data), size_(size) {}

  size_t remaining_bytes() const { return size_; }

  /// Any value of the type.
  template <typename T>
  T integral() {
    return integral_in_range(std::numeric_limits<T>::min(), std::numeric_limits<T>::max());
  }

  template <typename T>
  T integral_in_range(T least, T most) {
    using Unsigned = std::make_unsigned_t<T>;
    const auto range =
        static_cast<uint64_t>(static_cast<Unsigned>(most) - static_cast<Unsigned>(least));
    uint64_t value = 0;
    for (uint64_t left = range; left > 0 && size_ > 0; left >>= 8)
      value = value << 8 | data_[--size_];
    if (range != std::numeric_limits<uint64_t>::max()) value %= range + 1;
    return static_cast<T>(static_cast<Unsigned>(least) + static_cast<Unsigned>(value));
  }

  /// From 0 to 1.
  float probability() {
    return static_cast<float>(integral<uint32_t>()) / static_cast<float>(0xffffffffu);
  }

 private:
  const uint8_t* data_;
  size_t size_;
};

}  // namespace umbel::fuzz
