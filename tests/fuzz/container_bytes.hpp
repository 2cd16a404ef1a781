// Files of arrays (base/container.hpp) for the fuzzers: their checksums are repaired, so that what
// lies behind them is reached.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "base/hash.hpp"
#include "scratch.hpp"

namespace umbel::fuzz {

using Bytes = std::vector<uint8_t>;

[[noreturn]] inline void fail(const std::string& what) {
  std::fprintf(stderr, "fuzz: %s\n", what.c_str());
  std::abort();
}

inline uint64_t get_word(const Bytes& bytes, size_t at) {
  uint64_t value = 0;
  for (size_t i = 0; i < 8; ++i) value |= uint64_t{bytes[at + i]} << (8 * i);
  return value;
}

inline void put_word(Bytes& bytes, size_t at, uint64_t value) {
  for (size_t i = 0; i < 8; ++i) bytes[at + i] = static_cast<uint8_t>(value >> (8 * i));
}

inline void repair_checksums(Bytes& bytes) {
  constexpr size_t kHeaderBytes = 192, kFirstSection = 112, kSectionBytes = 24;
  if (bytes.size() < kHeaderBytes) return;
  put_word(bytes, 16, bytes.size());
  for (size_t s = 0; s < 3; ++s) {
    const size_t entry = kFirstSection + s * kSectionBytes;
    const uint64_t offset = get_word(bytes, entry), size = get_word(bytes, entry + 8);
    if (offset > bytes.size() || size > bytes.size() - offset) continue;
    put_word(bytes, entry + 16, xxh64(bytes.data() + offset, size));
  }
  put_word(bytes, kHeaderBytes - 8, xxh64(bytes.data(), kHeaderBytes - 8));
}

inline void write_file(const Bytes& bytes) {
  std::ofstream file(scratch(), std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) fail("the scratch file cannot be written");
}

/// The file that a save to scratch() has just made.
inline Bytes read_file() {
  std::ifstream file(scratch(), std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// The first byte chooses a whole file, without which no mutation would ever get past the magic;
/// the rest says what to change in it. With a first byte of 255 the rest is the file.
inline Bytes file_of(const std::vector<Bytes>& seeds, const uint8_t* data, size_t size) {
  if (size == 0) return {};
  if (data[0] == 255) return {data + 1, data + size};
  Bytes bytes = seeds[data[0] % seeds.size()];
  for (size_t i = 1; i + 4 <= size; i += 4) {
    const size_t word = (data[i] | size_t{data[i + 1]} << 8) % (bytes.size() / 4);
    const size_t at = 4 * word + data[i + 2] % 4;
    bytes[at] = data[i + 3];
    // Large numbers are beyond most ranges, and small ones within.
    if (data[i + 2] & 0x40) std::memset(&bytes[4 * word], data[i + 3], 4);
    if (data[i + 2] & 0x80)
      bytes.resize(bytes.size() - std::min<size_t>(data[i + 3] % 64, bytes.size()));
    if (bytes.size() < 8) break;
  }
  return bytes;
}

}  // namespace umbel::fuzz
