#include "base/container.hpp"

#include <algorithm>
#include <bit>
#include <vector>

#include "base/hash.hpp"
#include "base/parallel.hpp"

namespace umbel {
namespace {

constexpr uint64_t kHeaderBytes = 192, kAlignment = 64;
constexpr size_t kFirstField = 24, kFirstSection = 112;
static_assert(kFirstField + sizeof(ContainerFields) == kFirstSection);

using Header = std::array<std::byte, kHeaderBytes>;

/// The file's words as this machine's, or the reverse.
void swap_words(std::span<std::byte> bytes) {
  for (size_t i = 0; i + 4 <= bytes.size(); i += 4) {
    uint32_t word;
    std::memcpy(&word, bytes.data() + i, 4);
    word = little_endian(word);
    std::memcpy(bytes.data() + i, &word, 4);
  }
}

/// Checksums of large arrays take as long as reading them, so each is hashed on its own core.
std::array<uint64_t, kContainerArrays> checksums(const ContainerBytes& arrays) {
  std::array<uint64_t, kContainerArrays> sums{};
  parallel_for(kContainerArrays, 1,
               [&](size_t i) { sums[i] = xxh64(arrays[i].data(), arrays[i].size()); });
  return sums;
}

void write_little_endian(const std::string& path, const ContainerKind& kind,
                         const ContainerFields& fields, const ContainerBytes& arrays) {
  OutputFile file(path);
  Header header{};
  ByteWriter out(header);
  const auto sums = checksums(arrays);
  uint64_t end = kHeaderBytes;
  out.skip_to(kFirstSection);
  for (size_t i = 0; i < kContainerArrays; ++i) {
    const uint64_t offset = aligned(end, kAlignment);
    const std::array<std::byte, kAlignment> zeros{};
    file.write(end, std::span(zeros).first(offset - end));
    file.write(offset, arrays[i]);
    out.u64(offset), out.u64(arrays[i].size()), out.u64(sums[i]);
    end = offset + arrays[i].size();
  }
  const size_t checked = out.position();
  out.skip_to(0);
  out.bytes(kind.magic.data(), kind.magic.size());
  out.u16(kind.major), out.u16(kind.minor);
  out.u32(static_cast<uint32_t>(kHeaderBytes));
  out.u64(end);
  out.bytes(fields.data(), fields.size());
  out.skip_to(checked);
  out.u64(xxh64(header.data(), checked));
  file.write(0, header);
  file.commit();
}

}  // namespace

void write_container(const std::string& path, const ContainerKind& kind,
                     const ContainerFields& fields, const ContainerBytes& arrays) {
  if constexpr (std::endian::native == std::endian::little)
    return write_little_endian(path, kind, fields, arrays);
  std::array<std::vector<std::byte>, kContainerArrays> swapped;
  ContainerBytes views;
  for (size_t i = 0; i < kContainerArrays; ++i) {
    swapped[i].assign(arrays[i].begin(), arrays[i].end());
    swap_words(swapped[i]);
    views[i] = swapped[i];
  }
  write_little_endian(path, kind, fields, views);
}

ContainerFile::ContainerFile(const std::string& path, const ContainerKind& kind) : file_(path) {
  decode(kind);
  check_sections();
}

void ContainerFile::decode(const ContainerKind& kind) {
  if (file_.size() < kHeaderBytes) corrupt("it is shorter than a header");
  Header bytes;
  file_.read(0, bytes);
  if (std::memcmp(bytes.data(), kind.magic.data(), kind.magic.size()) != 0)
    corrupt(std::string("it does not begin as a ") + kind.extension + " file does");
  ByteReader in(bytes);
  in.skip_to(kHeaderBytes - 8);
  const uint64_t checksum = in.u64();
  in.skip_to(kind.magic.size());
  const uint16_t major = in.u16();
  if (checksum != xxh64(bytes.data(), kHeaderBytes - 8))
    corrupt("the header's checksum does not fit");
  if (major != kind.major)
    throw Error(ErrorCode::kUnsupported, "its format version is " + std::to_string(major) +
                                             ", this library reads " + std::to_string(kind.major));
  in.u16();
  if (in.u32() != kHeaderBytes) corrupt("the header's size is wrong");
  if (in.u64() != file_.size()) corrupt("the file is not as long as its header says");
  const auto fields = in.bytes(fields_.size());
  std::copy(fields.begin(), fields.end(), fields_.begin());
  for (Section& section : sections_)
    section.offset = in.u64(), section.bytes = in.u64(), section.checksum = in.u64();
}

void ContainerFile::check_sections() const {
  uint64_t end = kHeaderBytes;
  for (const Section& section : sections_) {
    if (section.offset != aligned(end, kAlignment) || section.offset > file_.size() ||
        section.bytes > file_.size() - section.offset || section.bytes % 4 != 0)
      corrupt("its arrays are not where they should be");
    // So that every byte of a file is accounted for.
    std::array<std::byte, kAlignment> padding{};
    const std::span between = std::span(padding).first(section.offset - end);
    file_.read(end, between);
    if (std::any_of(between.begin(), between.end(), [](std::byte b) { return b != std::byte{0}; }))
      corrupt("bytes between its arrays are not zero");
    end = section.offset + section.bytes;
  }
  if (end != file_.size()) corrupt("bytes follow its last array");
}

void ContainerFile::read(const ContainerArrays& arrays) const {
  for (size_t i = 0; i < kContainerArrays; ++i) file_.read(sections_[i].offset, arrays[i]);
  ContainerBytes bytes;
  std::copy(arrays.begin(), arrays.end(), bytes.begin());
  const auto sums = checksums(bytes);
  for (size_t i = 0; i < kContainerArrays; ++i)
    if (sums[i] != sections_[i].checksum)
      corrupt("the checksum of array " + std::to_string(i) + " does not fit");
  if constexpr (std::endian::native != std::endian::little)
    for (const std::span<std::byte> array : arrays) swap_words(array);
}

}  // namespace umbel
