// How a remainder is coded: its class in unary, zeros before a one, then its place in the class.
//
// Rice's classes are equally large (Rice, "Some Practical Universal Noiseless Coding Techniques",
// 1979), those of exponential Golomb codes double (Teuhola, "A Compression Method for Clustered
// Bit-Vectors", 1978), which suits remainders if few are large. Either may have a class of
// the number 0 alone in front, for surfaces that are flat or along an axis.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "base/bits.hpp"

namespace umbel::asset {

inline constexpr uint32_t kParameterBits = 5, kKindBits = 2;
inline constexpr uint32_t kAllZero = 31;  ///< in place of a parameter: every remainder is 0

struct RemainderCode {
  static constexpr uint32_t kExponential = 1, kZeroApart = 2;
  static constexpr uint32_t kKinds = 4;
  /// The largest parameter of exponential codes: their longest class has 15 bits more.
  static constexpr uint32_t kMostExponential = 15;

  uint8_t parameter;
  uint8_t kind;  ///< flags

  constexpr bool is_exponential() const { return (kind & kExponential) != 0; }
  constexpr bool is_zero_apart() const { return (kind & kZeroApart) != 0; }
  constexpr bool is_all_zero() const { return parameter == kAllZero; }
  /// Whether a file may have it.
  constexpr bool is_valid() const {
    return is_all_zero() || !is_exponential() || parameter <= kMostExponential;
  }
  bool operator==(const RemainderCode&) const = default;
};

using UnaryClasses = std::array<UnaryClass, kUnaryEscape + 1>;

constexpr UnaryClasses make_classes(const RemainderCode& code) {
  UnaryClasses classes{};
  uint32_t first = 0;
  for (uint32_t i = 0; i < kUnaryEscape; ++i) {
    const uint32_t apart = code.is_zero_apart() ? 1 : 0;
    const uint32_t doubled = code.is_exponential() ? i - apart : 0;
    const uint32_t bits = i < apart ? 0 : code.parameter + doubled;
    classes[i] = {first, (1u << bits) - 1, i + 1, i + 1 + bits};
    first += 1u << bits;
  }
  classes[kUnaryEscape].length = UnaryClass::kEscape;
  return classes;
}

/// Of all codes, by kind and parameter. Where every remainder is 0, no bits are read; codes that
/// are not valid are the same.
inline constexpr auto kUnaryClasses = [] {
  std::array<std::array<UnaryClasses, kAllZero + 1>, RemainderCode::kKinds> all{};
  for (uint8_t kind = 0; kind < RemainderCode::kKinds; ++kind)
    for (uint8_t parameter = 0; parameter < kAllZero; ++parameter)
      if (const RemainderCode code{parameter, kind}; code.is_valid())
        all[kind][parameter] = make_classes(code);
  return all;
}();
inline const UnaryClasses& unary_classes(const RemainderCode& code) {
  return kUnaryClasses[code.kind][code.parameter];
}

/// The number of the class that has `value`; where none has, kUnaryEscape or more.
constexpr uint32_t unary_class(const RemainderCode& code, uint32_t value) {
  const uint32_t apart = code.is_zero_apart() ? 1 : 0;
  if (value < apart) return 0;
  const uint32_t scaled = (value - apart) >> code.parameter;
  const uint32_t number = code.is_exponential()
                              ? static_cast<uint32_t>(std::bit_width(uint64_t{scaled} + 1)) - 1
                              : std::min(scaled, kUnaryEscape);
  return number + apart;
}

inline void write_remainder(uint32_t value, const RemainderCode& code, BitWriter& out) {
  const uint32_t number = unary_class(code, value);
  if (number >= kUnaryEscape) return out.escaped(value);
  const UnaryClass& of = unary_classes(code)[number];
  out.write(1u << number, number + 1);
  out.write(value - of.first, of.length - of.zeros);
}

}  // namespace umbel::asset
