// Files that hold three arrays as they are in memory, aligned so that a file can be mapped: a
// header of 192 bytes, and the arrays. Everything is little-endian.
//
//   bytes 0..8     magic
//         8..24    u16 major, u16 minor, u32 header's bytes, u64 file's bytes
//        24..112   fields of the kind of file, and zeros
//       112..184   for each array: u64 offset, u64 bytes, u64 XXH64
//       184..192   XXH64 of the header so far
//
// Arrays begin at multiples of 64 bytes, zeros lie between, and the last one ends the file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/bytes.hpp"
#include "base/file.hpp"

namespace umbel {

struct ContainerKind {
  const char* extension;
  std::array<char, 8> magic;
  uint16_t major, minor;
};

inline constexpr size_t kContainerArrays = 3;
using ContainerFields = std::array<std::byte, 88>;
using ContainerArrays = std::array<std::span<std::byte>, kContainerArrays>;
using ContainerBytes = std::array<std::span<const std::byte>, kContainerArrays>;

/// Arrays as bytes, to be filled or to be kept.
template <typename... Arrays>
ContainerArrays container_arrays(Arrays&... arrays) {
  return {std::as_writable_bytes(std::span(arrays))...};
}
template <typename... Arrays>
ContainerBytes container_bytes(const Arrays&... arrays) {
  return {std::as_bytes(std::span(arrays))...};
}

/// Arrays of 32-bit words. Written beside `path`, then renamed.
void write_container(const std::string& path, const ContainerKind& kind,
                     const ContainerFields& fields, const ContainerBytes& arrays);

/// Throws kIo, kCorrupt, or kUnsupported for another major version.
class ContainerFile {
 public:
  /// Checks all but the arrays' contents.
  ContainerFile(const std::string& path, const ContainerKind& kind);

  const ContainerFields& fields() const { return fields_; }
  uint64_t bytes(size_t array) const { return sections_[array].bytes; }
  /// Fills the arrays, which have their sizes, and checks their checksums.
  void read(const ContainerArrays& arrays) const;

 private:
  struct Section {
    uint64_t offset, bytes, checksum;
  };

  void decode(const ContainerKind& kind);
  void check_sections() const;

  InputFile file_;
  ContainerFields fields_{};
  std::array<Section, kContainerArrays> sections_{};
};

/// Runs read(), and adds the file's name to what is said about its contents.
template <typename Read>
auto reading(const std::string& path, const Read& read) {
  try {
    return read();
  } catch (const Error& error) {
    // Sentences of the system name the file themselves.
    if (error.code() == ErrorCode::kIo) throw;
    throw Error(error.code(), path + " cannot be read: " + error.what());
  }
}

}  // namespace umbel
