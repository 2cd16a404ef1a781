#include "scale/work_file.hpp"

#include <algorithm>

#include "scale/whole_file.hpp"

namespace umbel::scale {
namespace {

// The last bytes of a file: where the index begins, how many entries it has, its hash, the magic.
constexpr size_t kTail = 32;
constexpr uint64_t kWorkMagic = 0x31534c4953424d55;  // "UMBSLIS1"

}  // namespace

void SliceWriter::add(uint32_t unit, std::span<const std::byte> bytes) {
  file_.write(at_, bytes);
  index_.push_back({unit, at_, bytes.size(), xxh64(bytes.data(), bytes.size())});
  at_ += bytes.size();
}

void SliceWriter::commit() {
  const std::span<const std::byte> index = std::as_bytes(std::span(index_));
  file_.write(at_, index);
  const uint64_t tail[] = {at_, index_.size(), xxh64(index.data(), index.size()), kWorkMagic};
  file_.write(at_ + index.size(), std::as_bytes(std::span(tail)));
  file_.commit();
}

SliceReader::SliceReader(const std::filesystem::path& path) : path_(path), file_(path) {
  uint64_t tail[4] = {};
  static_assert(sizeof tail == kTail);
  const auto refuse = [&] { corrupt("the work file " + path.string() + " is damaged"); };
  if (file_.size() < kTail) refuse();
  file_.read(file_.size() - kTail, std::as_writable_bytes(std::span(tail)));
  const uint64_t room = file_.size() - kTail;
  if (tail[3] != kWorkMagic || tail[1] > room / sizeof(SliceWriter::Entry) ||
      tail[0] != room - tail[1] * sizeof(SliceWriter::Entry))
    refuse();
  index_.resize(tail[1]);
  const std::span<std::byte> index = std::as_writable_bytes(std::span(index_));
  file_.read(tail[0], index);
  if (xxh64(index.data(), index.size()) != tail[2]) refuse();
}

std::vector<std::byte> SliceReader::read(uint32_t unit) const {
  const auto found =
      std::ranges::lower_bound(index_, uint64_t{unit}, {}, &SliceWriter::Entry::unit);
  if (found == index_.end() || found->unit != unit) return {};
  std::vector<std::byte> bytes(found->bytes);
  file_.read(found->offset, bytes);
  if (xxh64(bytes.data(), bytes.size()) != found->hash)
    corrupt("the work file " + path_.string() + " is damaged");
  return bytes;
}

void SliceReader::check() const {
  for (const SliceWriter::Entry& entry : index_) read(static_cast<uint32_t>(entry.unit));
}

SlicePlaces SliceReader::places() const {
  const uint64_t index = file_.size() - kTail - index_.size() * sizeof(SliceWriter::Entry);
  SlicePlaces places{file_.size(), {{index, file_.size()}}, {}};
  for (const SliceWriter::Entry& e : index_)
    places.slices.emplace_back(static_cast<uint32_t>(e.unit), e.offset, e.offset + e.bytes);
  return places;
}

namespace {

struct PlacesRecord {
  std::vector<uint64_t> bytes, common, slices;
};

template <typename Visit>
void for_each_array(PlacesRecord& record, Visit& visit) {
  visit(record.bytes), visit(record.common), visit(record.slices);
}

}  // namespace

void write_places(const std::filesystem::path& path, const SlicePlaces& places) {
  PlacesRecord record{{places.bytes}, {}, {}};
  for (const auto& [begin, end] : places.common)
    record.common.insert(record.common.end(), {begin, end});
  for (const auto& [unit, begin, end] : places.slices)
    record.slices.insert(record.slices.end(), {unit, begin, end});
  write_record(path, record);
}

SlicePlaces read_places(const std::filesystem::path& path) {
  const auto record = read_record<PlacesRecord>(path);
  SlicePlaces places{record.bytes.at(0), {}, {}};
  for (size_t i = 0; i + 1 < record.common.size(); i += 2)
    places.common.emplace_back(record.common[i], record.common[i + 1]);
  for (size_t i = 0; i + 2 < record.slices.size(); i += 3)
    places.slices.emplace_back(static_cast<uint32_t>(record.slices[i]), record.slices[i + 1],
                               record.slices[i + 2]);
  return places;
}

bool is_whole(const std::filesystem::path& path) { return is_whole_file<SliceReader>(path); }

}  // namespace umbel::scale
