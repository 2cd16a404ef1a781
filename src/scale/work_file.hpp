// Files of a work folder: arrays as they are in memory, read by the same build of the library on
// the same kind of machine. Written beside and renamed; a changed byte is found.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "base/bytes.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"
#include "scale/slice_places.hpp"

namespace umbel::scale {

/// Appends arrays to bytes.
class ArrayWriter {
 public:
  template <typename Value>
  void operator()(const std::vector<Value>& values) {
    static_assert(std::is_trivially_copyable_v<Value>);
    const uint64_t count = values.size();
    append(&count, sizeof count);
    append(values.data(), count * sizeof(Value));
  }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  void append(const void* data, size_t size) {
    const size_t at = bytes_.size();
    bytes_.resize(at + size);
    if (size > 0) std::memcpy(bytes_.data() + at, data, size);
  }
  std::vector<std::byte> bytes_;
};

/// Takes them back, in the same order.
class ArrayReader {
 public:
  explicit ArrayReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <typename Value>
  void operator()(std::vector<Value>& values) {
    uint64_t count = 0;
    std::memcpy(&count, take(sizeof count).data(), sizeof count);
    if (count > bytes_.size() / sizeof(Value)) corrupt("a work file's array is longer than it");
    const std::span<const std::byte> from = take(count * sizeof(Value));
    values.resize(count);
    if (count > 0) std::memcpy(values.data(), from.data(), from.size());
  }

 private:
  std::span<const std::byte> take(size_t size) {
    if (size > bytes_.size()) corrupt("a work file ends too early");
    const auto taken = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return taken;
  }
  std::span<const std::byte> bytes_;
};

/// Bytes of several units in one file, rising by unit.
class SliceWriter {
 public:
  explicit SliceWriter(const std::filesystem::path& path) : file_(path), path_(path) {}
  void add(uint32_t unit, std::span<const std::byte> bytes);
  void commit();

 private:
  friend class SliceReader;
  struct Entry {
    uint64_t unit, offset, bytes, hash;
  };
  OutputFile file_;
  std::filesystem::path path_;
  uint64_t at_ = 0;
  std::vector<Entry> index_;
};

class SliceReader {
 public:
  /// Throws kIo and kCorrupt.
  explicit SliceReader(const std::filesystem::path& path);
  /// Empty for a unit that the file has nothing for.
  std::vector<std::byte> read(uint32_t unit) const;
  /// Reads all of it. Throws kCorrupt where a byte has changed.
  void check() const;
  SlicePlaces places() const;

 private:
  std::filesystem::path path_;
  InputFile file_;
  std::vector<SliceWriter::Entry> index_;
};

/// Whether a file of slices is there, and every byte of it is as it was written.
bool is_whole(const std::filesystem::path& path);

template <typename Record>
std::vector<std::byte> bytes_of(Record& record) {
  ArrayWriter out;
  for_each_array(record, out);
  return out.take();
}

template <typename Record>
Record record_of(std::span<const std::byte> bytes) {
  Record record;
  ArrayReader in(bytes);
  for_each_array(record, in);
  return record;
}

/// Files of their own for places.
void write_places(const std::filesystem::path& path, const SlicePlaces& places);
SlicePlaces read_places(const std::filesystem::path& path);

/// A file of one record.
template <typename Record>
void write_record(const std::filesystem::path& path, Record& record) {
  SliceWriter out(path);
  out.add(0, bytes_of(record));
  out.commit();
}
template <typename Record>
Record read_record(const std::filesystem::path& path) {
  return record_of<Record>(SliceReader(path).read(0));
}

}  // namespace umbel::scale
