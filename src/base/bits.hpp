// Streams of bits, the lowest bit of a byte first, and numbers in them whose class comes first, in
// unary: Rice codes (Rice, "Some Practical Universal Noiseless Coding Techniques", 1979), where
// classes are equally large, and others.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "base/bytes.hpp"

namespace umbel {

/// Longest run of zeros before the number of a class ends; a longer one is followed by the number
/// itself.
inline constexpr uint32_t kUnaryEscape = 16;

/// The numbers of a code that begin with the same zeros, after which a one comes.
struct UnaryClass {
  static constexpr uint32_t kEscape = ~0u;

  uint32_t first;   ///< the lowest
  uint32_t mask;    ///< of the bits that come next, and are added to it
  uint32_t zeros;   ///< bits before those, with the one
  uint32_t length;  ///< of all bits; kEscape after kUnaryEscape zeros
};

/// Bits of a number below `count`.
constexpr uint32_t bits_below(uint32_t count) {
  return count < 2 ? 0 : static_cast<uint32_t>(std::bit_width(count - 1));
}

/// Small numbers of either sign as small numbers: 0, -1, 1, -2, ... as 0, 1, 2, 3, ...
constexpr uint32_t zigzag(int32_t value) {
  return static_cast<uint32_t>(value) << 1 ^ static_cast<uint32_t>(value >> 31);
}
constexpr int32_t unzigzag(uint32_t value) {
  return static_cast<int32_t>(value >> 1 ^ (0u - (value & 1)));
}

/// Appends to a vector of bytes.
class BitWriter {
 public:
  explicit BitWriter(std::vector<std::byte>& out) : out_(out) {}

  /// The lowest `count` <= 32 bits of `value`; those above must be 0.
  void write(uint32_t value, uint32_t count) {
    held_ |= uint64_t{value} << bits_;
    bits_ += count;
    if (bits_ >= 32) emit(4);
  }

  /// A number that no class has.
  void escaped(uint32_t value) {
    write(0, kUnaryEscape);
    write(value, 32);
  }

  /// Fills the last byte with zeros.
  void finish() {
    emit((bits_ + 7) / 8);
    bits_ = 0;
  }

 private:
  void emit(uint32_t bytes) {
    if (bytes == 0) return;
    const uint64_t word = little_endian(held_);
    const size_t end = out_.size();
    out_.resize(end + bytes);
    std::memcpy(out_.data() + end, &word, bytes);
    held_ >>= 8 * bytes;
    bits_ -= 8 * bytes;
  }

  std::vector<std::byte>& out_;
  uint64_t held_ = 0;
  uint32_t bits_ = 0;
};

// A call would keep the reader's state in memory.
#define UMBEL_READ_INLINE [[gnu::always_inline]] inline

/// Past the end it reads anything; `finish` tells, so that inner loops need no checks.
class BitReader {
 public:
  /// `beyond` bytes behind `in` may be read too, which is faster than to stop at its end.
  explicit BitReader(std::span<const std::byte> in, size_t beyond = 0)
      : next_(in.data()), end_(next_ + in.size()), limit_(end_ + beyond) {}

  /// `count` <= 32 bits.
  UMBEL_READ_INLINE uint32_t read(uint32_t count) {
    ensure(count);
    return take(count);
  }

  /// Afterwards 56 bits may be taken.
  UMBEL_READ_INLINE void refill() {
    if (limit_ - next_ >= 8) {
      uint64_t word;
      std::memcpy(&word, next_, 8);
      held_ |= little_endian(word) << bits_;
      const uint32_t bytes = (63 - bits_) >> 3;
      next_ += bytes;
      bits_ += bytes * 8;
      return;
    }
    for (; bits_ <= 56; bits_ += 8) {
      if (next_ == limit_)
        ++past_limit_;
      else
        held_ |= uint64_t{static_cast<uint8_t>(*next_++)} << bits_;
    }
  }

  /// Afterwards `count` <= 56 bits may be read. Most times they are there.
  UMBEL_READ_INLINE void ensure(uint32_t count) {
    if (bits_ < count) refill();
  }

  UMBEL_READ_INLINE uint32_t take(uint32_t count) {
    const uint32_t value = peek(count);
    skip(count);
    return value;
  }

  /// The next `count` <= 32 bits, which stay.
  UMBEL_READ_INLINE uint32_t peek(uint32_t count) const {
    return static_cast<uint32_t>(held_ & ((uint64_t{1} << count) - 1));
  }
  /// What was peeked at.
  UMBEL_READ_INLINE void skip(uint32_t count) {
    held_ >>= count;
    bits_ -= count;
  }

  UMBEL_READ_INLINE uint32_t rice(uint32_t k) {
    ensure(kUnaryEscape + k);
    return take_rice(k);
  }
  /// Where kUnaryEscape + k bits are there for sure. It takes no more, or leaves 56.
  UMBEL_READ_INLINE uint32_t take_rice(uint32_t k) {
    const auto quotient =
        static_cast<uint32_t>(std::countr_zero(held_ | uint64_t{1} << kUnaryEscape));
    if (quotient == kUnaryEscape) [[unlikely]] {
      skip(kUnaryEscape);
      const uint32_t value = read(32);
      refill();
      return value;
    }
    skip(quotient + 1);
    return quotient << k | take(k);
  }

  /// A number whose class comes first, one of kUnaryEscape + 1 by their zeros.
  UMBEL_READ_INLINE uint32_t in_class(const UnaryClass* classes) {
    const auto next = [&] {
      return classes[std::countr_zero(held_ | uint64_t{1} << kUnaryEscape)];
    };
    UnaryClass of = next();
    if (of.length > bits_) [[unlikely]] {
      refill();
      of = next();
      if (of.length == UnaryClass::kEscape) {
        skip(kUnaryEscape);
        const uint32_t value = read(32);
        refill();
        return value;
      }
    }
    const uint32_t value = of.first + (static_cast<uint32_t>(held_ >> of.zeros) & of.mask);
    skip(of.length);
    return value;
  }

  /// Throws kCorrupt unless what was read ends in the last byte of the input.
  void finish() const {
    const int64_t left = bits_ + 8 * ((end_ - next_) - past_limit_);
    if (left < 0) corrupt("a stream of bits ends too early");
    if (left >= 8) corrupt("a stream of bits goes on too long");
  }

 private:
  const std::byte* next_;
  const std::byte* end_;
  const std::byte* limit_;
  uint64_t held_ = 0;
  uint32_t bits_ = 0;
  int64_t past_limit_ = 0;  // bytes
};

}  // namespace umbel
