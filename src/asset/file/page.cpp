#include "asset/file/page.hpp"

#include "asset/file/group_chunk.hpp"
#include "base/bytes.hpp"

namespace umbel::asset {
namespace {

void write(ByteWriter& out, const EncodedGroup& encoded, uint32_t offset) {
  const lod::Group& group = encoded.group;
  out.u32(encoded.mesh);
  out.u32(encoded.id);
  out.u32(group.clusters.offset);
  out.u32(group.clusters.count);
  out.u32(group.level);
  out.u32(static_cast<uint32_t>(group.method));
  out.u32(encoded.parents);
  out.u32(encoded.references);
  out.vec3(group.sphere.center);
  out.f32(group.sphere.radius);
  out.f32(group.error);
  out.u32(offset);
  out.u32(static_cast<uint32_t>(encoded.chunk.size()));
  out.u32(0);
}

/// Returns the number of the group's references.
uint32_t read(ByteReader& in, PageGroup& record) {
  record.mesh = in.u32();
  record.id = in.u32();
  record.group.clusters = in.range();
  record.group.level = in.u32();
  record.group.method = static_cast<lod::SimplifyMethod>(in.u32());
  record.parents = in.u32();
  const uint32_t references = in.u32();
  record.group.sphere.center = in.vec3();
  record.group.sphere.radius = in.f32();
  record.group.error = in.f32();
  record.offset = in.u32();
  record.bytes = in.u32();
  return references;
}

void check(const PageGroup& record, const FileHeader& header, uint64_t page_size) {
  const std::string name = "group " + std::to_string(record.id);
  if (record.mesh >= header.meshes.size())
    corrupt(name + " is of mesh " + std::to_string(record.mesh) + ", but there are " +
            std::to_string(header.meshes.size()));
  const AssetMesh& mesh = header.meshes[record.mesh].mesh;
  if (record.id >= mesh.groups)
    corrupt("a page holds " + name + ", but there are " + std::to_string(mesh.groups));
  const Range& clusters = record.group.clusters;
  if (clusters.offset > mesh.clusters || clusters.count > mesh.clusters - clusters.offset)
    corrupt(name + " has clusters that are not there");
  if (record.group.method > lod::SimplifyMethod::kRoot)
    corrupt(name + " has the unknown simplification method " +
            std::to_string(static_cast<uint32_t>(record.group.method)));
  if (record.offset > page_size || record.bytes > page_size - record.offset)
    corrupt(name + " lies outside its page");
}

}  // namespace

uint64_t page_bytes(std::span<const EncodedGroup> groups) {
  uint64_t bytes = kPageHeaderBytes + kGroupRecordBytes * groups.size();
  for (const EncodedGroup& group : groups) bytes += group.chunk.size();
  return aligned(bytes, kPageAlignment);
}

std::vector<std::byte> encode_page(uint32_t index, std::span<const EncodedGroup> groups) {
  std::vector<std::byte> page(page_bytes(groups));
  ByteWriter out(page);
  out.u32(index);
  out.u32(static_cast<uint32_t>(groups.size()));
  out.u64(0);
  uint64_t at = kPageHeaderBytes + kGroupRecordBytes * groups.size();
  for (const EncodedGroup& group : groups) {
    write(out, group, static_cast<uint32_t>(at));
    at += group.chunk.size();
  }
  for (const EncodedGroup& group : groups) out.bytes(group.chunk.data(), group.chunk.size());
  return page;
}

AssetPage decode_page(const FileHeader& header, std::span<const VertexFormat> formats,
                      uint32_t index, uint32_t expected, std::vector<std::byte> bytes) {
  AssetPage page;
  page.index = index;
  ByteReader in(bytes);
  if (const uint32_t said = in.u32(); said != index)
    corrupt("page " + std::to_string(index) + " says that it is page " + std::to_string(said));
  const uint32_t groups = in.u32();
  if (groups != expected || groups > bytes.size() / kGroupRecordBytes)
    corrupt("page " + std::to_string(index) + " has " + std::to_string(groups) + " groups, not " +
            std::to_string(expected));
  page.groups.resize(groups);
  uint64_t end = kPageHeaderBytes + kGroupRecordBytes * groups;
  for (uint32_t g = 0; g < groups; ++g) {
    PageGroup& record = page.groups[g];
    in.skip_to(kPageHeaderBytes + kGroupRecordBytes * g);
    const uint32_t references = read(in, record);
    check(record, header, bytes.size());
    if (record.offset < end) corrupt("two groups of a page overlap");
    end = uint64_t{record.offset} + record.bytes;
    const auto chunk = std::span(bytes).subspan(record.offset, record.bytes);
    ChunkTables tables =
        decode_tables(formats[record.mesh], header.meshes[record.mesh].mesh.bounds,
                      record.group.clusters.count, references, chunk, header.info.version_major);
    for (const GroupRef& child : tables.children)
      if (child.page >= header.info.pages || child.group >= header.meshes[record.mesh].mesh.groups)
        corrupt("group " + std::to_string(record.id) + " was made from group " +
                std::to_string(child.group) + " in page " + std::to_string(child.page) +
                ", which is not there");
    record.children = std::move(tables.children);
    record.clusters = std::move(tables.clusters);
    for (lod::Cluster& cluster : record.clusters) cluster.group = record.id;
  }
  page.bytes = std::move(bytes);
  return page;
}

}  // namespace umbel::asset
