// Clusters as runs of triangles in Morton order of their box centres (Morton, "A computer
// oriented geodetic data base", 1966): one radix sort, then a cut at every max_items-th.
#include <algorithm>
#include <cmath>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "base/radix_sort.hpp"
#include "cluster/morton_code.hpp"
#include "cluster/source.hpp"
#include "cluster/validate.hpp"

namespace umbel {
namespace {

constexpr size_t kChunk = 1 << 15;
constexpr float kCells = 1024.0f;

// Maps centres to cells of a 1024^3 grid over their box. Each axis has its own scale, in double
// so that no extent overflows or vanishes.
struct Grid {
  explicit Grid(const Aabb& box) {
    const double low[3] = {box.min.x, box.min.y, box.min.z};
    const double high[3] = {box.max.x, box.max.y, box.max.z};
    for (int k = 0; k < 3; ++k) {
      origin[k] = low[k];
      const double extent = high[k] - low[k];
      scale[k] = extent > 0 ? double(kCells) / extent : 0.0;
    }
  }
  uint32_t cell(float center, int k) const {
    return static_cast<uint32_t>(std::clamp((double(center) - origin[k]) * scale[k], 0.0, 1023.0));
  }
  uint32_t code(const Vec3& c) const {
    return cluster::morton30(cell(c.x, 0), cell(c.y, 1), cell(c.z, 2));
  }
  double origin[3], scale[3];
};

}  // namespace

Clusters cluster_mesh_morton(const MeshView& mesh, const ClusterConfig& config,
                             const BuildOptions& options) {
  cluster::validate_config(config);
  with_threads(options.threads, [&] { cluster::validate_triangles(mesh, ClusterConfig{}, 0.0f); });
  Progress progress(options);
  progress.report(0, "clustering");
  const cluster::Source source = cluster::Source::of(mesh, 0.0f);
  const size_t count = mesh.triangles.size();
  Clusters out;
  if (count == 0) return out;
  std::vector<uint64_t> words(count), spare(count);
  const uint64_t* sorted = nullptr;
  with_threads(options.threads, [&] {
    std::vector<Aabb> boxes((count + kChunk - 1) / kChunk);
    parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
      Aabb box;
      for (size_t i = begin; i < end; ++i) extend(box, center(source.box(uint32_t(i))));
      boxes[begin / kChunk] = box;
    });
    Aabb bounds;
    for (const Aabb& box : boxes) extend(bounds, box);
    const Grid grid(bounds);
    parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        words[i] = uint64_t(grid.code(center(source.box(uint32_t(i))))) << 32 | i;
    });
    progress.report(0.4, "clustering");
    sorted = radix_sort(words.data(), spare.data(), count, 32, 62);
  });
  progress.report(0.9, "clustering");
  out.items.resize(count);
  for (size_t i = 0; i < count; ++i) out.items[i] = static_cast<uint32_t>(sorted[i]);
  for (size_t i = 0; i < count; i += config.max_items)
    out.ranges.push_back({uint32_t(i), uint32_t(std::min<size_t>(config.max_items, count - i))});
  out.segments.push_back({0, static_cast<uint32_t>(out.ranges.size())});
  progress.report(1, "clustering");
  return out;
}

}  // namespace umbel
