#include "asset/file/format.hpp"

#include <array>
#include <optional>

#include "asset/file/check_header.hpp"
#include "asset/file/records.hpp"
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

enum SectionIndex {
  kMetadata,
  kMaterials,
  kAttributes,
  kMeshes,
  kLevels,
  kRoots,
  kInstances,
  kFiles,
  kPages,
  kNodes,
  kOrigin,
  kScene,
  kPageSlices,
  kNodeSlices,
  kSectionCount
};

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
     {four_letters("NSUM"), "NSUM", 8, true, true}}};

struct Section {
  uint64_t offset, count;
  uint32_t element_bytes;
  uint64_t checksum;
};

uint64_t slices_of(uint64_t entries) { return (entries + kSliceEntries - 1) / kSliceEntries; }

struct Layout {
  std::array<Section, kSectionCount> sections;
  uint64_t bytes;
  uint64_t opening_bytes;  // what comes before a table of pages that has slices; else 0

  /// Whether the file has the section.
  bool has(size_t section) const {
    return !kSections[section].is_optional || sections[section].count > 0;
  }
  uint32_t section_count() const {
    uint32_t count = 0;
    for (size_t i = 0; i < kSectionCount; ++i) count += has(i);
    return count;
  }
};

/// The table of the section ORIG.
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
      header.nodes.slices.size()};
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
  layout.sections[kNodes].offset = header.nodes.offset;
  layout.sections[kNodes].checksum = header.nodes.checksum;
  layout.bytes = aligned(at, kPageAlignment);
  return layout;
}

template <typename Element>
void write_table(ByteWriter& out, const Section& section, const std::vector<Element>& table) {
  out.skip_to(section.offset);
  for (const Element& element : table) write(out, element);
}

template <typename Element>
std::vector<Element> read_table(ByteReader& in, const Section& section) {
  std::vector<Element> table(section.count);
  for (size_t i = 0; i < table.size(); ++i) {
    in.skip_to(section.offset + i * section.element_bytes);
    read(in, table[i]);
  }
  return table;
}

Vec3d read_origin(ByteReader& in, const Section& section) {
  if (section.count > 1)
    corrupt("section ORIG has " + std::to_string(section.count) +
            " elements, but at most 1 can be");
  const std::vector<Vec3d> origins = read_table<Vec3d>(in, section);
  return origins.empty() ? Vec3d{} : origins.front();
}

std::string read_text(ByteReader& in, const Section& section) {
  in.skip_to(section.offset);
  const auto bytes = in.bytes(section.count);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

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

struct FixedHeader {
  AssetInfo info;
  uint64_t bytes, tables_checksum;
  uint64_t opening_bytes, opening_checksum;  // of what comes before a table of pages with slices
  uint32_t sections;
};

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

std::array<Section, kSectionCount> read_sections(std::span<const std::byte> header,
                                                 const FixedHeader& fixed) {
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
  std::array<Section, kSectionCount> sections;
  for (size_t kind = 0; kind < kSectionCount; ++kind) {
    if (!found[kind] && !kSections[kind].is_optional)
      corrupt(std::string("section ") + kSections[kind].name + " is missing");
    sections[kind] = found[kind].value_or(Section{});
  }
  return sections;
}

/// Reads the checksums of a table's slices, if there are any.
TableSection read_slices(ByteReader& in, const Section& table, const Section& slices,
                         const char* name) {
  if (slices.count > 0 && slices.count != slices_of(table.count))
    corrupt(std::string("section ") + name + " has " + std::to_string(slices.count) +
            " checksums for " + std::to_string(table.count) + " entries");
  return {table.offset, table.count, table.element_bytes, table.checksum,
          read_table<uint64_t>(in, slices)};
}

/// Reads the table of pages, unless that is read in slices.
void read_pages(FileHeader& header, std::span<const std::byte> bytes, bool is_opening) {
  const TableSection& table = header.page_table;
  if (is_opening) {
    if (table.slices.empty() && table.count > 0)
      corrupt("the table of pages stands apart, but section PSUM is missing");
    return;
  }
  const auto rows = bytes.subspan(table.offset, table.count * table.element_bytes);
  header.pages = decode_pages(rows, table.count, table.element_bytes);
  if (!table.slices.empty() && slice_checksums(rows, table.element_bytes) != table.slices)
    corrupt("the checksums of slices of the table of pages do not hold");
}

void describe(FileHeader& header) {
  AssetInfo& info = header.info;
  for (const MeshEntry& entry : header.meshes) {
    const AssetMesh& mesh = entry.mesh;
    info.source_triangles += mesh.source_triangles;
    info.source_vertices += mesh.source_vertices;
    info.source_digest += mesh.source_digest;
    extend(info.bounds, mesh.bounds);
  }
  if (!header.meshes.empty()) describe_format(format_of(header, header.meshes.front()), info);
}

}  // namespace

void describe_format(const VertexFormat& format, AssetInfo& info) {
  for (const AttributeFormat& f : format.attributes) {
    const bool has_bits = f.coding != Coding::kFloats && f.coding != Coding::kGrid;
    const uint32_t bits = has_bits ? f.bits : 0;
    const float step = f.coding == Coding::kGrid ? f.step : 0;
    if (f.attribute == kPositions) info.position_step = step;
    if (f.attribute == kNormals) info.normals = true, info.normal_bits = bits;
    if (f.attribute == kTangents) info.tangents = true, info.tangent_bits = bits;
    if (f.attribute == kUvs) info.uvs = true, info.uv_step = step;
    if (f.attribute == kColors) info.colors = true, info.color_bits = bits;
  }
}

VertexFormat format_of(const FileHeader& header, const MeshEntry& mesh) {
  const auto first = header.attributes.begin() + mesh.attributes.offset;
  return make_format({first, first + mesh.attributes.count});
}

std::vector<std::byte> encode_nodes(std::span<const lod::Node> nodes) {
  std::vector<std::byte> bytes(kNodeBytes * nodes.size());
  ByteWriter out(bytes);
  for (const lod::Node& node : nodes) write(out, node);
  return bytes;
}

std::vector<lod::Node> decode_nodes(std::span<const std::byte> bytes, uint64_t count,
                                    uint32_t element_bytes) {
  ByteReader in(bytes);
  return read_table<lod::Node>(in, {0, count, element_bytes, 0});
}

std::vector<PageEntry> decode_pages(std::span<const std::byte> bytes, uint64_t count,
                                    uint32_t element_bytes) {
  ByteReader in(bytes);
  return read_table<PageEntry>(in, {0, count, element_bytes, 0});
}

std::vector<uint64_t> slice_checksums(std::span<const std::byte> table, uint64_t element_bytes) {
  std::vector<uint64_t> sums;
  const uint64_t most = kSliceEntries * element_bytes;
  for (; !table.empty(); table = table.subspan(std::min<uint64_t>(most, table.size())))
    sums.push_back(xxh64(table.data(), std::min<uint64_t>(most, table.size())));
  return sums;
}

uint64_t header_bytes(const FileHeader& header) { return layout_of(header).bytes; }

std::vector<std::byte> encode_header(const FileHeader& header) {
  Layout layout = layout_of(header);
  std::vector<std::byte> bytes(layout.bytes);
  ByteWriter out(bytes);
  out.skip_to(layout.sections[kMetadata].offset);
  out.bytes(header.info.metadata.data(), header.info.metadata.size());
  out.skip_to(layout.sections[kMaterials].offset);
  out.bytes(header.materials.data(), header.materials.size());
  write_table(out, layout.sections[kAttributes], header.attributes);
  write_table(out, layout.sections[kMeshes], header.meshes);
  write_table(out, layout.sections[kLevels], header.levels);
  write_table(out, layout.sections[kRoots], header.roots);
  write_table(out, layout.sections[kInstances], header.instances);
  write_table(out, layout.sections[kFiles], header.files);
  write_table(out, layout.sections[kPages], header.pages);
  write_table(out, layout.sections[kOrigin], origins_of(header));
  out.skip_to(layout.sections[kScene].offset);
  out.bytes(header.scene.data(), header.scene.size());
  const Section& pages = layout.sections[kPages];
  if (header.has_page_slices)
    write_table(
        out, layout.sections[kPageSlices],
        slice_checksums(std::span(bytes).subspan(pages.offset, pages.count * pages.element_bytes),
                        pages.element_bytes));
  write_table(out, layout.sections[kNodeSlices], header.nodes.slices);

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
    out.u64(kSections[i].in_header ? xxh64(bytes.data() + section.offset, size) : section.checksum);
  }
  out.skip_to(0);
  write_fixed_header(out, header.info, layout,
                     xxh64(bytes.data() + kFixedHeaderBytes, bytes.size() - kFixedHeaderBytes),
                     layout.opening_bytes == 0 ? 0
                                               : xxh64(bytes.data() + kFixedHeaderBytes,
                                                       layout.opening_bytes - kFixedHeaderBytes));
  out.skip_to(kFixedHeaderBytes - 8);
  out.u64(xxh64(bytes.data(), kFixedHeaderBytes - 8));
  return bytes;
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
  if (const uint16_t major = in.u16(); major != kVersionMajor)
    throw Error(ErrorCode::kUnsupported, "the file has format version " + std::to_string(major) +
                                             ", but this Umbel reads version " +
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

FileHeader decode_header(std::span<const std::byte> bytes) {
  const FixedHeader fixed = read_fixed_header(bytes);
  const bool is_opening = fixed.opening_bytes != 0;
  if ((is_opening ? fixed.opening_checksum : fixed.tables_checksum) !=
      xxh64(bytes.data() + fixed.bytes, bytes.size() - fixed.bytes))
    corrupt("the checksum of the tables does not hold");
  const auto sections = read_sections(bytes, fixed);
  FileHeader header;
  header.has_page_slices = is_opening;
  header.info = fixed.info;
  ByteReader in(bytes);
  header.info.metadata = read_text(in, sections[kMetadata]);
  header.materials = read_text(in, sections[kMaterials]);
  header.scene = read_text(in, sections[kScene]);
  header.info.origin = read_origin(in, sections[kOrigin]);
  header.attributes = read_table<AttributeFormat>(in, sections[kAttributes]);
  header.meshes = read_table<MeshEntry>(in, sections[kMeshes]);
  header.levels = read_table<Range>(in, sections[kLevels]);
  header.roots = read_table<GroupRef>(in, sections[kRoots]);
  header.instances = read_table<Instance>(in, sections[kInstances]);
  header.files = read_table<FileEntry>(in, sections[kFiles]);
  header.page_table = read_slices(in, sections[kPages], sections[kPageSlices], "PSUM");
  header.nodes = read_slices(in, sections[kNodes], sections[kNodeSlices], "NSUM");
  header.info.pages = static_cast<uint32_t>(header.page_table.count);
  read_pages(header, bytes, is_opening);
  check_header(header);
  describe(header);
  return header;
}

}  // namespace umbel::asset
