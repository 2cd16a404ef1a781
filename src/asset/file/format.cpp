#include "asset/file/format.hpp"

#include <cmath>

#include "asset/file/check_header.hpp"
#include "asset/file/header_frame.hpp"
#include "asset/file/records.hpp"
#include "base/hash.hpp"
#include "base/math.hpp"

namespace umbel::asset {
namespace {

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

/// Reads the checksums of a table's slices, if there are any.
TableSection read_slices(ByteReader& in, const Section& table, const Section& slices,
                         const char* name) {
  if (slices.count > 0 && slices.count != slices_of(table.count))
    corrupt(std::string("section ") + name + " has " + std::to_string(slices.count) +
            " checksums for " + std::to_string(table.count) + " entries");
  return {table.offset, table.count, table.element_bytes, table.checksum,
          read_table<uint64_t>(in, slices)};
}

/// Where a tree of instances is, if there is one.
void read_instance_tree(FileHeader& header, ByteReader& in, const Sections& sections) {
  const Section &nodes = sections[kInstanceNodes], &pages = sections[kInstancePages];
  header.coarsest_errors = read_table<float>(in, sections[kCoarsestErrors]);
  header.instance_nodes = {nodes.offset, nodes.count, nodes.element_bytes, nodes.checksum, {}};
  header.instance_pages = {pages.offset, pages.count, pages.element_bytes, pages.checksum, {}};
  if (nodes.count > 0 && header.coarsest_errors.size() != header.meshes.size())
    corrupt("section IERR has " + std::to_string(header.coarsest_errors.size()) +
            " elements, but there are " + std::to_string(header.meshes.size()) + " meshes");
  for (const float error : header.coarsest_errors)
    if (!std::isfinite(error) || error < 0) corrupt("section IERR has no finite error");
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
  for (MeshEntry& entry : header.meshes) {
    AssetMesh& mesh = entry.mesh;
    AssetInfo own;
    describe_format(format_of(header, entry), own);
    mesh.normals = own.normals, mesh.tangents = own.tangents;
    mesh.uvs = own.uvs, mesh.colors = own.colors;
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

std::vector<std::byte> encode_header(const FileHeader& header) {
  const Layout layout = layout_of(header);
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
  write_table(out, layout.sections[kCoarsestErrors], header.coarsest_errors);
  write_frame(bytes, header.info, layout);
  return bytes;
}

FileHeader decode_header(std::span<const std::byte> bytes) {
  const FixedHeader fixed = read_fixed_header(bytes);
  const bool is_opening = fixed.opening_bytes != 0;
  if ((is_opening ? fixed.opening_checksum : fixed.tables_checksum) !=
      xxh64(bytes.data() + fixed.bytes, bytes.size() - fixed.bytes))
    corrupt("the checksum of the tables does not hold");
  const Sections sections = read_sections(bytes, fixed);
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
  const Section& coarse = sections[kCoarseGroups];
  header.coarse = {coarse.offset, coarse.count, coarse.element_bytes, coarse.checksum, {}};
  read_instance_tree(header, in, sections);
  header.info.pages = static_cast<uint32_t>(header.page_table.count);
  read_pages(header, bytes, is_opening);
  check_header(header);
  describe(header);
  return header;
}

}  // namespace umbel::asset
