#include "asset/page.hpp"

#include <algorithm>
#include <limits>

#include "asset/format.hpp"
#include "base/bytes.hpp"

namespace umbel::asset {
namespace {

std::span<const uint32_t> vertices_of(const lod::Dag& dag, uint32_t cluster) {
  return std::span(dag.cluster_vertices)
      .subspan(dag.vertex_offsets[cluster],
               dag.vertex_offsets[cluster + 1] - dag.vertex_offsets[cluster]);
}

std::span<const uint8_t> triangles_of(const lod::Dag& dag, uint32_t cluster) {
  const size_t first = dag.triangle_offsets[cluster], last = dag.triangle_offsets[cluster + 1];
  return std::span(dag.cluster_triangles).subspan(3 * first, 3 * (last - first));
}

/// The integers of a group's clusters, one after the other.
struct Integers {
  std::vector<int32_t> values;
  std::vector<size_t> first;  // of each cluster
};

Integers quantize_group(const lod::Dag& dag, const VertexFormat& format, const Range& clusters) {
  Integers all;
  size_t vertices = 0;
  for (uint32_t i = 0; i < clusters.count; ++i) {
    all.first.push_back(vertices * components(format));
    vertices += vertices_of(dag, clusters.offset + i).size();
  }
  all.values.resize(vertices * components(format));
  for (uint32_t i = 0; i < clusters.count; ++i) {
    const auto mine = vertices_of(dag, clusters.offset + i);
    quantize(format, dag.vertices, mine,
             std::span(all.values).subspan(all.first[i], mine.size() * components(format)));
  }
  return all;
}

std::vector<ComponentRange> ranges_of(const VertexFormat& format, std::span<const int32_t> values) {
  const uint32_t stride = components(format);
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

void encode_cluster(const lod::Dag& dag, const VertexFormat& format, uint32_t cluster,
                    const int32_t* integers, std::span<const ComponentRange> ranges,
                    std::vector<std::byte>& page) {
  BitWriter out(page);
  const size_t vertices = vertices_of(dag, cluster).size();
  const Walk walk =
      encode_triangles(triangles_of(dag, cluster), static_cast<uint32_t>(vertices), out);
  const uint32_t stride = components(format);
  std::vector<int32_t> ordered(vertices * stride);
  for (size_t v = 0; v < vertices; ++v)
    std::copy_n(integers + size_t{walk.vertices[v]} * stride, stride, ordered.data() + v * stride);
  encode_vertices(format, ordered, walk.parents, ranges, out);
  out.finish();
}

}  // namespace

uint64_t page_header_bytes(const VertexFormat& format, uint32_t clusters) {
  return kPageHeaderBytes + kComponentBytes * components(format) + kClusterEntryBytes * clusters;
}

std::vector<std::byte> encode_page(const lod::Dag& dag, const VertexFormat& format,
                                   uint32_t group) {
  const Range clusters = dag.tables.groups[group].clusters;
  const Integers integers = quantize_group(dag, format, clusters);
  const std::vector<ComponentRange> ranges = ranges_of(format, integers.values);
  std::vector<std::byte> page(page_header_bytes(format, clusters.count));
  std::vector<uint32_t> ends;
  for (uint32_t i = 0; i < clusters.count; ++i) {
    encode_cluster(dag, format, clusters.offset + i, integers.values.data() + integers.first[i],
                   ranges, page);
    ends.push_back(static_cast<uint32_t>(page.size()));
  }
  // A cluster has at most 256 vertices of 16 components; only the number of clusters is free.
  if (page.size() >= std::numeric_limits<uint32_t>::max() / 2)
    throw Error(ErrorCode::kInvalidArgument, "group " + std::to_string(group) + " takes " +
                                                 std::to_string(page.size()) +
                                                 " bytes, but a page has at most 2 GiB");
  page.resize(aligned(page.size(), kPageAlignment));
  ByteWriter out(page);
  out.u32(group);
  out.u32(clusters.offset);
  out.u32(clusters.count);
  out.u32(components(format));
  for (const ComponentRange& range : ranges) {
    out.u32(static_cast<uint32_t>(range.lowest));
    out.u32(range.bits);
  }
  for (uint32_t i = 0; i < clusters.count; ++i) {
    const uint32_t cluster = clusters.offset + i;
    out.u32(ends[i]);
    out.u16(static_cast<uint16_t>(vertices_of(dag, cluster).size() - 1));
    out.u16(static_cast<uint16_t>(triangles_of(dag, cluster).size() / 3 - 1));
  }
  return page;
}

PageHeader decode_page_header(const VertexFormat& format, std::span<const std::byte> page) {
  ByteReader in(page);
  PageHeader header;
  header.group = in.u32();
  header.clusters = in.range();
  if (const uint32_t count = in.u32(); count != components(format))
    corrupt("a page has vertices of " + std::to_string(count) + " components, not of " +
            std::to_string(components(format)));
  header.ranges.resize(components(format));
  for (ComponentRange& range : header.ranges) {
    range.lowest = static_cast<int32_t>(in.u32());
    range.bits = in.u32();
    if (range.bits > 32)
      corrupt("a page's components have " + std::to_string(range.bits) + " bits");
  }
  return header;
}

ClusterEntry decode_cluster_entry(const VertexFormat& format, const PageHeader& header,
                                  std::span<const std::byte> page, uint32_t index,
                                  uint64_t page_bytes) {
  const uint64_t first = page_header_bytes(format, 0);
  ByteReader in(page);
  ClusterEntry entry;
  entry.begin = static_cast<uint32_t>(page_header_bytes(format, header.clusters.count));
  if (index > 0) {
    in.skip_to(first + kClusterEntryBytes * (uint64_t{index} - 1));
    entry.begin = in.u32();
  }
  in.skip_to(first + kClusterEntryBytes * uint64_t{index});
  entry.end = in.u32();
  entry.vertex_count = in.u16() + 1u;
  entry.triangle_count = in.u16() + 1u;
  if (entry.vertex_count > kMaxLocal || entry.triangle_count > kMaxLocal)
    corrupt("a cluster has " + std::to_string(entry.vertex_count) + " vertices and " +
            std::to_string(entry.triangle_count) + " triangles, but at most 256 are possible");
  if (entry.begin > entry.end || entry.end > page_bytes)
    corrupt("a cluster's data lie outside its page");
  return entry;
}

lod::ClusterGeometry decode_cluster(const VertexFormat& format, const PageHeader& header,
                                    const ClusterEntry& entry, std::span<const std::byte> data) {
  lod::ClusterGeometry geometry;
  BitReader in(data);
  geometry.triangles.resize(size_t{3} * entry.triangle_count);
  std::array<Parents, kMaxLocal> parents;
  const std::span<Parents> mine = std::span(parents).first(entry.vertex_count);
  decode_triangles(in, geometry.triangles, mine);
  std::array<int32_t, size_t{kMaxLocal} * kMaxComponents> integers;
  const std::span<int32_t> values =
      std::span(integers).first(size_t{entry.vertex_count} * components(format));
  decode_vertices(format, mine, header.ranges, in, values);
  in.finish();
  dequantize(format, values, geometry);
  return geometry;
}

}  // namespace umbel::asset
