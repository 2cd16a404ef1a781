// Tables of rows in files, and the values in their rows.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::io {

enum class Scalar : uint8_t { kI8, kU8, kI16, kU16, kI32, kU32, kI64, kU64, kF32, kF64 };

/// In the order of Scalar.
using ScalarTypes = std::tuple<int8_t, uint8_t, int16_t, uint16_t, int32_t, uint32_t, int64_t,
                               uint64_t, float, double>;

constexpr uint32_t size_of(Scalar type) {
  constexpr uint32_t kSizes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return kSizes[static_cast<size_t>(type)];
}

/// Rows of bytes in a file.
struct Table {
  uint32_t file = 0;
  uint64_t offset = 0;  ///< of the first row
  uint64_t stride = 0;  ///< bytes from one row to the next
  uint64_t rows = 0;
  bool big_endian = false;
};

/// Some values of each row of a table, all of one type.
struct Column {
  uint32_t table = kNone;  ///< kNone: there are no values
  Scalar type = Scalar::kF32;
  std::vector<uint32_t> offsets;  ///< of each value in the row, in bytes
  bool unit = false;              ///< integers are divided by their type's largest value

  bool is_there() const { return table != kNone; }
  /// Bytes of a row that hold the values: up to here.
  uint64_t end() const {
    return uint64_t{*std::max_element(offsets.begin(), offsets.end())} + size_of(type);
  }
};

/// Calls work(T{}) with the type of the values.
template <typename Work>
void with_type(Scalar type, const Work& work) {
  const auto number = static_cast<size_t>(type);
  [&]<size_t... i>(std::index_sequence<i...>) {
    static_cast<void>(
        ((number == i && (work(std::tuple_element_t<i, ScalarTypes>{}), true)) || ...));
  }(std::make_index_sequence<std::tuple_size_v<ScalarTypes>>{});
}

/// A value as it is in a file.
template <typename T>
T load_scalar(const std::byte* p, bool big_endian) {
  std::array<std::byte, sizeof(T)> bytes;
  std::memcpy(bytes.data(), p, sizeof(T));
  if (big_endian != (std::endian::native == std::endian::big))
    std::reverse(bytes.begin(), bytes.end());
  return std::bit_cast<T>(bytes);
}

/// A value as `Out`: a double, a float by the column's rule, or an index (kNone: it can be none).
template <typename Out, typename T>
Out converted(T value, const Column& column) {
  if constexpr (std::is_same_v<Out, uint32_t>) {
    if constexpr (std::is_floating_point_v<T>)
      return kNone;
    else if constexpr (sizeof(T) <= 4)
      return static_cast<uint32_t>(value);
    else
      return static_cast<uint64_t>(value) < kNone ? static_cast<uint32_t>(value) : kNone;
  } else if constexpr (std::is_same_v<Out, double>) {
    return static_cast<double>(value);
  } else if constexpr (std::is_floating_point_v<T>) {
    return static_cast<float>(value);
  } else {
    if (!column.unit) return static_cast<float>(value);
    constexpr T kLargest = std::numeric_limits<T>::max();
    const float scaled =
        sizeof(T) < 4
            ? static_cast<float>(value) / static_cast<float>(kLargest)
            : static_cast<float>(static_cast<double>(value) / static_cast<double>(kLargest));
    return std::max(scaled, -1.0f);
  }
}

/// An index that was converted, as the file has it.
inline std::string index_text(uint32_t index, Scalar type) {
  switch (type) {
    case Scalar::kI8:
    case Scalar::kI16:
    case Scalar::kI32:
      return std::to_string(static_cast<int32_t>(index));
    case Scalar::kI64:
    case Scalar::kU64:
      return index == kNone ? "beyond 32 bits" : std::to_string(index);
    default:
      return std::to_string(index);
  }
}

}  // namespace umbel::io
