// Follows moved vertices: takes the new corners in, leaf by leaf in parallel, and then recomputes
// the boxes above, children before parents, subtrees side by side. The tree's shape
// stays, so its quality falls as the mesh deforms. By how much is told by the cost of the wide
// tree, before against after, because the binary tree that it came from is gone.
#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "bvh/walk.hpp"

namespace umbel {
namespace {

constexpr size_t kNodesAtOnce = 256, kVerticesAtOnce = size_t{1} << 14;
/// Rays take measurably longer from about here on (docs/bvh.md).
constexpr double kRebuildRatio = 1.5;

/// What visits cost, weighed by area and, for trees without any, each as one. Doubles, so that
/// nothing overflows or vanishes.
struct Cost {
  double by_area = 0, by_visits = 0;

  void add(const Aabb& box, double visit) {
    const double x = double(box.max.x) - box.min.x, y = double(box.max.y) - box.min.y;
    const double z = double(box.max.z) - box.min.z;
    by_area += visit * (x * y + y * z + z * x);
    by_visits += visit;
  }
  void add(const Cost& other) {
    by_area += other.by_area;
    by_visits += other.by_visits;
  }
  double relative_to(const Aabb& bounds) const {
    Cost root;
    root.add(bounds, 1);
    return root.by_area > 0 ? by_area / root.by_area : by_visits;
  }
};

struct Costs {
  Cost before, after;
  void add(const Costs& other) {
    before.add(other.before);
    after.add(other.after);
  }
};

class Refit {
 public:
  Refit(TriangleBvhData& data, const MeshView& mesh) : data_(data), mesh_(mesh) {}

  /// Returns what the tree costs now as a multiple of what it cost before.
  double run() {
    Costs costs = move_leaves();
    const Aabb before = data_.bounds;
    data_.bounds = move_node(0, 0, costs);
    costs.before.add(before, data_.cost.traversal);
    costs.after.add(data_.bounds, data_.cost.traversal);
    return costs.after.relative_to(data_.bounds) / costs.before.relative_to(before);
  }

 private:
  static constexpr uint32_t kParallelLevels = 3;

  Costs move_leaves() {
    std::vector<Costs> parts((data_.node_count() + kNodesAtOnce - 1) / kNodesAtOnce);
    parallel_chunks(data_.node_count(), kNodesAtOnce, [&](size_t begin, size_t end) {
      Costs& part = parts[begin / kNodesAtOnce];
      for (size_t node = begin; node < end; ++node)
        move_leaves_of(static_cast<uint32_t>(node), part);
    });
    Costs sum;
    for (const Costs& part : parts) sum.add(part);
    return sum;
  }

  void move_leaves_of(uint32_t node, Costs& costs) {
    for (uint32_t slot = 0; slot < data_.width; ++slot) {
      const uint32_t link = data_.link(node, slot);
      if (link == kNoChild || !TriangleBvhData::is_leaf(link)) continue;
      const double visit = double(data_.cost.intersection) * TriangleBvhData::leaf_size(link);
      costs.before.add(data_.box(node, slot), visit);
      const Aabb box = move_leaf(link);
      costs.after.add(box, visit);
      data_.set_box(node, slot, box);
    }
  }

  uint32_t* leaf_words(uint32_t link) {
    return data_.leaves.data() +
           size_t{TriangleBvhData::first_reference(link)} * data_.reference_words();
  }

  Aabb move_leaf(uint32_t link) {
    const uint32_t n = TriangleBvhData::leaf_size(link);
    uint32_t* const words = leaf_words(link);
    const uint32_t* const primitives = words + size_t{data_.corner_words()} * n;
    Aabb box;
    for (uint32_t i = 0; i < n; ++i) {
      const Triangle& triangle = mesh_.triangles[primitives[i]];
      for (uint32_t corner = 0; corner < 3; ++corner) {
        const Vec3& p = mesh_.positions[triangle[corner]];
        extend(box, p);
        if (data_.compact) {
          move_vertex(data_.vertices[words[corner * n + i]], p);
          continue;
        }
        uint32_t* const row = words + size_t{3} * corner * n + i;
        row[0] = std::bit_cast<uint32_t>(p.x);
        row[n] = std::bit_cast<uint32_t>(p.y);
        row[size_t{2} * n] = std::bit_cast<uint32_t>(p.z);
      }
    }
    return box;
  }

  /// Several leaves may do so at once: all say the same.
  static void move_vertex(Vec3& vertex, const Vec3& p) {
    std::atomic_ref(vertex.x).store(p.x, std::memory_order_relaxed);
    std::atomic_ref(vertex.y).store(p.y, std::memory_order_relaxed);
    std::atomic_ref(vertex.z).store(p.z, std::memory_order_relaxed);
  }

  /// Boxes of inner nodes; returns that of all below. Sums are taken in the order of the slots,
  /// whatever the threads.
  Aabb move_node(uint32_t node, uint32_t level, Costs& costs) {
    Aabb box;
    if (level >= kParallelLevels) {
      for (uint32_t slot = 0; slot < data_.width; ++slot)
        extend(box, move_child(node, slot, level, costs));
      return box;
    }
    std::array<Aabb, 8> boxes;
    std::array<Costs, 8> parts;
    parallel_for(data_.width, 1, [&](size_t slot) {
      boxes[slot] = move_child(node, static_cast<uint32_t>(slot), level, parts[slot]);
    });
    for (uint32_t slot = 0; slot < data_.width; ++slot) {
      extend(box, boxes[slot]);
      costs.add(parts[slot]);
    }
    return box;
  }

  Aabb move_child(uint32_t node, uint32_t slot, uint32_t level, Costs& costs) {
    const uint32_t link = data_.link(node, slot);
    if (link == kNoChild) return {};
    const Aabb before = data_.box(node, slot);
    if (TriangleBvhData::is_leaf(link)) return before;
    const Aabb box = move_node(link, level + 1, costs);
    costs.before.add(before, data_.cost.traversal);
    costs.after.add(box, data_.cost.traversal);
    data_.set_box(node, slot, box);
    return box;
  }

  TriangleBvhData& data_;
  const MeshView& mesh_;
};

bool any_vertex_is_not_finite(std::span<const Vec3> positions) {
  std::vector<uint8_t> bad((positions.size() + kVerticesAtOnce - 1) / kVerticesAtOnce);
  parallel_chunks(positions.size(), kVerticesAtOnce, [&](size_t begin, size_t end) {
    // A product with 0 is NaN for what is not finite, and sums keep it.
    float sum = 0;
    for (size_t i = begin; i < end; ++i)
      sum += positions[i].x * 0.0f + positions[i].y * 0.0f + positions[i].z * 0.0f;
    bad[begin / kVerticesAtOnce] = sum != 0;
  });
  return std::find(bad.begin(), bad.end(), 1) != bad.end();
}

bool any_index_is_out_of_range(const MeshView& mesh) {
  std::vector<uint32_t> highest((mesh.triangles.size() + kVerticesAtOnce - 1) / kVerticesAtOnce);
  parallel_chunks(mesh.triangles.size(), kVerticesAtOnce, [&](size_t begin, size_t end) {
    uint32_t most = 0;
    for (size_t i = begin; i < end; ++i)
      most = std::max({most, mesh.triangles[i][0], mesh.triangles[i][1], mesh.triangles[i][2]});
    highest[begin / kVerticesAtOnce] = most;
  });
  return std::any_of(highest.begin(), highest.end(),
                     [&](uint32_t index) { return index >= mesh.positions.size(); });
}

/// Only what the tree holds: triangles that were dropped at the build may still be invalid.
void check_triangles(const TriangleBvhData& data, const MeshView& mesh) {
  for (uint32_t node = 0; node < data.node_count(); ++node)
    for (uint32_t slot = 0; slot < data.width; ++slot) {
      const uint32_t link = data.link(node, slot);
      if (link == kNoChild || !TriangleBvhData::is_leaf(link)) continue;
      data.for_each_triangle(link, [&](const LeafTriangle& t) {
        for (const uint32_t vertex : mesh.triangles[t.primitive]) {
          if (vertex >= mesh.positions.size())
            throw Error(ErrorCode::kInvalidMesh,
                        "triangle " + std::to_string(t.primitive) + ": vertex index " +
                            std::to_string(vertex) + " is out of range, the mesh has " +
                            std::to_string(mesh.positions.size()) + " vertices");
          if (!is_finite(mesh.positions[vertex]))
            throw Error(ErrorCode::kInvalidMesh, "triangle " + std::to_string(t.primitive) +
                                                     ": the position of vertex " +
                                                     std::to_string(vertex) + " is not finite");
        }
      });
    }
}

void check_mesh(const TriangleBvhData& data, const MeshView& mesh) {
  if (mesh.triangles.size() != data.triangle_count)
    throw Error(ErrorCode::kInvalidArgument, "refit takes the triangles of the build, which were " +
                                                 std::to_string(data.triangle_count) +
                                                 ", but the mesh has " +
                                                 std::to_string(mesh.triangles.size()));
  if (any_index_is_out_of_range(mesh) || any_vertex_is_not_finite(mesh.positions))
    check_triangles(data, mesh);
}

}  // namespace

RefitReport TriangleBvh::refit(const MeshView& mesh, const BuildOptions& options) {
  TriangleBvhData& data = *data_;
  Progress progress(options);
  progress.report(0, "refit");
  with_threads(options.threads, [&] {
    check_mesh(data, mesh);
    if (!data.nodes.empty()) data.sah_cost *= Refit(data, mesh).run();
    prepare_rays(data);
  });
  progress.report(1, "refit");
  return {data.sah_cost, data.built_sah_cost, data.sah_cost > kRebuildRatio * data.built_sah_cost};
}

}  // namespace umbel
