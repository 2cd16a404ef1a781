// Clusters as runs of triangles in Morton order of their boxes' centres, for any executor (Morton,
// "A computer oriented geodetic data base", 1966): one radix sort; every so many triangles are a
// run.
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/exec.hpp"
#include "cluster/frame/code_grid.hpp"
#include "cluster/frame/frame_mesh.hpp"

namespace umbel::cluster {

/// Indices of triangles in the order of their codes; equal codes in the order of the indices.
template <typename Exec, typename Key>
struct TriangleOrder {
  typename Exec::template Buffer<Key> codes;
  typename Exec::template Buffer<uint32_t> indices;
};

template <typename Key>
UMBEL_HOST_DEVICE Key code_of(const CodeGrid& grid, const FrameMesh& mesh, uint32_t triangle) {
#if UMBEL_BOX_VECTORS
  return grid.template code<Key>(mesh.record(triangle));
#else
  return grid.template code<Key>(mesh.box(triangle));
#endif
}

/// The box around the centres of all triangles' boxes.
template <typename Exec>
void bound_centers(Exec& exec, const FrameMesh& mesh, Aabb* centers) {
#if UMBEL_BOX_VECTORS
  Box4 bounds;
  exec.reduce(
      mesh.size(), Box4::empty(),
      [=](size_t i) {
        const Box4 box = mesh.record(uint32_t(i));
        const Float4 c = box.low * splat(0.5f) - box.negated_high * splat(0.5f);
        return Box4{c, -c};
      },
      [](Box4 a, const Box4& b) {
        a.extend(b);
        return a;
      },
      &bounds);
  *centers = box_of(bounds);
#else
  exec.reduce(
      mesh.count, Aabb{},
      [=] UMBEL_DEVICE_LAMBDA(size_t i) {
        if (i >= mesh.size()) return Aabb{};
        // Into an empty box, which takes no NaN: what a minimum with one gives depends on the
        // order.
        Aabb box;
        extend(box, center(mesh.box(uint32_t(i))));
        return box;
      },
      UniteBoxes{}, centers);
#endif
}

/// Codes of `bits` bits in all: at most 30 for 32-bit keys, 63 for 64-bit ones.
template <typename Key, typename Exec>
TriangleOrder<Exec, Key> order_triangles(Exec& exec, const FrameMesh& mesh, uint32_t bits) {
  const size_t n = mesh.count;
  TriangleOrder<Exec, Key> order{exec.template allocate<Key>(n),
                                 exec.template allocate<uint32_t>(n)};
  const auto centers = exec.template allocate<Aabb>(1);
  const auto grid = exec.template allocate<CodeGrid>(1);
  bound_centers(exec, mesh, centers.data());
  exec.for_each(1, [=, centers = centers.data(), grid = grid.data()] UMBEL_DEVICE_LAMBDA(size_t) {
    *grid = CodeGrid::around(*centers, bits);
  });
  exec.for_each(n, [=, grid = grid.data(), codes = order.codes.data(),
                    indices = order.indices.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
    // What does not exist goes last.
    codes[i] = i < mesh.size() ? code_of<Key>(*grid, mesh, uint32_t(i)) : (Key(1) << bits) - 1;
    indices[i] = static_cast<uint32_t>(i);
  });
  exec.radix_sort_pairs(n, order.codes.data(), order.indices.data(), 0u, bits);
  return order;
}

/// Writes the triangles and the box of each cluster, by a team: triangle i of the clusters is the
/// one at indices[i] of the mesh.
struct WriteClusters {
  static constexpr uint32_t kLanes = 32;
  using Shared = NothingShared;

  FrameMesh mesh;
  const uint32_t* indices;
  FrameClusters out;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t cluster, Shared&) const {
    if (cluster >= *out.count) return;
    // NOLINTNEXTLINE(clang-analyzer-security.ArrayBound): offsets has *out.count + 1 items
    const uint32_t begin = out.offsets[cluster], end = out.offsets[cluster + 1];
    const Aabb box = gather_box(team, mesh, indices + begin, end - begin, [&](uint32_t i) {
      const uint32_t triangle = indices[begin + i];
      out.items[begin + i] = mesh.item(triangle);
      out.triangles[begin + i] = mesh.triangles[triangle];
    });
    // Which of two equal zeros a minimum gives depends on the order.
    if (team.rank() == 0) out.boxes[cluster] = without_negative_zero(box);
  }
};

UMBEL_HOST_DEVICE inline uint32_t runs_of(uint32_t count, uint32_t max_triangles) {
  return static_cast<uint32_t>((uint64_t(count) + max_triangles - 1) / max_triangles);
}

/// Offsets of runs of `size` triangles; the last may have fewer.
template <typename Exec>
void form_runs(Exec& exec, const FrameMesh& mesh, uint32_t size, const FrameClusters& out) {
  exec.for_each(size_t(runs_of(mesh.count, size)) + 1, [=] UMBEL_DEVICE_LAMBDA(size_t c) {
    const uint32_t n = mesh.size(), clusters = runs_of(n, size);
    if (c <= clusters) out.offsets[c] = c == clusters ? n : uint32_t(c * size);
    if (c == 0) *out.count = clusters;
  });
}

}  // namespace umbel::cluster
