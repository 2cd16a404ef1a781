#include "scale/route_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <string>

#include "base/bytes.hpp"
#include "base/hash.hpp"
#include "scale/whole_file.hpp"

namespace umbel::scale {
namespace {

constexpr uint64_t kRouteMagic = 0x00312E4554554F52u;  // "ROUTE.1"
constexpr size_t kHeaderBytes = 64, kEntryBytes = 32;

/// Words as bytes of a file, and back.
template <typename Value>
void swap_words(std::span<Value> values) {
  if constexpr (std::endian::native != std::endian::little) {
    for (Value& value : values) {
      auto words = std::bit_cast<std::array<uint32_t, sizeof(Value) / 4>>(value);
      for (uint32_t& word : words) word = little_endian(word);
      value = std::bit_cast<Value>(words);
    }
  }
}

template <typename Value>
void append(std::vector<std::byte>& bytes, const std::vector<Value>& values) {
  const size_t at = bytes.size(), size = values.size() * sizeof(Value);
  if (size == 0) return;
  bytes.resize(at + size);
  std::memcpy(bytes.data() + at, values.data(), size);
}

template <typename Value>
void take(std::span<const std::byte>& bytes, std::vector<Value>& values, size_t count) {
  values.resize(count);
  if (count == 0) return;
  std::memcpy(values.data(), bytes.data(), count * sizeof(Value));
  swap_words(std::span(values));
  bytes = bytes.subspan(count * sizeof(Value));
}

}  // namespace

RouteWriter::RouteWriter(const std::filesystem::path& path, uint32_t floats, bool has_materials)
    : file_(path), floats_(floats), has_materials_(has_materials), at_(kHeaderBytes) {}

void RouteWriter::add(uint32_t unit, const RouteSlice& slice) {
  bytes_.clear();
  append(bytes_, slice.vertices);
  append(bytes_, slice.triangles);
  append(bytes_, slice.materials);
  append(bytes_, slice.mail);
  if constexpr (std::endian::native != std::endian::little)
    swap_words(std::span(reinterpret_cast<uint32_t*>(bytes_.data()), bytes_.size() / 4));
  file_.write(at_, bytes_);
  index_.push_back({unit, static_cast<uint32_t>(slice.vertices.size() / floats_),
                    static_cast<uint32_t>(slice.triangles.size()),
                    static_cast<uint32_t>(slice.mail.size()), at_,
                    xxh64(bytes_.data(), bytes_.size(), unit)});
  at_ += bytes_.size();
}

void RouteWriter::commit() {
  bytes_.assign(index_.size() * kEntryBytes, {});
  ByteWriter out(bytes_);
  for (const Entry& e : index_) {
    for (uint32_t word : {e.unit, e.vertices, e.triangles, e.mail}) out.u32(word);
    out.u64(e.offset);
    out.u64(e.hash);
  }
  file_.write(at_, bytes_);
  std::array<std::byte, kHeaderBytes> header{};
  ByteWriter head(header);
  head.u64(kRouteMagic);
  head.u32(floats_);
  head.u32(has_materials_ ? 1 : 0);
  head.u64(index_.size());
  head.u64(at_);
  head.u64(xxh64(bytes_.data(), bytes_.size()));
  head.u64(xxh64(header.data(), head.position()));
  file_.write(0, header);
  file_.commit();
}

RouteFile::RouteFile(const std::filesystem::path& path) : path_(path), file_(path) {
  std::array<std::byte, kHeaderBytes> header{};
  if (file_.size() < kHeaderBytes) corrupt(path.string() + " is cut short");
  file_.read(0, header);
  ByteReader in(header);
  const uint64_t magic = in.u64();
  floats_ = in.u32();
  has_materials_ = in.u32() != 0;
  const uint64_t count = in.u64(), at = in.u64(), hash = in.u64();
  if (magic != kRouteMagic || in.u64() != xxh64(header.data(), kHeaderBytes - 24) || floats_ < 3)
    corrupt(path.string() + " is no routed part of a mesh, or is damaged");
  if (at > file_.size() || count != (file_.size() - at) / kEntryBytes ||
      (file_.size() - at) % kEntryBytes != 0)
    corrupt(path.string() + " has another size than it says");
  std::vector<std::byte> bytes(count * kEntryBytes);
  file_.read(at, bytes);
  if (xxh64(bytes.data(), bytes.size()) != hash) corrupt(path.string() + " has a damaged index");
  ByteReader entries(bytes);
  for (uint64_t k = 0; k < count; ++k) {
    const uint32_t unit = entries.u32(), vertices = entries.u32(), triangles = entries.u32();
    const uint32_t mail = entries.u32();
    const uint64_t offset = entries.u64();
    index_.push_back({unit, vertices, triangles, mail, offset, entries.u64()});
  }
}

const RouteWriter::Entry* RouteFile::find(uint32_t unit) const {
  const auto found =
      std::lower_bound(index_.begin(), index_.end(), unit,
                       [](const RouteWriter::Entry& e, uint32_t u) { return e.unit < u; });
  return found == index_.end() || found->unit != unit ? nullptr : &*found;
}

uint64_t RouteFile::triangles(uint32_t unit) const {
  const auto* entry = find(unit);
  return entry ? entry->triangles : 0;
}

uint64_t RouteFile::size_of(const RouteWriter::Entry& e) const {
  return 4 * (uint64_t{floats_} * e.vertices + uint64_t{has_materials_ ? 4u : 3u} * e.triangles +
              uint64_t{3} * e.mail);
}

SlicePlaces RouteFile::places() const {
  SlicePlaces places{file_.size(), {{0, kHeaderBytes}}, {}};
  places.common.emplace_back(file_.size() - index_.size() * kEntryBytes, file_.size());
  for (const RouteWriter::Entry& e : index_)
    places.slices.emplace_back(e.unit, e.offset, e.offset + size_of(e));
  return places;
}

RouteSlice RouteFile::read(uint32_t unit) const {
  RouteSlice slice;
  const auto* e = find(unit);
  if (!e) return slice;
  std::vector<std::byte> bytes(size_of(*e));
  file_.read(e->offset, bytes);
  if (xxh64(bytes.data(), bytes.size(), unit) != e->hash)
    corrupt(path_.string() + " is damaged: its part for unit " + std::to_string(unit) +
            " has another checksum");
  std::span<const std::byte> rest(bytes);
  take(rest, slice.vertices, size_t{floats_} * e->vertices);
  take(rest, slice.triangles, e->triangles);
  take(rest, slice.materials, has_materials_ ? e->triangles : 0);
  take(rest, slice.mail, e->mail);
  return slice;
}

void RouteFile::check() const {
  for (const RouteWriter::Entry& entry : index_) read(entry.unit);
}

bool is_whole_route(const std::filesystem::path& path) { return is_whole_file<RouteFile>(path); }

}  // namespace umbel::scale
