// Writes an asset of DAGs in memory: checks them and encodes their groups in parallel, for
// write_encoded to put into pages.
#include <algorithm>
#include <utility>

#include "asset/codec/choose_format.hpp"
#include "asset/file/group_chunk.hpp"
#include "asset/file/write_encoded.hpp"
#include "base/file.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "base/refuse.hpp"
#include "lod/verify/table_structure.hpp"

namespace umbel {
namespace asset {
namespace {

constexpr size_t kGroupsAtOnce = 256;  // groups
// What encoding takes of all work.
constexpr double kEncoding = 0.9;

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
  const Range& range = dag.tables.groups[entry.group].clusters;
  if (cluster - range.offset >= range.count)
    refuse_cluster("the group " + std::to_string(entry.group) +
                   ", in whose range of clusters it is not");
  const uint32_t triangles = dag.triangle_offsets[cluster + 1] - dag.triangle_offsets[cluster];
  if (end - begin < 1 || end - begin > kMaxLocal || triangles < 1 || triangles > kMaxLocal)
    refuse_cluster(std::to_string(end - begin) + " vertices and " + std::to_string(triangles) +
                   " triangles, but must have 1 to 256 of each");
  if (entry.vertex_count != end - begin || entry.triangle_count != triangles)
    refuse_cluster("the counts " + std::to_string(entry.vertex_count) + " and " +
                   std::to_string(entry.triangle_count) + ", but " + std::to_string(end - begin) +
                   " vertices and " + std::to_string(triangles) + " triangles");
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
  if (const std::string fault = lod::structure_fault(dag.tables); !fault.empty()) refuse(fault);
  const size_t clusters = dag.tables.clusters.size(), vertices = dag.vertices.positions.size();
  check_stream("normals", dag.vertices.normals, vertices);
  check_stream("tangents", dag.vertices.tangents, vertices);
  check_stream("uvs", dag.vertices.uvs, vertices);
  check_stream("colors", dag.vertices.colors, vertices);
  const size_t width = extra_width(dag.vertices.extras);
  if (width > kMostExtraValues || dag.vertices.extra_values.size() != width * vertices)
    refuse("the DAG's extra_values has " + std::to_string(dag.vertices.extra_values.size()) +
           " elements for " + std::to_string(vertices) + " vertices of " + std::to_string(width));
  if (clusters == 0) return;
  if (dag.cluster_triangles.size() % 3 != 0)
    refuse("the DAG's cluster_triangles has " + std::to_string(dag.cluster_triangles.size()) +
           " elements, not three a triangle");
  check_offsets("vertex_offsets", dag.vertex_offsets, clusters, dag.cluster_vertices.size());
  check_offsets("triangle_offsets", dag.triangle_offsets, clusters,
                dag.cluster_triangles.size() / 3);
  for (uint32_t c = 0; c < clusters; ++c) check_cluster(dag, c);
}

void check_meshes(const AssetContents& contents) {
  for (const lod::Dag* dag : contents.meshes) {
    if (dag == nullptr) refuse("one of the asset's meshes is null");
    check_dag(*dag);
  }
}

// All but the groups' chunks.
EncodedMesh describe(const lod::Dag& dag, const AssetConfig& config) {
  EncodedMesh made;
  made.format = choose_format(dag, config);
  AssetMesh& mesh = made.mesh;
  for (const lod::Cluster& cluster : dag.tables.clusters) extend(mesh.bounds, cluster.box);
  mesh.source_triangles = dag.report.input_triangles;
  mesh.source_vertices = dag.report.input_vertices;
  mesh.source_digest = dag.source_digest;
  mesh.groups = static_cast<uint32_t>(dag.tables.groups.size());
  mesh.clusters = static_cast<uint32_t>(dag.tables.clusters.size());
  made.max_triangles = dag.config.max_triangles;
  made.max_vertices = dag.config.max_vertices;
  made.levels = dag.tables.levels;
  made.nodes = dag.tables.nodes;
  for (const lod::Group& group : dag.tables.groups) made.groups.push_back({group});
  return made;
}

class ChunkEncoder {
 public:
  ChunkEncoder(const AssetContents& contents, const AssetConfig& config, Progress& progress)
      : contents_(contents), progress_(progress) {
    for (const lod::Dag* dag : contents.meshes) {
      meshes_.push_back(describe(*dag, config));
      chunks_.emplace_back(dag->tables.groups.size());
    }
  }

  void encode() {
    size_t all = 0, done = 0;
    for (const EncodedMesh& mesh : meshes_) all += mesh.groups.size();
    for (uint32_t m = 0; m < meshes_.size(); ++m)
      for (size_t begin = 0; begin < meshes_[m].groups.size(); begin += kGroupsAtOnce) {
        progress_.report(kEncoding * static_cast<double>(done) / static_cast<double>(all),
                         "writing");
        const size_t count = std::min(kGroupsAtOnce, meshes_[m].groups.size() - begin);
        parallel_for(count, 1, [&](size_t i) { encode(m, static_cast<uint32_t>(begin + i)); });
        done += count;
      }
    for (uint32_t m = 0; m < meshes_.size(); ++m) count_parents(m);
  }

  std::vector<EncodedMesh> take_meshes() { return std::move(meshes_); }
  std::vector<std::byte> take_chunk(const GroupName& name) {
    return std::move(chunks_[name.mesh][name.group]);
  }

 private:
  void encode(uint32_t m, uint32_t g) {
    EncodedMesh& mesh = meshes_[m];
    const GroupView view = group_of(*contents_.meshes[m], g);
    const std::vector<uint32_t> children = children_of(view.clusters);
    check_references(g, children.size());
    chunks_[m][g] =
        encode_chunk({mesh.format, mesh.mesh.bounds, first_material(contents_, m)}, view, children);
    mesh.groups[g].references = static_cast<uint32_t>(children.size());
    mesh.groups[g].chunk_bytes = static_cast<uint32_t>(chunks_[m][g].size());
  }

  void count_parents(uint32_t m) {
    std::vector<GroupEntry>& groups = meshes_[m].groups;
    for (uint32_t g = 0; g < groups.size(); ++g)
      for (uint32_t r = 0; r < groups[g].references; ++r)
        ++groups[referred_group(chunks_[m][g], r)].parents;
  }

  const AssetContents& contents_;
  Progress& progress_;
  std::vector<EncodedMesh> meshes_;
  std::vector<std::vector<std::vector<std::byte>>> chunks_;  // by mesh and group
};

}  // namespace
}  // namespace asset

uint64_t write_asset(const std::filesystem::path& path, const AssetContents& contents,
                     const BuildOptions& options, const AssetConfig& config) {
  using namespace asset;
  Progress progress(options);
  check_contents(contents, config, contents.meshes.size());
  check_meshes(contents);
  OutputFile file(path);
  uint64_t bytes = 0;
  with_threads(options.threads, [&] {
    ChunkEncoder encoder(contents, config, progress);
    encoder.encode();
    bytes = write_encoded(
        file, contents, encoder.take_meshes(), config.page_bytes,
        [&](const GroupName& name) { return encoder.take_chunk(name); }, progress, kEncoding);
  });
  file.commit();
  return bytes;
}

uint64_t write_asset(const std::filesystem::path& path, const lod::Dag& dag,
                     const std::string& metadata, const BuildOptions& options,
                     const AssetConfig& config) {
  AssetContents contents;
  contents.meshes = {&dag};
  contents.metadata = metadata;
  return write_asset(path, contents, options, config);
}

}  // namespace umbel
