#include "asset/file/header_frame.hpp"

#include <cstring>
#include <optional>
#include <string>

#include "asset/file/check_header.hpp"
#include "asset/file/coarse_groups.hpp"
#include "asset/instances/tree_file.hpp"
#include "base/bytes.hpp"
#include "base/hash.hpp"
#include "base/math.hpp"

namespace umbel::asset {
namespace {

// As in PNG: transfers that rewrite line ends or clear the eighth bit damage it.
constexpr std::array<unsigned char, 8> kMagic{0xAB, 'U', 'M', 'B', 'L', '\r', '\n', 0x1A};
constexpr uint64_t kFixedHeaderBytes = 128, kMaxFixedHeaderBytes = 4096;
constexpr uint64_t kSectionEntryBytes = 40;
constexpr uint32_t kMaxSections = 1024;

constexpr uint32_t four_letters(const char (&name)[5]) {
  return static_cast<uint32_t>(name[0]) | static_cast<uint32_t>(name[1]) << 8 |
         static_cast<uint32_t>(name[2]) << 16 | static_cast<uint32_t>(name[3]) << 24;
}

struct SectionKind {
  uint32_t id;
  const char* name;
  uint32_t element_bytes;
  bool in_header = true;
  bool is_optional = false;  // absent if empty
};

constexpr std::array<SectionKind, kSectionCount> kSections{
    {{four_letters("META"), "META", 1},
     {four_letters("MTRL"), "MTRL", 1},
     {four_letters("ATTR"), "ATTR", 24},
     {four_letters("MESH"), "MESH", 88},
     {four_letters("LEVL"), "LEVL", 8},
     {four_letters("ROOT"), "ROOT", 32},
     {four_letters("INST"), "INST", 64},
     {four_letters("FILE"), "FILE", 24},
     {four_letters("PAGE"), "PAGE", 24},
     {four_letters("NODE"), "NODE", kNodeBytes, false},
     {four_letters("ORIG"), "ORIG", 24, true, true},
     {four_letters("SCEN"), "SCEN", 1, true, true},
     {four_letters("PSUM"), "PSUM", 8, true, true},
     {four_letters("NSUM"), "NSUM", 8, true, true},
     {four_letters("IERR"), "IERR", 4, true, true},
     {four_letters("ITRE"), "ITRE", kInstanceNodeBytes, false, true},
     {four_letters("IPAG"), "IPAG", 1, false, true},
     {four_letters("CREF"), "CREF", kCoarseBytes, false, true}}};

void write_fixed_header(ByteWriter& out, const AssetInfo& info, const Layout& layout,
                        uint64_t tables_checksum, uint64_t opening_checksum) {
  out.bytes(kMagic.data(), kMagic.size());
  out.u16(kVersionMajor);
  out.u16(kVersionMinor);
  out.u32(kFixedHeaderBytes);
  out.u64(info.file_bytes);
  out.u64(layout.bytes);
  out.u64(tables_checksum);
  out.u32(layout.section_count());
  out.u32(info.page_bytes);
  out.u32(info.max_triangles);
  out.u32(info.max_vertices);
  out.u64(layout.opening_bytes);
  out.u64(opening_checksum);
}

void check_section(const SectionKind& kind, const Section& section, uint64_t bytes,
                   const FixedHeader& fixed) {
  const AssetInfo& info = fixed.info;
  const std::string name = std::string("section ") + kind.name;
  const uint64_t read = fixed.opening_bytes == 0 ? info.header_bytes : fixed.opening_bytes;
  const bool stands_apart = fixed.opening_bytes != 0 && &kind == &kSections[kPages];
  const bool fits = stands_apart ? inside(section.offset, bytes, read, info.header_bytes)
                    : kind.in_header
                        ? inside(section.offset, bytes, 0, read)
                        : inside(section.offset, bytes, info.header_bytes, info.file_bytes);
  if (!fits)
    corrupt(name + " of " + std::to_string(bytes) + " bytes at byte " +
            std::to_string(section.offset) + " is not where it must be");
  if (section.element_bytes < kind.element_bytes)
    corrupt(name + " has elements of " + std::to_string(section.element_bytes) +
            " bytes, but they need " + std::to_string(kind.element_bytes));
  // Divided, not multiplied: a product could overflow.
  if (bytes % section.element_bytes != 0 || section.count != bytes / section.element_bytes)
    corrupt(name + " has " + std::to_string(section.count) + " elements, but " +
            std::to_string(bytes) + " bytes");
  if (section.count >= kNone && kind.element_bytes > 1)
    corrupt(name + " has more elements than 32-bit indices can name");
}

}  // namespace

bool Layout::has(size_t section) const {
  return !kSections[section].is_optional || sections[section].count > 0;
}

uint32_t Layout::section_count() const {
  uint32_t count = 0;
  for (size_t i = 0; i < kSectionCount; ++i) count += has(i);
  return count;
}

std::vector<Vec3d> origins_of(const FileHeader& header) {
  if (header.info.origin == Vec3d{}) return {};
  return {header.info.origin};
}

Layout layout_of(const FileHeader& header) {
  const uint64_t counts[kSectionCount] = {
      header.info.metadata.size(),
      header.materials.size(),
      header.attributes.size(),
      header.meshes.size(),
      header.levels.size(),
      header.roots.size(),
      header.instances.size(),
      header.files.size(),
      header.pages.size(),
      header.nodes.count,
      origins_of(header).size(),
      header.scene.size(),
      header.has_page_slices ? slices_of(header.pages.size()) : 0,
      header.nodes.slices.size(),
      header.coarsest_errors.size(),
      header.instance_nodes.count,
      header.instance_pages.count,
      header.coarse.count};
  Layout layout{};
  for (size_t i = 0; i < kSectionCount; ++i)
    layout.sections[i] = {0, counts[i], kSections[i].element_bytes, 0};
  uint64_t at = kFixedHeaderBytes + layout.section_count() * kSectionEntryBytes;
  const auto add = [&](size_t i) {
    layout.sections[i].offset = at;
    if (kSections[i].in_header) at = aligned(at + counts[i] * kSections[i].element_bytes, 8);
  };
  for (size_t i = 0; i < kSectionCount; ++i)
    if (i != kPages || !header.has_page_slices) add(i);
  if (header.has_page_slices) {
    layout.opening_bytes = at;
    add(kPages);
  }
  const auto place = [&](size_t i, const TableSection& table) {
    layout.sections[i].offset = table.offset;
    layout.sections[i].checksum = table.checksum;
  };
  place(kNodes, header.nodes);
  place(kCoarseGroups, header.coarse);
  place(kInstanceNodes, header.instance_nodes);
  place(kInstancePages, header.instance_pages);
  layout.bytes = aligned(at, kPageAlignment);
  return layout;
}

uint64_t header_bytes(const FileHeader& header) { return layout_of(header).bytes; }

void write_frame(std::span<std::byte> header, const AssetInfo& info, const Layout& layout) {
  ByteWriter out(header);
  out.skip_to(kFixedHeaderBytes);
  for (size_t i = 0; i < kSectionCount; ++i) {
    if (!layout.has(i)) continue;
    const Section& section = layout.sections[i];
    const uint64_t size = section.count * section.element_bytes;
    out.u32(kSections[i].id);
    out.u32(section.element_bytes);
    out.u64(section.offset);
    out.u64(size);
    out.u64(section.count);
    out.u64(kSections[i].in_header ? xxh64(header.data() + section.offset, size)
                                   : section.checksum);
  }
  out.skip_to(0);
  write_fixed_header(out, info, layout,
                     xxh64(header.data() + kFixedHeaderBytes, header.size() - kFixedHeaderBytes),
                     layout.opening_bytes == 0 ? 0
                                               : xxh64(header.data() + kFixedHeaderBytes,
                                                       layout.opening_bytes - kFixedHeaderBytes));
  out.skip_to(kFixedHeaderBytes - 8);
  out.u64(xxh64(header.data(), kFixedHeaderBytes - 8));
}

FixedHeader read_fixed_header(std::span<const std::byte> bytes) {
  FixedHeader fixed;
  AssetInfo& info = fixed.info;
  ByteReader in(bytes);
  in.skip_to(kMagic.size());
  info.version_major = in.u16();
  info.version_minor = in.u16();
  fixed.bytes = in.u32();
  info.file_bytes = in.u64();
  info.header_bytes = in.u64();
  fixed.tables_checksum = in.u64();
  fixed.sections = in.u32();
  info.page_bytes = in.u32();
  info.max_triangles = in.u32();
  info.max_vertices = in.u32();
  fixed.opening_bytes = in.u64();
  fixed.opening_checksum = in.u64();
  in.skip_to(fixed.bytes - 8);
  info.checksum = in.u64();
  return fixed;
}

Sections read_sections(std::span<const std::byte> header, const FixedHeader& fixed) {
  if (fixed.sections > kMaxSections)
    corrupt("the section table has " + std::to_string(fixed.sections) + " entries");
  std::array<std::optional<Section>, kSectionCount> found;
  ByteReader in(header);
  for (uint32_t i = 0; i < fixed.sections; ++i) {
    in.skip_to(fixed.bytes + i * kSectionEntryBytes);
    const uint32_t id = in.u32(), element_bytes = in.u32();
    const uint64_t offset = in.u64(), bytes = in.u64(), count = in.u64(), checksum = in.u64();
    for (size_t kind = 0; kind < kSectionCount; ++kind) {
      if (kSections[kind].id != id) continue;
      if (found[kind]) corrupt(std::string("section ") + kSections[kind].name + " is there twice");
      found[kind] = Section{offset, count, element_bytes, checksum};
      check_section(kSections[kind], *found[kind], bytes, fixed);
    }
  }
  Sections sections;
  for (size_t kind = 0; kind < kSectionCount; ++kind) {
    if (!found[kind] && !kSections[kind].is_optional)
      corrupt(std::string("section ") + kSections[kind].name + " is missing");
    sections[kind] = found[kind].value_or(Section{});
  }
  return sections;
}

uint64_t fixed_header_bytes_in(std::span<const std::byte> prologue) {
  if (prologue.size() < kPrologueBytes ||
      std::memcmp(prologue.data(), kMagic.data(), kMagic.size()) != 0)
    corrupt("this is not a .umbel file");
  ByteReader in(prologue);
  in.skip_to(12);
  const uint64_t bytes = in.u32();
  if (bytes < kFixedHeaderBytes || bytes > kMaxFixedHeaderBytes || bytes % 8 != 0)
    corrupt("the header says that it has " + std::to_string(bytes) + " bytes");
  return bytes;
}

uint64_t opening_bytes_in(std::span<const std::byte> bytes, uint64_t file_bytes) {
  ByteReader in(bytes);
  in.skip_to(bytes.size() - 8);
  if (in.u64() != xxh64(bytes.data(), bytes.size() - 8))
    corrupt("the header's checksum does not hold");
  in.skip_to(8);
  if (const uint16_t major = in.u16(); major < kOldestMajor || major > kVersionMajor)
    throw Error(ErrorCode::kUnsupported, "the file has format version " + std::to_string(major) +
                                             ", but this Umbel reads versions " +
                                             std::to_string(kOldestMajor) + " to " +
                                             std::to_string(kVersionMajor));
  const FixedHeader fixed = read_fixed_header(bytes);
  if (fixed.info.file_bytes != file_bytes)
    corrupt("the header says that the file has " + std::to_string(fixed.info.file_bytes) +
            " bytes, but it has " + std::to_string(file_bytes));
  if (fixed.info.header_bytes < bytes.size() || fixed.info.header_bytes > file_bytes)
    corrupt("the header says that the file header has " + std::to_string(fixed.info.header_bytes) +
            " bytes");
  if (fixed.opening_bytes == 0) return fixed.info.header_bytes;
  if (fixed.opening_bytes < bytes.size() || fixed.opening_bytes > fixed.info.header_bytes)
    corrupt("the header says that the table of pages is at byte " +
            std::to_string(fixed.opening_bytes));
  return fixed.opening_bytes;
}

bool header_is_whole(std::span<const std::byte> bytes) {
  const FixedHeader fixed = read_fixed_header(bytes);
  return fixed.tables_checksum == xxh64(bytes.data() + fixed.bytes, bytes.size() - fixed.bytes);
}

}  // namespace umbel::asset
