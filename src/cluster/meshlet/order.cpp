// Orders the triangles and vertices within clusters for reuse of what was just transformed, by
// meshoptimizer's meshlet optimiser: greedily the triangle that shares most vertices with the last
// three, then vertices by first use. The optimiser moves triangles without saying which is which,
// so they are found again by their vertices.
#include <meshoptimizer.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <string>
#include <tuple>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "cluster/meshlet/meshlet.hpp"

namespace umbel {
namespace {

using cluster::Meshlet;
using LocalTriangle = std::array<uint8_t, 3>;

// Clusters between two reports of progress.
constexpr size_t kReported = 1 << 12;

// A triangle by the mesh's vertices, and where it stands.
struct Positioned {
  Triangle vertices;
  uint32_t position;
  bool operator<(const Positioned& o) const {
    return std::tie(vertices, position) < std::tie(o.vertices, o.position);
  }
};

Triangle rotated_to_least(const Triangle& t) {
  return std::min({t, Triangle{t[1], t[2], t[0]}, Triangle{t[2], t[0], t[1]}});
}

std::vector<Positioned> positioned(const Meshlet& meshlet, bool any_rotation) {
  std::vector<Positioned> result(meshlet.corners.size());
  for (uint32_t i = 0; i < result.size(); ++i) {
    const LocalTriangle& t = meshlet.corners[i];
    const Triangle named{meshlet.vertices[t[0]], meshlet.vertices[t[1]], meshlet.vertices[t[2]]};
    result[i] = {any_rotation ? rotated_to_least(named) : named, i};
  }
  std::sort(result.begin(), result.end());
  return result;
}

void optimize(Meshlet& meshlet, int level) {
  uint8_t* triangles = meshlet.corners.data()->data();
#if MESHOPTIMIZER_VERSION >= 1020
  meshopt_optimizeMeshletLevel(meshlet.vertices.data(), meshlet.vertices.size(), triangles,
                               meshlet.corners.size(), level);
#else
  (void)level;
  meshopt_optimizeMeshlet(meshlet.vertices.data(), triangles, meshlet.corners.size(),
                          meshlet.vertices.size());
#endif
}

// Orders one cluster, whose items come in their old order and leave in the new one.
void order(Meshlet& meshlet, int level, std::span<uint32_t> items) {
  const std::vector<Positioned> before = positioned(meshlet, level > 0);
  optimize(meshlet, level);
  const std::vector<Positioned> after = positioned(meshlet, level > 0);
  const std::vector<uint32_t> old(items.begin(), items.end());
  for (size_t i = 0; i < before.size(); ++i) items[after[i].position] = old[before[i].position];
}

void check_level(int level) {
  if (level < 0 || level > 9)
    throw Error(ErrorCode::kInvalidArgument,
                "level must be within [0, 9], not " + std::to_string(level));
#if MESHOPTIMIZER_VERSION < 1020
  if (level > 0)
    throw Error(
        ErrorCode::kUnsupported,
        "levels above 0 need meshoptimizer 1.2, and this library was built with an older one");
#endif
}

}  // namespace

ClusterMeshlets order_clusters(const MeshView& mesh, const Clusters& clusters, int level,
                               const BuildOptions& options) {
  check_level(level);
  cluster::validate_clusters(mesh, clusters);
  const size_t count = clusters.ranges.size();
  Progress progress(options);
  ClusterMeshlets out;
  out.items = clusters.items;
  out.corners.resize(clusters.items.size());
  out.vertex_offsets.reserve(count + 1);
  out.vertex_offsets.push_back(0);
  std::vector<std::vector<uint32_t>> vertices(std::min(count, kReported));
  tbb::enumerable_thread_specific<Meshlet> meshlets;
  for (size_t begin = 0; begin < count; begin += kReported) {
    progress.report(double(begin) / double(count), "ordering clusters");
    const size_t size = std::min(kReported, count - begin);
    with_threads(options.threads, [&] {
      parallel_for(size, 16, [&](size_t i) {
        const Range& r = clusters.ranges[begin + i];
        Meshlet& meshlet = meshlets.local();
        meshlet.load(mesh, clusters, begin + i);
        order(meshlet, level, {out.items.data() + r.offset, r.count});
        std::copy(meshlet.corners.begin(), meshlet.corners.end(), out.corners.begin() + r.offset);
        vertices[i] = meshlet.vertices;
      });
    });
    for (size_t i = 0; i < size; ++i) {
      out.vertices.insert(out.vertices.end(), vertices[i].begin(), vertices[i].end());
      if (out.vertices.size() >= kNone)
        throw Error(ErrorCode::kUnsupported,
                    "the clusters have more vertices than 32-bit offsets can count");
      out.vertex_offsets.push_back(static_cast<uint32_t>(out.vertices.size()));
    }
  }
  progress.report(1, "ordering clusters");
  return out;
}

}  // namespace umbel
