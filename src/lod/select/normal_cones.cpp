// Cones of normals of a DAG's clusters, cluster by cluster from wherever the geometry is.
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "umbel/lod/select.hpp"

namespace umbel::lod {
namespace {

ClusterBounds bounds_of(const ClusterGeometry& geometry) {
  std::vector<Triangle> triangles;
  Clusters clusters;
  for (size_t i = 0; i + 2 < geometry.triangles.size(); i += 3) {
    clusters.items.push_back(static_cast<uint32_t>(triangles.size()));
    triangles.push_back(
        {geometry.triangles[i], geometry.triangles[i + 1], geometry.triangles[i + 2]});
  }
  clusters.ranges = {{0, static_cast<uint32_t>(triangles.size())}};
  MeshView mesh;
  mesh.positions = geometry.positions;
  mesh.triangles = triangles;
  return cluster_bounds(mesh, clusters).front();
}

}  // namespace

std::vector<ClusterBounds> normal_cone_bounds(const Tables& tables, const GeometryReader& geometry,
                                              const BuildOptions& options) {
  Progress progress(options);
  std::vector<ClusterBounds> bounds(tables.clusters.size());
  constexpr size_t kBatch = 4096;  // clusters between two calls of the progress callback
  for (size_t begin = 0; begin < bounds.size(); begin += kBatch) {
    progress.report(static_cast<double>(begin) / bounds.size(), "normal cones");
    const size_t count = std::min(kBatch, bounds.size() - begin);
    with_threads(options.threads, [&] {
      parallel_for(count, 16, [&](size_t i) {
        bounds[begin + i] = bounds_of(geometry(static_cast<uint32_t>(begin + i)));
      });
    });
  }
  progress.report(1.0, "done");
  return bounds;
}

}  // namespace umbel::lod
