// How fast an asset is written and decoded on one core: the chunks of its groups, from and to
// memory. Positions are on a grid of 16 bits over the longest side.
//
//   decode_bench [--runs N] MESH.ply... ASSET.umbel...
//
// Medians of N runs of processor time: writing as a share of building; all of decoding, in
// triangles and in bytes of what comes out; triangles alone; what is shared and the vertices, by
// what they take beyond that, in bytes of floats that come out; and a tree for rays over each
// cluster. Of an asset, whatever its attributes are: all of decoding.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

#include "asset/codec/choose_format.hpp"
#include "asset/codec/connectivity.hpp"
#include "asset/file/format.hpp"
#include "asset/file/group_chunk.hpp"
#include "base/math.hpp"
#include "ply_reader.hpp"
#include "umbel/asset.hpp"
#include "umbel/bvh.hpp"

namespace {

namespace asset = umbel::asset;
namespace lod = umbel::lod;

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

template <typename Work>
double median_seconds(int runs, const Work& work) {
  std::vector<double> times;
  for (int run = 0; run < runs; ++run) {
    const double start = processor_seconds();
    work();
    times.push_back(processor_seconds() - start);
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

struct Part {
  std::vector<std::byte> bytes;
  asset::ChunkTables tables;
};

umbel::Aabb box_of(const umbel::Mesh& mesh) {
  umbel::Aabb box;
  for (const umbel::Vec3& p : mesh.positions) umbel::extend(box, umbel::Aabb{p, p});
  return box;
}

/// Reads the triangles of every cluster, and nothing else; a sum, so that all of it happens.
uint64_t read_triangles(const std::vector<Part>& chunks) {
  std::array<uint8_t, 3 * asset::kMaxLocal> triangles;
  std::array<asset::Predictors, asset::kMaxLocal> predictors;
  std::array<uint32_t, asset::kMaxLocal> next{}, previous{};
  uint64_t sum = 0;
  for (const Part& chunk : chunks) {
    uint32_t begin = chunk.tables.first_data;
    for (size_t c = 0; c < chunk.tables.clusters.size(); ++c) {
      umbel::BitReader in(std::span(chunk.bytes).subspan(begin, chunk.tables.ends[c] - begin),
                          chunk.bytes.size() - chunk.tables.ends[c]);
      const lod::Cluster& cluster = chunk.tables.clusters[c];
      asset::decode_triangles(
          asset::kVersionMajor, in, std::span(triangles).first(3 * cluster.triangle_count),
          std::span(predictors).first(cluster.vertex_count), {next.data(), previous.data(), 0});
      sum += triangles[0] + next[0];
      begin = chunk.tables.ends[c];
    }
  }
  return sum;
}

/// Builds the tree of every cluster, as scenes of clusters do; bytes of all trees.
uint64_t build_trees(const std::vector<std::vector<lod::ClusterGeometry>>& groups) {
  const umbel::bvh::Config config = umbel::bvh::preset("fast");
  std::vector<umbel::Aabb> boxes;
  uint64_t bytes = 0;
  for (const auto& group : groups)
    for (const lod::ClusterGeometry& cluster : group) {
      boxes.assign(cluster.triangles.size() / 3, {});
      for (size_t i = 0; i < cluster.triangles.size(); ++i)
        umbel::extend(boxes[i / 3], cluster.positions[cluster.triangles[i]]);
      const umbel::bvh::Bvh2 tree = umbel::bvh::build(boxes, config);
      bytes += tree.nodes.size() * sizeof(umbel::bvh::Node) + tree.primitives.size();
    }
  return bytes;
}

void measure(const std::string& path, int runs) {
  const umbel::Mesh mesh = bench::read_ply(path);
  const umbel::Aabb bounds = box_of(mesh);
  const float longest = std::max(
      {bounds.max.x - bounds.min.x, bounds.max.y - bounds.min.y, bounds.max.z - bounds.min.z});
  lod::Config config;
  config.position_step = std::exp2(std::ceil(std::log2(longest / 65535)));
  const umbel::BuildOptions one{.progress = {}, .threads = 1};
  lod::Dag dag;
  const double building = median_seconds(1, [&] { dag = lod::build(mesh.view(), config, one); });
  const asset::VertexFormat format = asset::choose_format(dag, {});
  umbel::Aabb box;
  for (const lod::Cluster& cluster : dag.tables.clusters) umbel::extend(box, cluster.box);

  std::vector<Part> chunks(dag.tables.groups.size());
  uint64_t triangles = 0, vertices = 0, bytes = 0;
  const double writing = median_seconds(runs, [&] {
    for (uint32_t g = 0; g < chunks.size(); ++g) {
      const asset::GroupView group = asset::group_of(dag, g);
      chunks[g].bytes =
          asset::encode_chunk({format, box}, group, asset::children_of(group.clusters));
    }
  });
  for (uint32_t g = 0; g < chunks.size(); ++g) {
    Part& chunk = chunks[g];
    const auto children =
        static_cast<uint32_t>(asset::children_of(asset::group_of(dag, g).clusters).size());
    chunk.tables = asset::decode_tables(format, box, dag.tables.groups[g].clusters.count, children,
                                        chunk.bytes, asset::kVersionMajor);
    bytes += chunk.bytes.size();
    for (const lod::Cluster& cluster : chunk.tables.clusters)
      triangles += cluster.triangle_count, vertices += cluster.vertex_count;
  }
  uint64_t sum = 0;
  const double all = median_seconds(runs, [&] {
    for (const Part& chunk : chunks)
      sum += asset::decode_clusters(format, chunk.tables, chunk.bytes, chunk.tables.clusters.size())
                 .size();
  });
  const double connectivity = median_seconds(runs, [&] { sum += read_triangles(chunks); });
  std::vector<std::vector<lod::ClusterGeometry>> groups;
  for (const Part& chunk : chunks)
    groups.push_back(
        asset::decode_clusters(format, chunk.tables, chunk.bytes, chunk.tables.clusters.size()));
  uint64_t tree_bytes = 0;
  const double trees = median_seconds(runs, [&] { tree_bytes = build_trees(groups); });
  const auto count = static_cast<double>(triangles);
  const auto clusters = static_cast<double>(dag.tables.clusters.size());
  const double floats = 12 * static_cast<double>(vertices);
  printf(
      "%-24s %6.2f M triangles, %4.2f vertices and %4.2f bytes each; writing %4.1f %% of "
      "building; all %5.1f M/s (%4.2f GB/s); triangles %5.1f M/s; vertices %5.2f GB/s; trees "
      "%4.1f us and %.0f bytes a cluster  (%llu)\n",
      path.substr(path.find_last_of('/') + 1).c_str(), count * 1e-6,
      static_cast<double>(vertices) / count, static_cast<double>(bytes) / count,
      100 * writing / building, count / all * 1e-6, (floats + 3 * count) / all * 1e-9,
      count / connectivity * 1e-6, floats / (all - connectivity) * 1e-9, 1e6 * trees / clusters,
      static_cast<double>(tree_bytes) / clusters, static_cast<unsigned long long>(sum % 10));
}

/// Decodes all clusters of an asset.
void measure_asset(const std::string& path, int runs) {
  const umbel::Asset file(path);
  std::vector<umbel::AssetPage> pages;
  for (uint32_t page = 0; page < file.info().pages; ++page) pages.push_back(file.read_page(page));
  uint64_t triangles = 0;
  const double all = median_seconds(runs, [&] {
    triangles = 0;
    for (const umbel::AssetPage& page : pages)
      for (size_t g = 0; g < page.groups.size(); ++g)
        for (const lod::ClusterGeometry& cluster : file.decode(page, g))
          triangles += cluster.triangles.size() / 3;
  });
  printf("%-24s %6.2f M triangles; all %5.1f M/s, %.2f ms\n",
         path.substr(path.find_last_of('/') + 1).c_str(), static_cast<double>(triangles) * 1e-6,
         static_cast<double>(triangles) / all * 1e-6, 1e3 * all);
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 7, first = 1;
  if (argc > 2 && strcmp(argv[1], "--runs") == 0)
    runs = std::max(static_cast<int>(std::strtol(argv[2], nullptr, 10)), 1), first = 3;
  for (int i = first; i < argc; ++i) {
    const std::string path = argv[i];
    path.ends_with(".umbel") ? measure_asset(path, runs) : measure(path, runs);
  }
  return argc > first ? 0 : 1;
}
