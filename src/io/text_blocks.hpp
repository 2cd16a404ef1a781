// A text, from a file or from memory, as blocks of whole lines, so that threads can read it piece
// by piece and no more than a few pieces are in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/file.hpp"

namespace umbel::io {

inline bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

/// Bytes that are read at a position: a file's, or those in memory.
class ByteSource {
 public:
  explicit ByteSource(const InputFile& file) : file_(&file), size_(file.size()) {}
  explicit ByteSource(std::span<const std::byte> bytes) : bytes_(bytes), size_(bytes.size()) {}

  uint64_t size() const { return size_; }
  void read(uint64_t offset, std::span<std::byte> out) const;

 private:
  const InputFile* file_ = nullptr;
  std::span<const std::byte> bytes_;
  uint64_t size_;
};

/// Lines of a text. `text` holds `size` characters, the last of them '\n', and two more '\n' for
/// whoever reads beyond the last line.
struct TextBlock {
  uint64_t offset = 0;  ///< of the first character in the source
  size_t size = 0;
  std::string text;
  bool is_cut = false;  ///< the last line had no end: it is the text's last

  const char* begin() const { return text.data(); }
  const char* end() const { return text.data() + size; }
};

/// Takes a text apart. A line ends with '\n' (one that "\r\n" ends has blank space at its end), or
/// with '\r' in texts that have no '\n'. A backslash that only blank space parts from a line's end
/// continues the line, and such lines stay in one block.
class TextBlocks {
 public:
  TextBlocks(const ByteSource& source, size_t block_bytes);

  /// The block after the last one; false after all of them.
  bool next(TextBlock& block);
  /// The block of `size` characters from `offset` on again.
  void again(uint64_t offset, size_t size, TextBlock& block) const;

 private:
  void append(std::string& text, uint64_t offset, size_t count) const;

  const ByteSource& source_;
  size_t block_bytes_;
  uint64_t offset_ = 0;  // of the first byte that is in no block yet
  std::string rest_;     // the bytes from there on that have been read
  bool has_carriage_returns_ = false;
};

}  // namespace umbel::io
