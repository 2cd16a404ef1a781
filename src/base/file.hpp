// Files: read at a position from any thread, and written beside the target
// and renamed, so that a file of that name is always whole.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

namespace umbel {

class InputFile {
 public:
  /// Throws kIo if there is no regular file of that name, or it may not be read.
  explicit InputFile(const std::filesystem::path& path);
  InputFile(const InputFile&) = delete;
  ~InputFile();

  /// Bytes when it was opened.
  uint64_t size() const { return size_; }
  /// Fills `out` from `offset` on. Safe from many threads. Throws kIo, and kCorrupt if the file
  /// has become shorter.
  void read(uint64_t offset, std::span<std::byte> out) const;

 private:
  struct Handle;
  std::filesystem::path path_;
  std::unique_ptr<Handle> handle_;
  uint64_t size_ = 0;
};

class OutputFile {
 public:
  /// Makes an empty file of a new name beside `path`. Throws kIo.
  explicit OutputFile(const std::filesystem::path& path);
  OutputFile(const OutputFile&) = delete;
  /// Removes the file unless it was committed.
  ~OutputFile();

  void write(uint64_t offset, std::span<const std::byte> bytes);
  /// Flushes to the disk and gives the file its name.
  void commit();
  /// Only gives the file its name: for files that nobody reads after a crash of the machine.
  void commit_unflushed();

 private:
  struct Handle;
  std::filesystem::path target_, temporary_;
  std::unique_ptr<Handle> handle_;
};

/// What does not fit into memory: a file without a name, gone once it is closed or the process
/// ends, however it does. One thread at a time.
class TemporaryFile {
 public:
  /// In a folder; empty: the system's for temporary files. Throws kIo.
  explicit TemporaryFile(const std::filesystem::path& folder);
  TemporaryFile(const TemporaryFile&) = delete;
  ~TemporaryFile();

  uint64_t size() const { return size_; }
  void append(std::span<const std::byte> bytes);
  /// Fills `out` from `offset` on, all of it within size().
  void read(uint64_t offset, std::span<std::byte> out) const;

 private:
  struct Handle;
  std::filesystem::path path_;
  std::unique_ptr<Handle> handle_;
  uint64_t size_ = 0;
};

}  // namespace umbel
