#include "asset/file/group_chunk.hpp"

#include <algorithm>
#include <limits>
#include <memory>

#include "asset/codec/shared_vertices.hpp"
#include "asset/codec/twins.hpp"
#include "asset/file/box_steps.hpp"
#include "asset/file/chunk_tables.hpp"
#include "asset/file/records.hpp"
#include "base/bytes.hpp"

namespace umbel::asset {
namespace {

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
  GroupEncoder(const ChunkFormat& mesh, const GroupView& group)
      : group_(group),
        format_(mesh.vertices),
        integers_(quantize_group(mesh, group)),
        ranges_(ranges_of(components(format_), integers_.values)),
        shared_(integers_.vertices),
        twins_(integers_.vertices) {}

  const std::vector<ComponentRange>& ranges() const { return ranges_; }

  void encode(uint32_t cluster, std::vector<std::byte>& data) {
    BitWriter out(data);
    const std::span<const uint32_t> vertices = vertices_of(group_, cluster);
    const uint32_t stride = components(format_);
    const std::span integers =
        std::span(integers_.values).subspan(integers_.first[cluster], vertices.size() * stride);
    const Traversal traversal = encode_triangles(
        triangles_of(group_, cluster), static_cast<uint32_t>(vertices.size()), integers, out);
    const auto first = static_cast<uint32_t>(ordered_.size() / stride);
    ids_.resize(vertices.size());
    ordered_.resize(ordered_.size() + vertices.size() * stride);
    for (size_t v = 0; v < vertices.size(); ++v) {
      ids_[v] = vertices[traversal.vertices[v]];
      std::copy_n(&integers[size_t{traversal.vertices[v]} * stride], stride,
                  ordered_.data() + (first + v) * stride);
    }
    const std::vector<uint32_t> equal = shared_.encode(ids_, traversal.border, out);
    const std::vector<uint32_t> twin =
        twins_.encode(shared_.borders(), equal, ordered_, stride, out);
    encode_vertices(format_, ordered_, first, {traversal.predictors, traversal.triangles},
                    {equal, twin}, ranges_, out);
    out.finish();
  }

 private:
  const GroupView& group_;
  const VertexFormat& format_;
  Integers integers_;
  std::vector<ComponentRange> ranges_;
  SharedVertices shared_;
  Twins twins_;
  std::vector<uint32_t> ids_;
  std::vector<int32_t> ordered_;  // of the clusters so far, in the order of their traversals
};

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
  GroupEncoder encoder(format, group);
  PackedTables tables{encoder.ranges(), {}};
  std::vector<std::byte> data;
  for (uint32_t i = 0; i < group.clusters.size(); ++i) {
    const lod::Cluster& cluster = group.clusters[i];
    const size_t begin = data.size();
    encoder.encode(i, data);
    const auto child = std::find(children.begin(), children.end(), cluster.generating_group);
    tables.clusters.push_back(
        {static_cast<uint32_t>(data.size() - begin), cluster.vertex_count, cluster.triangle_count,
         child == children.end() ? kNone : static_cast<uint32_t>(child - children.begin()),
         cluster.material + format.first_material, box_steps(cluster.box, format.bounds)});
  }
  const auto references = static_cast<uint32_t>(children.size());
  std::vector<std::byte> chunk(kReferenceBytes * references);
  for (size_t i = 0; i < references; ++i) write_reference(chunk, i, {children[i], 0, 0, {}, 0});
  write_tables(tables, references, chunk);
  chunk.insert(chunk.end(), data.begin(), data.end());
  // A cluster has at most 256 vertices; only the number of clusters is free.
  if (chunk.size() >= std::numeric_limits<uint32_t>::max() / 2)
    throw Error(ErrorCode::kInvalidArgument, "group " + std::to_string(group.number) + " takes " +
                                                 std::to_string(chunk.size()) +
                                                 " bytes, but a group may take 2 GiB");
  chunk.resize(aligned(chunk.size(), kChunkAlignment));
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
                          uint32_t references, std::span<const std::byte> chunk, uint32_t version) {
  const uint64_t before = kReferenceBytes * references;
  if (before > chunk.size()) corrupt("a group's tables are longer than its chunk");
  const TableCounts counts{components(format), clusters, references};
  PackedTables packed = version == 3 ? read_tables_3(chunk.subspan(before), counts)
                                     : read_tables(chunk.subspan(before), counts);
  ChunkTables tables;
  tables.version = version;
  tables.ranges = std::move(packed.ranges);
  ByteReader in(chunk);
  tables.children.resize(references);
  for (GroupRef& child : tables.children) read(in, child);
  uint64_t end = before + packed.bytes;
  tables.first_data = static_cast<uint32_t>(end);
  tables.clusters.reserve(clusters);
  tables.ends.reserve(clusters);
  for (const ClusterRecord& record : packed.clusters) {
    end += record.bytes;
    if (end > chunk.size()) corrupt("a cluster's data lie outside its group's chunk");
    tables.ends.push_back(static_cast<uint32_t>(end));
    tables.clusters.push_back(
        {kNone, record.reference == kNone ? kNone : tables.children[record.reference].group,
         record.material, record.vertices, record.triangles, box_of_steps(record.box, bounds)});
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
  // Not zeroed: whatever a file says, no value is read before it is written.
  const auto memory = std::make_unique_for_overwrite<int32_t[]>(vertices * stride);
  const std::span integers(memory.get(), vertices * stride);
  GroupBorders borders(vertices);
  std::array<Predictors, kMaxLocal> predictors;
  std::array<uint32_t, kMaxLocal> equals, twins;
  uint32_t begin = tables.first_data, first = 0;
  for (size_t i = 0; i < count; ++i) {
    const lod::Cluster& cluster = tables.clusters[i];
    BitReader in(chunk.subspan(begin, tables.ends[i] - begin), chunk.size() - tables.ends[i]);
    all[i].triangles.resize(size_t{3} * cluster.triangle_count);
    const auto mine = std::span(predictors).first(cluster.vertex_count);
    decode_triangles(tables.version, in, all[i].triangles, mine,
                     borders.add_cluster(cluster.vertex_count));
    borders.list_last();
    const auto equal = std::span(equals).first(cluster.vertex_count);
    decode_shared(in, borders, equal);
    if (tables.version == 3) {
      decode_vertices_3(format, mine, equal, tables.ranges, in, integers, first);
    } else {
      auto twin = std::span(twins).first(cluster.vertex_count);
      if (!decode_twins(in, borders, equal, twin)) twin = {};
      decode_vertices(tables.version, format, {mine, all[i].triangles}, {equal, twin},
                      tables.ranges, in, integers, first);
    }
    in.finish();
    dequantize(format,
               integers.subspan(size_t{first} * stride, size_t{cluster.vertex_count} * stride),
               all[i]);
    begin = tables.ends[i];
    first += cluster.vertex_count;
  }
  return all;
}

}  // namespace umbel::asset
