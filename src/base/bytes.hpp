// Little-endian values in byte buffers. Reading checks every bound.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "umbel/types.hpp"

namespace umbel {

[[noreturn]] inline void corrupt(const std::string& sentence) {
  throw Error(ErrorCode::kCorrupt, sentence);
}

constexpr uint64_t aligned(uint64_t offset, uint64_t alignment) {
  return (offset + alignment - 1) / alignment * alignment;
}

/// Reverses the bytes of each word where the machine is big-endian.
template <typename Word>
Word little_endian(Word word) {
  if constexpr (std::endian::native == std::endian::little) return word;
  Word swapped = 0;
  for (size_t i = 0; i < sizeof(Word); ++i)
    swapped = static_cast<Word>(swapped << 8 | ((word >> (8 * i)) & 0xff));
  return swapped;
}

/// Writes into a buffer that is large enough, which its owner has computed.
class ByteWriter {
 public:
  explicit ByteWriter(std::span<std::byte> out) : out_(out) {}

  size_t position() const { return at_; }
  /// Moves on to `position`; what is skipped keeps what the buffer held.
  void skip_to(size_t position) { at_ = position; }

  void u16(uint16_t value) { word(value); }
  void u32(uint32_t value) { word(value); }
  void u64(uint64_t value) { word(value); }
  void f32(float value) { word(std::bit_cast<uint32_t>(value)); }
  void f64(double value) { word(std::bit_cast<uint64_t>(value)); }
  void vec3(const Vec3& v) { vector(v); }
  void bytes(const void* data, size_t size) {
    if (size > 0) std::memcpy(out_.subspan(at_, size).data(), data, size);
    at_ += size;
  }
  /// Vec2, Vec3, Vec4: their floats in order.
  template <typename Vector>
  void vector(const Vector& v) {
    for (uint32_t bits : std::bit_cast<std::array<uint32_t, sizeof(Vector) / 4>>(v)) word(bits);
  }

 private:
  template <typename Word>
  void word(Word value) {
    value = little_endian(value);
    std::memcpy(out_.data() + at_, &value, sizeof(Word));
    at_ += sizeof(Word);
  }

  std::span<std::byte> out_;
  size_t at_ = 0;
};

/// Reads from a buffer; past its end is kCorrupt.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> in) : in_(in) {}

  void skip_to(size_t position) { at_ = position; }

  uint16_t u16() { return word<uint16_t>(); }
  uint32_t u32() { return word<uint32_t>(); }
  uint64_t u64() { return word<uint64_t>(); }
  float f32() { return std::bit_cast<float>(word<uint32_t>()); }
  double f64() { return std::bit_cast<double>(word<uint64_t>()); }
  Vec3 vec3() { return vector<Vec3>(); }
  Range range() {
    const uint32_t offset = u32();
    return {offset, u32()};
  }

  template <typename Vector>
  Vector vector() {
    std::array<uint32_t, sizeof(Vector) / 4> bits;
    for (uint32_t& b : bits) b = u32();
    return std::bit_cast<Vector>(bits);
  }

  std::span<const std::byte> bytes(size_t size) {
    require(size);
    at_ += size;
    return in_.subspan(at_ - size, size);
  }

 private:
  void require(size_t size) const {
    if (at_ > in_.size() || size > in_.size() - at_)
      corrupt("a value at byte " + std::to_string(at_) + " lies past the end");
  }

  template <typename Word>
  Word word() {
    Word value;
    require(sizeof(Word));
    std::memcpy(&value, in_.data() + at_, sizeof(Word));
    at_ += sizeof(Word);
    return little_endian(value);
  }

  std::span<const std::byte> in_;
  size_t at_ = 0;
};

}  // namespace umbel
