// Boxes around the positions that triangles use: of the whole mesh, and of each triangle.
#include <cmath>
#include <limits>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "mesh/streams.hpp"

namespace umbel {
namespace {

constexpr float kNanValue = std::numeric_limits<float>::quiet_NaN();
constexpr Vec3 kNan{kNanValue, kNanValue, kNanValue};

Aabb triangle_box(const MeshView& mesh, size_t triangle) {
  Aabb box;
  for (uint32_t vertex : mesh.triangles[triangle]) extend(box, mesh.positions[vertex]);
  return box;
}

bool has_nan(const MeshView& mesh, size_t triangle) {
  for (uint32_t vertex : mesh.triangles[triangle]) {
    const Vec3& p = mesh.positions[vertex];
    if (std::isnan(p.x) || std::isnan(p.y) || std::isnan(p.z)) return true;
  }
  return false;
}

}  // namespace

Aabb bounds(const MeshView& mesh) {
  check_indices(mesh);
  std::vector<Aabb> boxes((mesh.triangles.size() + kTriangleChunk - 1) / kTriangleChunk);
  parallel_chunks(mesh.triangles.size(), kTriangleChunk, [&](size_t begin, size_t end) {
    Aabb box;
    for (size_t i = begin; i < end; ++i) extend(box, triangle_box(mesh, i));
    boxes[begin / kTriangleChunk] = box;
  });
  Aabb all;
  for (const Aabb& box : boxes) extend(all, box);
  return all;
}

std::vector<Aabb> triangle_boxes(const MeshView& mesh, const BuildOptions& options) {
  Progress progress(options);
  progress.report(0, "boxing triangles");
  std::vector<Aabb> boxes;
  with_threads(options.threads, [&] {
    check_indices(mesh);
    boxes.resize(mesh.triangles.size());
    parallel_for(boxes.size(), 1 << 13, [&](size_t i) {
      // Minima and maxima would lose a NaN in silence.
      boxes[i] = has_nan(mesh, i) ? Aabb{kNan, kNan} : triangle_box(mesh, i);
    });
  });
  progress.report(1, "boxing triangles");
  return boxes;
}

}  // namespace umbel
