// Clusters of one frame, for any executor: Morton runs or their bisection, split to keep the vertex
// limit, written with a new index buffer.
#pragma once

#include <cstdint>

#include "cluster/frame/hybrid.hpp"
#include "cluster/frame/limit_vertices.hpp"
#include "cluster/frame/morton_runs.hpp"
#include "umbel/frame_clusters.hpp"

namespace umbel::cluster {

/// A configuration whose values have been checked and whose defaults are filled in.
struct CheckedFrameConfig {
  BlockConstraints block;
  FrameMethod method;
  uint32_t max_vertices;  ///< 0: no limit
  uint32_t code_bits;     ///< 30 or 63

  static CheckedFrameConfig of(const FrameClusterConfig& config, uint64_t triangles);
  /// Most clusters of so many triangles.
  uint32_t most_clusters(uint32_t triangles) const;
};

/// The clusters that flags mark.
template <typename Exec>
void list_flagged(Exec& exec, const FrameMesh& mesh, const uint8_t* first, uint32_t* offsets,
                  uint32_t* count) {
  exec.select(
      mesh.count, [=] UMBEL_DEVICE_LAMBDA(size_t i) { return first[i] != 0 && i < mesh.size(); },
      offsets, count);
  exec.for_each(1, [=] UMBEL_DEVICE_LAMBDA(size_t) { offsets[*count] = mesh.size(); });
}

template <typename Key, typename Exec>
void build_frame_by(Exec& exec, const FrameMesh& mesh, const CheckedFrameConfig& config,
                    const FrameClusters& out) {
  const uint32_t n = mesh.count;
  const bool is_hybrid = config.method == FrameMethod::kHybrid;
  const auto ordered = exec.template allocate<uint32_t>(is_hybrid ? n : 0);
  const auto first = exec.template allocate<uint8_t>(is_hybrid || config.max_vertices ? n : 0);
  const auto order = order_triangles<Key>(exec, mesh, config.code_bits);
  const uint32_t* indices = order.indices.data();
  if (is_hybrid) {
    bisect_blocks(exec, mesh, order, config.block, ordered.data(), first.data());
    indices = ordered.data();
    list_flagged(exec, mesh, first.data(), out.offsets, out.count);
  } else {
    form_runs(exec, mesh, config.block.max_items, out);
    if (config.max_vertices)
      exec.for_each(n, [first = first.data(), size = config.block.max_items] UMBEL_DEVICE_LAMBDA(
                           size_t i) { first[i] = i % size == 0 ? 1 : 0; });
  }
  const uint32_t most = config.most_clusters(n);
  if (config.max_vertices) {
    limit_vertices(exec, mesh, indices, out.offsets, out.count, most, config.max_vertices,
                   first.data());
    list_flagged(exec, mesh, first.data(), out.offsets, out.count);
  }
  exec.for_each_team(most, WriteClusters{mesh, indices, out});
}

/// `out` has room for config.most_clusters(mesh.count), and one more offset.
template <typename Exec>
void build_frame(Exec& exec, const FrameMesh& mesh, const CheckedFrameConfig& config,
                 const FrameClusters& out) {
  if (mesh.count == 0) {
    exec.for_each(1, [=] UMBEL_DEVICE_LAMBDA(size_t) { *out.count = out.offsets[0] = 0; });
    return;
  }
  if (config.code_bits <= 30)
    build_frame_by<uint32_t>(exec, mesh, config, out);
  else
    build_frame_by<uint64_t>(exec, mesh, config, out);
}

}  // namespace umbel::cluster
