// Writes an asset: pages in file order, coarsest level first, encoded in parallel a batch at a
// time; then the head, which needs their checksums, in front of them.
#include <algorithm>
#include <numeric>

#include "asset/choose_format.hpp"
#include "asset/format.hpp"
#include "asset/page.hpp"
#include "asset/structure.hpp"
#include "base/bytes.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"

namespace umbel {
namespace asset {
namespace {

constexpr size_t kBatchPages = 256;

[[noreturn]] void refuse(const std::string& sentence) {
  throw Error(ErrorCode::kInvalidArgument, sentence);
}

template <typename Vector>
void check_stream(const char* name, const std::vector<Vector>& stream, size_t vertices) {
  if (!stream.empty() && stream.size() != vertices)
    refuse(std::string("the DAG's ") + name + " has " + std::to_string(stream.size()) +
           " elements, but there are " + std::to_string(vertices) + " vertices");
}

void check_offsets(const char* name, const std::vector<uint32_t>& offsets, size_t clusters,
                   size_t size) {
  if (offsets.size() != clusters + 1 || offsets.front() != 0 || offsets.back() != size ||
      !std::is_sorted(offsets.begin(), offsets.end()))
    refuse(std::string("the DAG's ") + name + " must rise from 0 to " + std::to_string(size) +
           " in " + std::to_string(clusters + 1) + " elements");
}

void check_cluster(const lod::Dag& dag, uint32_t cluster) {
  const uint32_t begin = dag.vertex_offsets[cluster], end = dag.vertex_offsets[cluster + 1];
  const auto refuse_cluster = [&](const std::string& what) {
    refuse("cluster " + std::to_string(cluster) + " has " + what);
  };
  const lod::Cluster& entry = dag.tables.clusters[cluster];
  if (entry.vertex_count > 0xffff || entry.triangle_count > 0xffff)
    refuse_cluster("the counts " + std::to_string(entry.vertex_count) + " and " +
                   std::to_string(entry.triangle_count) + ", more than 65535");
  const Range& range = dag.tables.groups[entry.group].clusters;
  if (cluster - range.offset >= range.count)
    refuse_cluster("the group " + std::to_string(entry.group) +
                   ", in whose range of clusters it is not");
  const uint32_t triangles = dag.triangle_offsets[cluster + 1] - dag.triangle_offsets[cluster];
  if (end - begin < 1 || end - begin > kMaxLocal || triangles < 1 || triangles > kMaxLocal)
    refuse_cluster(std::to_string(end - begin) + " vertices and " + std::to_string(triangles) +
                   " triangles, but must have 1 to 256 of each");
  for (uint32_t i = begin; i < end; ++i)
    if (dag.cluster_vertices[i] >= dag.vertices.positions.size())
      refuse_cluster("the vertex " + std::to_string(dag.cluster_vertices[i]) + " of " +
                     std::to_string(dag.vertices.positions.size()));
  const size_t last = size_t{3} * dag.triangle_offsets[cluster + 1];
  for (size_t i = size_t{3} * dag.triangle_offsets[cluster]; i < last; ++i)
    if (dag.cluster_triangles[i] >= end - begin)
      refuse_cluster("a triangle with the local vertex " +
                     std::to_string(dag.cluster_triangles[i]) + " of " +
                     std::to_string(end - begin));
}

/// Refuses what cannot be stored or read back; what is merely wrong is lod::verify's to find.
void check_dag(const lod::Dag& dag) {
  if (const std::string problem = structural_problem(dag.tables); !problem.empty()) refuse(problem);
  const size_t clusters = dag.tables.clusters.size(), vertices = dag.vertices.positions.size();
  check_stream("normals", dag.vertices.normals, vertices);
  check_stream("tangents", dag.vertices.tangents, vertices);
  check_stream("uvs", dag.vertices.uvs, vertices);
  check_stream("colors", dag.vertices.colors, vertices);
  if (clusters == 0) return;
  if (dag.cluster_triangles.size() % 3 != 0)
    refuse("the DAG's cluster_triangles has " + std::to_string(dag.cluster_triangles.size()) +
           " elements, not three a triangle");
  check_offsets("vertex_offsets", dag.vertex_offsets, clusters, dag.cluster_vertices.size());
  check_offsets("triangle_offsets", dag.triangle_offsets, clusters,
                dag.cluster_triangles.size() / 3);
  for (uint32_t c = 0; c < clusters; ++c) check_cluster(dag, c);
}

AssetInfo info_of(const lod::Dag& dag, const std::string& metadata) {
  AssetInfo info;
  for (const lod::Cluster& cluster : dag.tables.clusters) extend(info.bounds, cluster.box);
  info.source_triangles = dag.report.input_triangles;
  info.source_vertices = dag.report.input_vertices;
  info.source_digest = dag.source_digest;
  info.max_triangles = dag.config.max_triangles;
  info.max_vertices = dag.config.max_vertices;
  info.metadata = metadata;
  return info;
}

/// Groups in file order: coarsest level first, within a level as they are numbered.
std::vector<uint32_t> page_order(const lod::Tables& tables) {
  std::vector<uint32_t> order(tables.groups.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return tables.groups[a].level > tables.groups[b].level;
  });
  return order;
}

/// Encodes pages in parallel, a batch at a time, and places each behind the one before; returns
/// where the last ends.
uint64_t write_pages(OutputFile& file, const lod::Dag& dag, Head& head, Progress& progress) {
  const std::vector<uint32_t> order = page_order(dag.tables);
  head.pages.resize(order.size());
  uint64_t at = head_bytes(head);
  std::vector<std::vector<std::byte>> batch;
  for (size_t begin = 0; begin < order.size(); begin += batch.size()) {
    progress.report(static_cast<double>(begin) / static_cast<double>(order.size()), "writing");
    batch.resize(std::min(kBatchPages, order.size() - begin));
    parallel_for(batch.size(), 1,
                 [&](size_t i) { batch[i] = encode_page(dag, head.format, order[begin + i]); });
    for (size_t i = 0; i < batch.size(); ++i) {
      file.write(at, batch[i]);
      head.pages[begin + i] = {at, batch[i].size(), xxh64(batch[i].data(), batch[i].size()),
                               order[begin + i]};
      at += batch[i].size();
    }
  }
  return at;
}

}  // namespace
}  // namespace asset

uint64_t write_asset(const std::filesystem::path& path, const lod::Dag& dag,
                     const std::string& metadata, const BuildOptions& options,
                     const AssetConfig& config) {
  using namespace asset;
  Progress progress(options);
  check_dag(dag);
  Head head{info_of(dag, metadata), choose_format(dag, config), dag.tables, {}};
  OutputFile file(path);
  with_threads(options.threads,
               [&] { head.info.file_bytes = write_pages(file, dag, head, progress); });
  file.write(0, encode_head(head));
  progress.report(1, "writing");
  file.commit();
  return head.info.file_bytes;
}

}  // namespace umbel
