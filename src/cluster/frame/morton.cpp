// Clusters of a mesh by its Morton order: runs of it, and blocks of it that are bisected. See
// cluster/frame/morton_runs.hpp and cluster/frame/hybrid.hpp.
#include <algorithm>

#include "base/progress.hpp"
#include "base/refuse.hpp"
#include "cluster/frame/build_frame.hpp"
#include "cluster/validate.hpp"
#include "umbel/frame_clusters.hpp"

namespace umbel {
namespace {

cluster::FrameMesh checked_mesh(const MeshView& mesh, const BuildOptions& options) {
  with_threads(options.threads, [&] { cluster::validate_triangles(mesh, ClusterConfig{}, 0.0f); });
  return {{reinterpret_cast<const char*>(mesh.positions.data()), sizeof(Vec3)},
          mesh.triangles.data(),
          nullptr,
          static_cast<uint32_t>(mesh.triangles.size())};
}

}  // namespace

Clusters cluster_mesh_morton(const MeshView& mesh, const ClusterConfig& config,
                             const BuildOptions& options) {
  if (config.max_items == 0) refuse("max_items must be at least 1, not 0");
  const cluster::FrameMesh input = checked_mesh(mesh, options);
  Progress progress(options);
  progress.report(0, "clustering");
  Clusters out;
  if (input.count == 0) {
    progress.report(1, "clustering");
    return out;
  }
  with_threads(options.threads, [&] {
    CpuExec exec;
    const auto order = cluster::order_triangles<uint32_t>(exec, input, 30);
    progress.report(0.9, "clustering");
    out.items.assign(order.indices.data(), order.indices.data() + input.count);
  });
  for (uint32_t i = 0; i < input.count; i += std::min(config.max_items, input.count - i))
    out.ranges.push_back({i, std::min(config.max_items, input.count - i)});
  out.segments.push_back({0, static_cast<uint32_t>(out.ranges.size())});
  progress.report(1, "clustering");
  return out;
}

Clusters cluster_mesh_hybrid(const MeshView& mesh, const ClusterConfig& config,
                             const BuildOptions& options) {
  cluster::validate_config(config);
  FrameClusterConfig frame;
  frame.max_triangles = config.max_items;
  frame.min_triangles = std::min(config.min_items, std::max(config.max_items / 2, 1u));
  frame.max_vertices = config.max_vertices;
  const auto checked = cluster::CheckedFrameConfig::of(frame, mesh.triangles.size());
  const cluster::FrameMesh input = checked_mesh(mesh, options);
  Progress progress(options);
  progress.report(0, "clustering");
  Clusters out;
  if (input.count == 0) {
    progress.report(1, "clustering");
    return out;
  }
  const uint32_t most = checked.most_clusters(input.count);
  const CpuBuffer<uint32_t> items(input.count), offsets(size_t(most) + 1), count(1);
  const CpuBuffer<Triangle> triangles(input.count);
  const CpuBuffer<Aabb> boxes(most);
  with_threads(options.threads, [&] {
    CpuExec exec;
    cluster::build_frame(
        exec, input, checked,
        {items.data(), triangles.data(), offsets.data(), boxes.data(), count.data()});
  });
  progress.report(0.9, "clustering");
  out.items.assign(items.data(), items.data() + input.count);
  for (uint32_t c = 0; c < count[0]; ++c)
    out.ranges.push_back({offsets[c], offsets[c + 1] - offsets[c]});
  out.segments.push_back({0, count[0]});
  progress.report(1, "clustering");
  return out;
}

}  // namespace umbel
