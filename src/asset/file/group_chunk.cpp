#include "asset/file/group_chunk.hpp"

#include <algorithm>
#include <limits>

#include "asset/codec/shared_vertices.hpp"
#include "asset/file/box_steps.hpp"
#include "asset/file/records.hpp"
#include "base/bytes.hpp"

namespace umbel::asset {
namespace {

constexpr uint16_t kNoReference = 0xffff;

std::span<const uint32_t> vertices_of(const GroupView& group, uint32_t cluster) {
  return group.cluster_vertices.subspan(
      group.vertex_offsets[cluster],
      group.vertex_offsets[cluster + 1] - group.vertex_offsets[cluster]);
}

std::span<const uint8_t> triangles_of(const GroupView& group, uint32_t cluster) {
  const size_t first = group.triangle_offsets[cluster], last = group.triangle_offsets[cluster + 1];
  return group.cluster_triangles.subspan(3 * first, 3 * (last - first));
}

std::vector<ComponentRange> ranges_of(uint32_t stride, std::span<const int32_t> values) {
  std::vector<ComponentRange> ranges(stride, {0, 0});
  for (uint32_t c = 0; c < stride && !values.empty(); ++c) {
    int32_t lowest = values[c], highest = values[c];
    for (size_t i = c; i < values.size(); i += stride) {
      lowest = std::min(lowest, values[i]);
      highest = std::max(highest, values[i]);
    }
    const uint32_t reach = static_cast<uint32_t>(highest) - static_cast<uint32_t>(lowest);
    ranges[c] = {lowest, static_cast<uint32_t>(std::bit_width(reach))};
  }
  return ranges;
}

/// The integers of a group's clusters, one after the other.
struct Integers {
  std::vector<int32_t> values;
  std::vector<size_t> first;  // of each cluster
  size_t vertices = 0;
};

Integers quantize_group(const ChunkFormat& mesh, const GroupView& group) {
  const VertexFormat& format = mesh.vertices;
  Integers all;
  for (uint32_t i = 0; i < group.clusters.size(); ++i) {
    all.first.push_back(all.vertices * components(format));
    all.vertices += vertices_of(group, i).size();
  }
  all.values.resize(all.vertices * components(format));
  for (uint32_t i = 0; i < group.clusters.size(); ++i) {
    const auto mine = vertices_of(group, i);
    quantize(format, group.vertices, mine,
             std::span(all.values).subspan(all.first[i], mine.size() * components(format)));
  }
  if (format.attributes.back().attribute == kMaterial)
    for (size_t last = components(format); last <= all.values.size(); last += components(format))
      all.values[last - 1] += static_cast<int32_t>(mesh.first_material);
  return all;
}

class GroupEncoder {
 public:
  GroupEncoder(const ChunkFormat& mesh, const GroupView& group, std::vector<std::byte>& chunk)
      : group_(group),
        format_(mesh.vertices),
        integers_(quantize_group(mesh, group)),
        ranges_(ranges_of(components(format_), integers_.values)),
        shared_(integers_.vertices),
        chunk_(chunk) {}

  const std::vector<ComponentRange>& ranges() const { return ranges_; }

  void encode(uint32_t cluster) {
    BitWriter out(chunk_);
    const std::span<const uint32_t> vertices = vertices_of(group_, cluster);
    const Traversal traversal = encode_triangles(triangles_of(group_, cluster),
                                                 static_cast<uint32_t>(vertices.size()), out);
    const uint32_t stride = components(format_);
    ids_.resize(vertices.size());
    ordered_.resize(vertices.size() * stride);
    const int32_t* const integers = integers_.values.data() + integers_.first[cluster];
    for (size_t v = 0; v < vertices.size(); ++v) {
      ids_[v] = vertices[traversal.vertices[v]];
      std::copy_n(integers + size_t{traversal.vertices[v]} * stride, stride,
                  ordered_.data() + v * stride);
    }
    const std::vector<uint32_t> source = shared_.encode(ids_, traversal.border, out);
    encode_vertices(format_, ordered_, traversal.predictors, source, ranges_, out);
    out.finish();
  }

 private:
  const GroupView& group_;
  const VertexFormat& format_;
  Integers integers_;
  std::vector<ComponentRange> ranges_;
  SharedVertices shared_;
  std::vector<uint32_t> ids_;
  std::vector<int32_t> ordered_;
  std::vector<std::byte>& chunk_;
};

void write_record(ByteWriter& out, const lod::Cluster& cluster, uint32_t end, uint16_t reference,
                  const ChunkFormat& mesh) {
  out.u32(end);
  out.u16(static_cast<uint16_t>((cluster.vertex_count - 1) | (cluster.triangle_count - 1) << 8));
  out.u16(reference);
  out.u32(cluster.material + mesh.first_material);
  for (const uint16_t step : box_steps(cluster.box, mesh.bounds)) out.u16(step);
}

}  // namespace

GroupView group_of(const lod::Dag& dag, uint32_t group) {
  const Range range = dag.tables.groups[group].clusters;
  const auto offsets = [&](const std::vector<uint32_t>& of_all) {
    return std::span(of_all).subspan(range.offset, size_t{range.count} + 1);
  };
  return {group,
          std::span(dag.tables.clusters).subspan(range.offset, range.count),
          offsets(dag.vertex_offsets),
          offsets(dag.triangle_offsets),
          dag.cluster_vertices,
          dag.cluster_triangles,
          dag.vertices};
}

std::vector<uint32_t> children_of(std::span<const lod::Cluster> clusters) {
  std::vector<uint32_t> children;
  for (const lod::Cluster& cluster : clusters) {
    const uint32_t child = cluster.generating_group;
    // Clusters made from the same group stand together.
    if (child == kNone || (!children.empty() && children.back() == child)) continue;
    if (std::find(children.begin(), children.end(), child) == children.end())
      children.push_back(child);
  }
  return children;
}

void check_references(uint32_t group, size_t references) {
  if (references > kMaxReferences)
    throw Error(ErrorCode::kInvalidArgument, "group " + std::to_string(group) + " was made from " +
                                                 std::to_string(references) +
                                                 " groups, but at most 65535 can be");
}

std::vector<std::byte> encode_chunk(const ChunkFormat& format, const GroupView& group,
                                    std::span<const uint32_t> children) {
  const uint64_t tables_at = kReferenceBytes * children.size();
  std::vector<std::byte> chunk(tables_at + kComponentBytes * components(format.vertices) +
                               kClusterRecordBytes * group.clusters.size());
  GroupEncoder encoder(format, group, chunk);
  std::vector<uint32_t> ends;
  for (uint32_t i = 0; i < group.clusters.size(); ++i) {
    encoder.encode(i);
    ends.push_back(static_cast<uint32_t>(chunk.size()));
  }
  // A cluster has at most 256 vertices; only the number of clusters is free.
  if (chunk.size() >= std::numeric_limits<uint32_t>::max() / 2)
    throw Error(ErrorCode::kInvalidArgument, "group " + std::to_string(group.number) + " takes " +
                                                 std::to_string(chunk.size()) +
                                                 " bytes, but a group may take 2 GiB");
  chunk.resize(aligned(chunk.size(), kChunkAlignment));
  for (size_t i = 0; i < children.size(); ++i)
    write_reference(chunk, i, {children[i], 0, 0, {}, 0});
  ByteWriter out(chunk);
  out.skip_to(tables_at);
  for (const ComponentRange& component : encoder.ranges()) {
    out.u32(static_cast<uint32_t>(component.lowest));
    out.u32(component.bits);
  }
  for (uint32_t i = 0; i < group.clusters.size(); ++i) {
    const lod::Cluster& cluster = group.clusters[i];
    const auto child = std::find(children.begin(), children.end(), cluster.generating_group);
    const auto reference =
        child == children.end() ? kNoReference : static_cast<uint16_t>(child - children.begin());
    write_record(out, cluster, ends[i], reference, format);
  }
  return chunk;
}

void write_reference(std::span<std::byte> chunk, size_t index, const GroupRef& reference) {
  ByteWriter out(chunk);
  out.skip_to(kReferenceBytes * index);
  write(out, reference);
}

uint32_t referred_group(std::span<const std::byte> chunk, size_t index) {
  ByteReader in(chunk);
  in.skip_to(kReferenceBytes * index);
  GroupRef reference;
  read(in, reference);
  return reference.group;
}

ChunkTables decode_tables(const VertexFormat& format, const Aabb& bounds, uint32_t clusters,
                          uint32_t references, std::span<const std::byte> chunk) {
  ChunkTables tables;
  const uint64_t bytes = kReferenceBytes * references + kComponentBytes * components(format) +
                         kClusterRecordBytes * clusters;
  if (bytes > chunk.size()) corrupt("a group's tables are longer than its chunk");
  tables.first_data = static_cast<uint32_t>(bytes);
  ByteReader in(chunk);
  tables.children.resize(references);
  for (GroupRef& child : tables.children) read(in, child);
  tables.ranges.resize(components(format));
  for (ComponentRange& range : tables.ranges) {
    range.lowest = static_cast<int32_t>(in.u32());
    range.bits = in.u32();
    if (range.bits > 32)
      corrupt("a group's components have " + std::to_string(range.bits) + " bits");
  }
  tables.clusters.resize(clusters);
  tables.ends.resize(clusters);
  uint32_t begin = tables.first_data;
  for (uint32_t i = 0; i < clusters; ++i) {
    lod::Cluster& cluster = tables.clusters[i];
    tables.ends[i] = in.u32();
    const uint32_t counts = in.u16(), reference = in.u16();
    cluster.vertex_count = (counts & 0xff) + 1;
    cluster.triangle_count = (counts >> 8) + 1;
    cluster.material = in.u32();
    if (reference != kNoReference && reference >= references)
      corrupt("a cluster was made from group " + std::to_string(reference) + " of " +
              std::to_string(references));
    cluster.group = kNone;
    cluster.generating_group = reference == kNoReference ? kNone : tables.children[reference].group;
    std::array<uint16_t, 6> steps;
    for (uint16_t& step : steps) step = in.u16();
    cluster.box = box_of_steps(steps, bounds);
    if (tables.ends[i] < begin || tables.ends[i] > chunk.size())
      corrupt("a cluster's data lie outside its group's chunk");
    begin = tables.ends[i];
  }
  return tables;
}

std::vector<lod::ClusterGeometry> decode_clusters(const VertexFormat& format,
                                                  const ChunkTables& tables,
                                                  std::span<const std::byte> chunk, size_t count) {
  std::vector<lod::ClusterGeometry> all(count);
  const uint32_t stride = row_stride(format);
  size_t vertices = 0;
  for (size_t i = 0; i < count; ++i) vertices += tables.clusters[i].vertex_count;
  std::vector<int32_t> integers(vertices * stride);
  GroupBorders borders(vertices);
  std::array<Predictors, kMaxLocal> predictors;
  std::array<uint32_t, kMaxLocal> source;
  uint32_t begin = tables.first_data, first = 0;
  for (size_t i = 0; i < count; ++i) {
    const lod::Cluster& cluster = tables.clusters[i];
    BitReader in(chunk.subspan(begin, tables.ends[i] - begin), chunk.size() - tables.ends[i]);
    all[i].triangles.resize(size_t{3} * cluster.triangle_count);
    const auto mine = std::span(predictors).first(cluster.vertex_count);
    decode_triangles(in, all[i].triangles, mine, borders.add_cluster(cluster.vertex_count));
    borders.list_last();
    const auto sources = std::span(source).first(cluster.vertex_count);
    decode_shared(in, borders, sources);
    decode_vertices(format, mine, sources, tables.ranges, in, integers, first);
    in.finish();
    dequantize(
        format,
        std::span(integers).subspan(size_t{first} * stride, size_t{cluster.vertex_count} * stride),
        all[i]);
    begin = tables.ends[i];
    first += cluster.vertex_count;
  }
  return all;
}

}  // namespace umbel::asset
