// Rows of tables by number: neighbours are read at once.
#pragma once

#include <span>
#include <vector>

#include "base/file.hpp"
#include "io/source/column.hpp"

namespace umbel::io {

/// Calls take(begin, end, bytes) for runs of rows ids[begin] to ids[end - 1] that are best read at
/// once, and how many bytes that is. `ids` rise; `row_end` bytes of a row are needed.
template <typename Take>
void for_runs(const Table& table, uint64_t row_end, std::span<const uint32_t> ids,
              const Take& take) {
  // One read costs about as much as copying this much.
  constexpr uint64_t kGap = uint64_t{1} << 14;
  constexpr uint64_t kMost = uint64_t{1} << 20;
  for (size_t begin = 0; begin < ids.size();) {
    size_t end = begin + 1;
    const auto span_to = [&](size_t k) { return (ids[k] - ids[begin]) * table.stride + row_end; };
    while (end < ids.size() && (ids[end] - ids[end - 1]) * table.stride <= kGap &&
           span_to(end) <= kMost)
      ++end;
    take(begin, end, span_to(end - 1));
    begin = end;
  }
}

/// Appends the column's values of the rows `ids`, which rise, row by row.
template <typename Out>
void gather(const InputFile& file, const Table& table, const Column& column,
            std::span<const uint32_t> ids, std::vector<Out>& out) {
  const size_t width = column.offsets.size(), base = out.size();
  out.resize(base + ids.size() * width);
  std::vector<std::byte> bytes;
  for_runs(table, column.end(), ids, [&](size_t begin, size_t end, uint64_t size) {
    bytes.resize(size);
    file.read(table.offset + ids[begin] * table.stride, bytes);
    with_type(column.type, [&]<typename T>(T) {
      for (size_t k = 0; k < width; ++k)
        for (size_t i = begin; i < end; ++i) {
          const std::byte* row = bytes.data() + (ids[i] - ids[begin]) * table.stride;
          out[base + i * width + k] =
              converted<Out>(load_scalar<T>(row + column.offsets[k], table.big_endian), column);
        }
    });
  });
}

/// The same of the rows [begin, end).
template <typename Out>
void gather(const InputFile& file, const Table& table, const Column& column, uint64_t begin,
            uint64_t end, std::vector<Out>& out) {
  constexpr uint64_t kMost = uint64_t{1} << 20;
  const size_t width = column.offsets.size();
  size_t at = out.size();
  out.resize(at + (end - begin) * width);
  std::vector<std::byte> bytes;
  const uint64_t step = std::max<uint64_t>(1, kMost / table.stride);
  for (uint64_t row = begin; row < end; row += step) {
    const uint64_t count = std::min(step, end - row);
    bytes.resize((count - 1) * table.stride + column.end());
    file.read(table.offset + row * table.stride, bytes);
    with_type(column.type, [&]<typename T>(T) {
      for (size_t k = 0; k < width; ++k)
        for (uint64_t i = 0; i < count; ++i)
          out[at + i * width + k] = converted<Out>(
              load_scalar<T>(bytes.data() + i * table.stride + column.offsets[k], table.big_endian),
              column);
    });
    at += count * width;
  }
}

}  // namespace umbel::io
