// Removes the triangles that `validate` rejects: an index out of range, or a corner whose
// position or attributes are not finite. Vertices and the order of triangles stay as they are.
#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "mesh/streams.hpp"

namespace umbel {
namespace {

template <typename T>
std::vector<T> copied(std::span<const T> stream) {
  return {stream.begin(), stream.end()};
}

template <typename T>
std::vector<T> kept_of(std::span<const T> stream, const std::vector<uint8_t>& keep, size_t count) {
  std::vector<T> kept;
  if (stream.empty()) return kept;
  kept.reserve(count);
  for (size_t i = 0; i < stream.size(); ++i)
    if (keep[i]) kept.push_back(stream[i]);
  return kept;
}

}  // namespace

DropResult drop_invalid(const MeshView& mesh, const BuildOptions& options) {
  check_streams(mesh);
  Progress progress(options);
  progress.report(0, "dropping invalid triangles");
  std::vector<uint8_t> keep(mesh.triangles.size());
  with_threads(options.threads, [&] {
    parallel_for(keep.size(), kTriangleChunk,
                 [&](size_t i) { keep[i] = first_invalid_corner(mesh, i) == 3; });
  });
  size_t kept = 0;
  for (uint8_t k : keep) kept += k;

  DropResult result;
  result.dropped = keep.size() - kept;
  result.mesh.positions = copied(mesh.positions);
  result.mesh.normals = copied(mesh.normals);
  result.mesh.tangents = copied(mesh.tangents);
  result.mesh.uvs = copied(mesh.uvs);
  result.mesh.colors = copied(mesh.colors);
  result.mesh.extras = copied(mesh.extras);
  result.mesh.extra_values = copied(mesh.extra_values);
  result.mesh.triangles = kept_of(mesh.triangles, keep, kept);
  result.mesh.materials = kept_of(mesh.materials, keep, kept);
  progress.report(1, "dropping invalid triangles");
  return result;
}

}  // namespace umbel
