#include "asset/file/page_table.hpp"

#include <algorithm>

#include "asset/file/check_header.hpp"
#include "base/hash.hpp"

namespace umbel::asset {

std::vector<std::byte> read_slice(const ByteSource& source, const TableSection& table,
                                  uint64_t slice, const char* name) {
  const bool is_whole = table.slices.empty();
  const uint64_t first = is_whole ? 0 : slice * kSliceEntries;
  const uint64_t count = is_whole ? table.count : std::min(kSliceEntries, table.count - first);
  std::vector<std::byte> bytes(count * table.element_bytes);
  source.read(table.offset + first * table.element_bytes, bytes);
  if (xxh64(bytes.data(), bytes.size()) != (is_whole ? table.checksum : table.slices[slice]))
    corrupt(std::string("the checksum of ") + (is_whole ? "" : "a slice of ") + "the table of " +
            name + " does not hold");
  return bytes;
}

std::shared_ptr<const PageTable::Slice> PageTable::read(uint32_t slice) const {
  const TableSection& table = header_.page_table;
  const uint64_t first = slice * kSliceEntries;
  const std::vector<std::byte> bytes = read_slice(source_, table, slice, "pages");
  auto made = std::make_shared<Slice>();
  made->index = slice;
  made->pages = decode_pages(bytes, bytes.size() / table.element_bytes, table.element_bytes);
  check_pages(header_.info, made->pages, static_cast<uint32_t>(first), header_.info.header_bytes);
  return made;
}

PageEntry PageTable::in_slice(uint32_t page) const {
  const auto slice = static_cast<uint32_t>(page / kSliceEntries);
  std::shared_ptr<const Slice>& slot = kept_[slice % kKept];
  {
    const std::lock_guard lock(mutex_);
    if (slot && slot->index == slice) return slot->pages[page % kSliceEntries];
  }
  std::shared_ptr<const Slice> made = read(slice);
  const PageEntry entry = made->pages[page % kSliceEntries];
  const std::lock_guard lock(mutex_);
  slot = std::move(made);
  return entry;
}

}  // namespace umbel::asset
