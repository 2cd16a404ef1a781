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
     {four_letters("SCEN"), "SCEN", 1, true, true}}};

struct Section {
  uint64_t offset, count;
  uint32_t element_bytes;
  uint64_t checksum;
};

struct Layout {
  std::array<Section, kSectionCount> sections;
  uint64_t bytes;

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
      header.info.metadata.size(), header.materials.size(),   header.attributes.size(),
      header.meshes.size(),        header.levels.size(),      header.roots.size(),
      header.instances.size(),     header.files.size(),       header.pages.size(),
      header.nodes.count,          origins_of(header).size(), header.scene.size()};
  Layout layout;
  for (size_t i = 0; i < kSectionCount; ++i)
    layout.sections[i] = {0, counts[i], kSections[i].element_bytes, 0};
  uint64_t at = kFixedHeaderBytes + layout.section_count() * kSectionEntryBytes;
  for (size_t i = 0; i < kSectionCount; ++i) {
    layout.sections[i].offset = at;
    if (kSections[i].in_header) at = aligned(at + counts[i] * kSections[i].element_bytes, 8);
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
                        uint64_t tables_checksum) {
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
}

struct FixedHeader {
  AssetInfo info;
  uint64_t bytes, tables_checksum;
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
  in.skip_to(fixed.bytes - 8);
  info.checksum = in.u64();
  return fixed;
}

void check_section(const SectionKind& kind, const Section& section, uint64_t bytes,
                   const AssetInfo& info) {
  const std::string name = std::string("section ") + kind.name;
  const bool fits = kind.in_header
                        ? inside(section.offset, bytes, 0, info.header_bytes)
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
      check_section(kSections[kind], *found[kind], bytes, fixed.info);
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

void describe(FileHeader& header) {
  AssetInfo& info = header.info;
  info.pages = static_cast<uint32_t>(header.pages.size());
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
                     xxh64(bytes.data() + kFixedHeaderBytes, bytes.size() - kFixedHeaderBytes));
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

uint64_t header_bytes_in(std::span<const std::byte> bytes, uint64_t file_bytes) {
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
  return fixed.info.header_bytes;
}

FileHeader decode_header(std::span<const std::byte> bytes) {
  const FixedHeader fixed = read_fixed_header(bytes);
  if (fixed.tables_checksum != xxh64(bytes.data() + fixed.bytes, bytes.size() - fixed.bytes))
    corrupt("the checksum of the tables does not hold");
  const auto sections = read_sections(bytes, fixed);
  FileHeader header;
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
  header.pages = read_table<PageEntry>(in, sections[kPages]);
  const Section& nodes = sections[kNodes];
  header.nodes = {nodes.offset, nodes.count, nodes.element_bytes, nodes.checksum};
  check_header(header);
  describe(header);
  return header;
}

}  // namespace umbel::asset
