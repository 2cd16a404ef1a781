#include "asset/format.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "asset/box_steps.hpp"
#include "asset/structure.hpp"
#include "base/bytes.hpp"
#include "base/hash.hpp"

namespace umbel::asset {
namespace {

// As in PNG: a transfer that rewrites line ends or clears the eighth bit breaks it.
constexpr std::array<unsigned char, 8> kMagic{0xAB, 'U', 'M', 'B', 'L', '\r', '\n', 0x1A};
constexpr uint64_t kHeaderBytes = 128, kMaxHeaderBytes = 4096;
constexpr uint64_t kSectionEntryBytes = 32;
constexpr uint32_t kMaxSections = 1024;

constexpr uint32_t four_letters(const char (&name)[5]) {
  return static_cast<uint32_t>(name[0]) | static_cast<uint32_t>(name[1]) << 8 |
         static_cast<uint32_t>(name[2]) << 16 | static_cast<uint32_t>(name[3]) << 24;
}

enum SectionIndex {
  kMetadata,
  kAttributes,
  kLevels,
  kGroups,
  kClusters,
  kNodes,
  kPages,
  kSectionCount
};

struct SectionKind {
  uint32_t id;
  const char* name;
  uint32_t element_bytes;
};

constexpr std::array<SectionKind, kSectionCount> kSections{{{four_letters("META"), "META", 1},
                                                            {four_letters("ATTR"), "ATTR", 16},
                                                            {four_letters("LEVL"), "LEVL", 8},
                                                            {four_letters("GRUP"), "GRUP", 36},
                                                            {four_letters("CLUS"), "CLUS", 24},
                                                            {four_letters("NODE"), "NODE", 32},
                                                            {four_letters("PAGE"), "PAGE", 32}}};

struct Section {
  uint64_t offset, count;
  uint32_t element_bytes;
};

struct Layout {
  std::array<Section, kSectionCount> sections;
  uint64_t bytes;
};

Layout layout_of(const Head& head) {
  const uint64_t counts[kSectionCount] = {
      head.info.metadata.size(), head.format.attributes.size(), head.tables.levels.size(),
      head.tables.groups.size(), head.tables.clusters.size(),   head.tables.nodes.size(),
      head.pages.size()};
  Layout layout;
  uint64_t at = kHeaderBytes + kSectionCount * kSectionEntryBytes;
  for (size_t i = 0; i < kSectionCount; ++i) {
    layout.sections[i] = {at, counts[i], kSections[i].element_bytes};
    at = aligned(at + counts[i] * kSections[i].element_bytes, 8);
  }
  layout.bytes = aligned(at, kPageAlignment);
  return layout;
}

void write(ByteWriter& out, const Range& range) {
  out.u32(range.offset);
  out.u32(range.count);
}

void write(ByteWriter& out, const Sphere& sphere) {
  out.vec3(sphere.center);
  out.f32(sphere.radius);
}

void write(ByteWriter& out, const lod::Group& group) {
  write(out, group.clusters);
  out.u32(group.level);
  out.u32(static_cast<uint32_t>(group.rung));
  write(out, group.sphere);
  out.f32(group.error);
}

void write(ByteWriter& out, const AttributeFormat& attribute) {
  out.u32(attribute.attribute);
  out.u32(static_cast<uint32_t>(attribute.coding));
  out.u32(attribute.bits);
  out.f32(attribute.step);
}

void write(ByteWriter& out, const lod::Cluster& cluster, const Aabb& bounds) {
  out.u32(cluster.generating_group);
  out.u32(cluster.material);
  out.u16(static_cast<uint16_t>(cluster.vertex_count));
  out.u16(static_cast<uint16_t>(cluster.triangle_count));
  for (const uint16_t step : box_steps(cluster.box, bounds)) out.u16(step);
}

void write(ByteWriter& out, const lod::Node& node) {
  write(out, node.sphere);
  out.f32(node.error);
  out.u32(node.group);
  write(out, node.children);
}

void write(ByteWriter& out, const PageEntry& page) {
  out.u64(page.offset);
  out.u64(page.bytes);
  out.u64(page.checksum);
  out.u32(page.group);
  out.u32(0);
}

void read(ByteReader& in, Range& range) { range = in.range(); }

Sphere read_sphere(ByteReader& in) {
  const Vec3 center = in.vec3();
  return {center, in.f32()};
}

void read(ByteReader& in, lod::Group& group) {
  group.clusters = in.range();
  group.level = in.u32();
  group.rung = static_cast<lod::Rung>(in.u32());
  group.sphere = read_sphere(in);
  group.error = in.f32();
}

void read(ByteReader& in, AttributeFormat& attribute) {
  attribute.attribute = in.u32();
  attribute.coding = static_cast<Coding>(in.u32());
  attribute.bits = in.u32();
  attribute.step = in.f32();
}

void read(ByteReader& in, lod::Cluster& cluster, const Aabb& bounds) {
  cluster.generating_group = in.u32();
  cluster.material = in.u32();
  cluster.vertex_count = in.u16();
  cluster.triangle_count = in.u16();
  std::array<uint16_t, 6> steps;
  for (uint16_t& step : steps) step = in.u16();
  cluster.box = box_of_steps(steps, bounds);
}

/// Which group each cluster is in, from the groups' ranges; what they leave out is in none.
void assign_groups(lod::Tables& tables) {
  for (lod::Cluster& cluster : tables.clusters) cluster.group = kNone;
  for (uint32_t g = 0; g < tables.groups.size(); ++g) {
    const Range& range = tables.groups[g].clusters;
    const uint64_t end =
        std::min<uint64_t>(uint64_t{range.offset} + range.count, tables.clusters.size());
    for (uint64_t c = range.offset; c < end; ++c) tables.clusters[c].group = g;
  }
}

void read(ByteReader& in, lod::Node& node) {
  node.sphere = read_sphere(in);
  node.error = in.f32();
  node.group = in.u32();
  node.children = in.range();
}

void read(ByteReader& in, PageEntry& page) {
  page.offset = in.u64();
  page.bytes = in.u64();
  page.checksum = in.u64();
  page.group = in.u32();
}

template <typename Element, typename... Bounds>
void write_table(ByteWriter& out, const Section& section, const std::vector<Element>& table,
                 const Bounds&... bounds) {
  out.skip_to(section.offset);
  for (const Element& element : table) write(out, element, bounds...);
}

template <typename Element, typename... Bounds>
std::vector<Element> read_table(ByteReader& in, const Section& section, const Bounds&... bounds) {
  std::vector<Element> table(section.count);
  for (size_t i = 0; i < table.size(); ++i) {
    in.skip_to(section.offset + i * section.element_bytes);
    read(in, table[i], bounds...);
  }
  return table;
}

void write_header(ByteWriter& out, const AssetInfo& info, uint64_t head_size,
                  uint64_t head_checksum) {
  out.bytes(kMagic.data(), kMagic.size());
  out.u16(kVersionMajor);
  out.u16(kVersionMinor);
  out.u32(kHeaderBytes);
  out.u64(info.file_bytes);
  out.u64(head_size);
  out.u64(head_checksum);
  out.u32(kSectionCount);
  out.u32(0);
  out.u32(info.max_triangles);
  out.u32(info.max_vertices);
  out.u64(info.source_triangles);
  out.u64(info.source_vertices);
  out.u64(info.source_digest);
  out.vec3(info.bounds.min);
  out.vec3(info.bounds.max);
}

struct Header {
  AssetInfo info;
  uint64_t header_bytes, head_bytes, head_checksum;
  uint32_t sections;
};

Header read_header(std::span<const std::byte> bytes) {
  Header header;
  AssetInfo& info = header.info;
  ByteReader in(bytes);
  in.skip_to(kMagic.size());
  info.version_major = in.u16();
  info.version_minor = in.u16();
  header.header_bytes = in.u32();
  info.file_bytes = in.u64();
  header.head_bytes = in.u64();
  header.head_checksum = in.u64();
  header.sections = in.u32();
  in.skip_to(48);
  info.max_triangles = in.u32();
  info.max_vertices = in.u32();
  info.source_triangles = in.u64();
  info.source_vertices = in.u64();
  info.source_digest = in.u64();
  info.bounds.min = in.vec3();
  info.bounds.max = in.vec3();
  return header;
}

void check_section(const SectionKind& kind, const Section& section, uint64_t bytes,
                   uint64_t head_size) {
  const std::string name = std::string("section ") + kind.name;
  if (section.offset > head_size || bytes > head_size - section.offset)
    corrupt(name + " lies outside the head of " + std::to_string(head_size) + " bytes");
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

std::array<Section, kSectionCount> read_sections(std::span<const std::byte> head,
                                                 const Header& header) {
  if (header.sections > kMaxSections)
    corrupt("the section table has " + std::to_string(header.sections) + " entries");
  std::array<std::optional<Section>, kSectionCount> found;
  ByteReader in(head);
  for (uint32_t i = 0; i < header.sections; ++i) {
    in.skip_to(header.header_bytes + i * kSectionEntryBytes);
    const uint32_t id = in.u32(), element_bytes = in.u32();
    const uint64_t offset = in.u64(), bytes = in.u64(), count = in.u64();
    for (size_t kind = 0; kind < kSectionCount; ++kind) {
      if (kSections[kind].id != id) continue;
      if (found[kind]) corrupt(std::string("section ") + kSections[kind].name + " is there twice");
      found[kind] = Section{offset, count, element_bytes};
      check_section(kSections[kind], *found[kind], bytes, head.size());
    }
  }
  std::array<Section, kSectionCount> sections;
  for (size_t kind = 0; kind < kSectionCount; ++kind) {
    if (!found[kind]) corrupt(std::string("section ") + kSections[kind].name + " is missing");
    sections[kind] = *found[kind];
  }
  return sections;
}

void check_pages(const Head& head, uint64_t head_size) {
  const size_t groups = head.tables.groups.size();
  if (head.pages.size() != groups)
    corrupt("there are " + std::to_string(head.pages.size()) + " pages, but " +
            std::to_string(groups) + " groups");
  std::vector<uint8_t> has_page(groups);
  uint64_t earliest = head_size;  // pages do not overlap, so reading all is reading the file once
  for (size_t i = 0; i < head.pages.size(); ++i) {
    const PageEntry& page = head.pages[i];
    const std::string name = "page " + std::to_string(i);
    if (page.offset % kPageAlignment != 0 || page.offset < earliest ||
        page.offset > head.info.file_bytes || page.bytes > head.info.file_bytes - page.offset)
      corrupt(name + " has " + std::to_string(page.bytes) + " bytes at byte " +
              std::to_string(page.offset) + " of a file of " +
              std::to_string(head.info.file_bytes));
    earliest = page.offset + page.bytes;
    if (page.group >= groups)
      corrupt(name + " holds group " + std::to_string(page.group) + ", but there are " +
              std::to_string(groups));
    if (has_page[page.group]++) corrupt("group " + std::to_string(page.group) + " has two pages");
  }
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

uint64_t head_bytes(const Head& head) { return layout_of(head).bytes; }

std::vector<std::byte> encode_head(const Head& head) {
  const Layout layout = layout_of(head);
  std::vector<std::byte> bytes(layout.bytes);
  ByteWriter out(bytes);
  out.skip_to(kHeaderBytes);
  for (size_t i = 0; i < kSectionCount; ++i) {
    const Section& section = layout.sections[i];
    out.u32(kSections[i].id);
    out.u32(section.element_bytes);
    out.u64(section.offset);
    out.u64(section.count * section.element_bytes);
    out.u64(section.count);
  }
  out.skip_to(layout.sections[kMetadata].offset);
  out.bytes(head.info.metadata.data(), head.info.metadata.size());
  write_table(out, layout.sections[kAttributes], head.format.attributes);
  write_table(out, layout.sections[kLevels], head.tables.levels);
  write_table(out, layout.sections[kGroups], head.tables.groups);
  write_table(out, layout.sections[kClusters], head.tables.clusters, head.info.bounds);
  write_table(out, layout.sections[kNodes], head.tables.nodes);
  write_table(out, layout.sections[kPages], head.pages);

  out.skip_to(0);
  write_header(out, head.info, layout.bytes,
               xxh64(bytes.data() + kHeaderBytes, bytes.size() - kHeaderBytes));
  out.skip_to(kHeaderBytes - 8);
  out.u64(xxh64(bytes.data(), kHeaderBytes - 8));
  return bytes;
}

uint64_t header_bytes_in(std::span<const std::byte> prologue) {
  if (prologue.size() < kPrologueBytes ||
      std::memcmp(prologue.data(), kMagic.data(), kMagic.size()) != 0)
    corrupt("this is not a .umbel file");
  ByteReader in(prologue);
  in.skip_to(12);
  const uint64_t bytes = in.u32();
  if (bytes < kHeaderBytes || bytes > kMaxHeaderBytes || bytes % 8 != 0)
    corrupt("the header says that it has " + std::to_string(bytes) + " bytes");
  return bytes;
}

uint64_t head_bytes_in(std::span<const std::byte> bytes, uint64_t file_bytes) {
  ByteReader in(bytes);
  in.skip_to(bytes.size() - 8);
  if (in.u64() != xxh64(bytes.data(), bytes.size() - 8))
    corrupt("the header's checksum does not hold");
  in.skip_to(8);
  if (const uint16_t major = in.u16(); major != kVersionMajor)
    throw Error(ErrorCode::kUnsupported, "the file has format version " + std::to_string(major) +
                                             ", but this Umbel reads version " +
                                             std::to_string(kVersionMajor));
  const Header header = read_header(bytes);
  if (header.info.file_bytes != file_bytes)
    corrupt("the header says that the file has " + std::to_string(header.info.file_bytes) +
            " bytes, but it has " + std::to_string(file_bytes));
  if (header.head_bytes < bytes.size() || header.head_bytes > file_bytes)
    corrupt("the header says that the head has " + std::to_string(header.head_bytes) + " bytes");
  return header.head_bytes;
}

Head decode_head(std::span<const std::byte> bytes) {
  const Header header = read_header(bytes);
  if (header.head_checksum !=
      xxh64(bytes.data() + header.header_bytes, bytes.size() - header.header_bytes))
    corrupt("the checksum of the tables does not hold");
  const auto sections = read_sections(bytes, header);
  Head head;
  head.info = header.info;
  ByteReader in(bytes);
  in.skip_to(sections[kMetadata].offset);
  const auto metadata = in.bytes(sections[kMetadata].count);
  head.info.metadata.assign(reinterpret_cast<const char*>(metadata.data()), metadata.size());
  if (sections[kAttributes].count > kMaxComponents)
    corrupt("there are " + std::to_string(sections[kAttributes].count) + " attributes");
  head.format = make_format(read_table<AttributeFormat>(in, sections[kAttributes]));
  describe_format(head.format, head.info);
  head.tables.levels = read_table<Range>(in, sections[kLevels]);
  head.tables.groups = read_table<lod::Group>(in, sections[kGroups]);
  head.tables.clusters = read_table<lod::Cluster>(in, sections[kClusters], head.info.bounds);
  assign_groups(head.tables);
  head.tables.nodes = read_table<lod::Node>(in, sections[kNodes]);
  head.pages = read_table<PageEntry>(in, sections[kPages]);
  head.info.pages = static_cast<uint32_t>(head.pages.size());
  if (const std::string problem = structural_problem(head.tables); !problem.empty())
    corrupt(problem);
  check_pages(head, header.head_bytes);
  return head;
}

}  // namespace umbel::asset
