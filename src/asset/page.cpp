#include "asset/page.hpp"

#include <algorithm>

#include "base/bytes.hpp"

namespace umbel::asset {
namespace {

constexpr uint64_t kClusterAlignment = 16;

uint64_t vertex_bytes(uint32_t attributes) {
  return 12 + (attributes & kNormals ? 12 : 0) + (attributes & kTangents ? 16 : 0) +
         (attributes & kUvs ? 8 : 0) + (attributes & kColors ? 16 : 0);
}

uint32_t vertices_of(const lod::Dag& dag, uint32_t cluster) {
  return dag.vertex_offsets[cluster + 1] - dag.vertex_offsets[cluster];
}

uint32_t triangles_of(const lod::Dag& dag, uint32_t cluster) {
  return dag.triangle_offsets[cluster + 1] - dag.triangle_offsets[cluster];
}

uint64_t first_data(uint32_t clusters) {
  return aligned(kPageHeaderBytes + kClusterEntryBytes * uint64_t{clusters}, kClusterAlignment);
}

template <typename Vector>
void write_stream(ByteWriter& out, const std::vector<Vector>& stream,
                  std::span<const uint32_t> vertices) {
  for (uint32_t vertex : vertices) out.vector(stream[vertex]);
}

void write_cluster(ByteWriter& out, const lod::Dag& dag, uint32_t attributes, uint32_t cluster) {
  const std::span<const uint32_t> vertices =
      std::span(dag.cluster_vertices)
          .subspan(dag.vertex_offsets[cluster], vertices_of(dag, cluster));
  write_stream(out, dag.vertices.positions, vertices);
  if (attributes & kNormals) write_stream(out, dag.vertices.normals, vertices);
  if (attributes & kTangents) write_stream(out, dag.vertices.tangents, vertices);
  if (attributes & kUvs) write_stream(out, dag.vertices.uvs, vertices);
  if (attributes & kColors) write_stream(out, dag.vertices.colors, vertices);
  out.bytes(dag.cluster_triangles.data() + size_t{3} * dag.triangle_offsets[cluster],
            size_t{3} * triangles_of(dag, cluster));
}

template <typename Vector>
std::vector<Vector> read_stream(ByteReader& in, bool present, uint32_t count) {
  std::vector<Vector> stream;
  if (!present) return stream;
  stream.resize(count);
  if constexpr (std::endian::native == std::endian::little) {
    const auto bytes = in.bytes(count * sizeof(Vector));
    if (count > 0) std::memcpy(stream.data(), bytes.data(), bytes.size());
  } else {
    for (Vector& v : stream) v = in.vector<Vector>();
  }
  return stream;
}

}  // namespace

uint64_t cluster_bytes(uint32_t attributes, uint64_t vertices, uint64_t triangles) {
  return vertex_bytes(attributes) * vertices + 3 * triangles;
}

uint64_t page_bytes(const lod::Dag& dag, uint32_t attributes, uint32_t group) {
  const Range clusters = dag.tables.groups[group].clusters;
  uint64_t at = first_data(clusters.count);
  for (uint32_t c = clusters.offset; c < clusters.offset + clusters.count; ++c)
    at = aligned(at + cluster_bytes(attributes, vertices_of(dag, c), triangles_of(dag, c)),
                 kClusterAlignment);
  if (at >= kNone)
    throw Error(ErrorCode::kInvalidArgument, "group " + std::to_string(group) + " takes " +
                                                 std::to_string(at) +
                                                 " bytes, but a page has at most 4 GiB");
  return aligned(at, kPageAlignment);
}

void encode_page(const lod::Dag& dag, uint32_t attributes, uint32_t group,
                 std::span<std::byte> page) {
  std::fill(page.begin(), page.end(), std::byte{0});
  const Range clusters = dag.tables.groups[group].clusters;
  ByteWriter out(page);
  out.u32(group);
  out.u32(clusters.offset);
  out.u32(clusters.count);
  out.u32(attributes);
  uint64_t data = first_data(clusters.count);
  for (uint32_t i = 0; i < clusters.count; ++i) {
    const uint32_t c = clusters.offset + i;
    out.skip_to(kPageHeaderBytes + kClusterEntryBytes * i);
    out.u32(static_cast<uint32_t>(data));
    out.u32(vertices_of(dag, c));
    out.u32(triangles_of(dag, c));
    out.u32(dag.tables.clusters[c].material);
    out.skip_to(data);
    write_cluster(out, dag, attributes, c);
    data = aligned(out.position(), kClusterAlignment);
  }
}

PageHeader decode_page_header(std::span<const std::byte> bytes) {
  ByteReader in(bytes);
  PageHeader header;
  header.group = in.u32();
  header.clusters = in.range();
  header.attributes = in.u32();
  return header;
}

ClusterEntry decode_cluster_entry(std::span<const std::byte> bytes, uint32_t attributes,
                                  uint64_t size_of_page) {
  ByteReader in(bytes);
  ClusterEntry entry;
  entry.offset = in.u32();
  entry.vertex_count = in.u32();
  entry.triangle_count = in.u32();
  entry.material = in.u32();
  if (entry.vertex_count > kMaxLocalVertices)
    corrupt("a cluster has " + std::to_string(entry.vertex_count) + " vertices, more than 256");
  const uint64_t size = cluster_bytes(attributes, entry.vertex_count, entry.triangle_count);
  if (entry.offset > size_of_page || size > size_of_page - entry.offset)
    corrupt("a cluster's data lies outside its page");
  return entry;
}

lod::ClusterGeometry decode_cluster(std::span<const std::byte> data, uint32_t attributes,
                                    const ClusterEntry& entry) {
  ByteReader in(data);
  lod::ClusterGeometry geometry;
  const uint32_t count = entry.vertex_count;
  geometry.positions = read_stream<Vec3>(in, true, count);
  geometry.normals = read_stream<Vec3>(in, attributes & kNormals, count);
  geometry.tangents = read_stream<Vec4>(in, attributes & kTangents, count);
  geometry.uvs = read_stream<Vec2>(in, attributes & kUvs, count);
  geometry.colors = read_stream<Vec4>(in, attributes & kColors, count);
  const auto indices = in.bytes(size_t{3} * entry.triangle_count);
  const auto* first = reinterpret_cast<const uint8_t*>(indices.data());
  geometry.triangles.assign(first, first + indices.size());
  const auto highest = std::max_element(geometry.triangles.begin(), geometry.triangles.end());
  if (highest != geometry.triangles.end() && *highest >= count)
    corrupt("a triangle has the local vertex " + std::to_string(*highest) + " of " +
            std::to_string(count));
  return geometry;
}

}  // namespace umbel::asset
