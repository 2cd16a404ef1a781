// Where pages are: the table of pages, all of it in memory, or read in slices as it is asked for.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <vector>

#include "asset/file/format.hpp"

namespace umbel::asset {

/// Safe to use from many threads.
class PageTable {
 public:
  /// Takes the header's pages, or reads slices from `source`. Both must outlive this.
  PageTable(const FileHeader& header, const ByteSource& source)
      : header_(header), source_(source) {}

  uint32_t size() const { return header_.info.pages; }
  /// Throws kCorrupt where a slice's checksum does not hold or a page lies outside the file, and
  /// what reading throws.
  PageEntry at(uint32_t page) const {
    return header_.has_page_slices ? in_slice(page) : header_.pages[page];
  }

 private:
  /// At most 2 MB of slices are kept: one for each remainder of their number.
  static constexpr uint32_t kKept = 16;
  struct Slice {
    uint32_t index;
    std::vector<PageEntry> pages;
  };

  PageEntry in_slice(uint32_t page) const;
  std::shared_ptr<const Slice> read(uint32_t slice) const;

  const FileHeader& header_;
  const ByteSource& source_;
  mutable std::mutex mutex_;
  mutable std::array<std::shared_ptr<const Slice>, kKept> kept_;
};

/// The entries of one slice of a table, their checksum checked. A table without checksums of slices
/// is one slice.
std::vector<std::byte> read_slice(const ByteSource& source, const TableSection& table,
                                  uint64_t slice, const char* name);

}  // namespace umbel::asset
