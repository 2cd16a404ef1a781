#include "io/source/mesh_source.hpp"

#include <utility>

#include "io/source/vertex_numbers.hpp"

namespace umbel::io {

MeshSource::MeshSource(const MeshView& mesh, const Vec3d& origin, std::string name)
    : mesh_(mesh), origin_(origin), name_(std::move(name)) {}

SourceStreams MeshSource::streams() const {
  SourceStreams streams;
  streams.normals = !mesh_.normals.empty();
  streams.tangents = !mesh_.tangents.empty();
  streams.uvs = !mesh_.uvs.empty();
  streams.colors = !mesh_.colors.empty();
  streams.materials = !mesh_.materials.empty();
  streams.extras.assign(mesh_.extras.begin(), mesh_.extras.end());
  return streams;
}

TriangleBlock MeshSource::read(uint64_t begin, uint64_t end) const {
  if (begin > end || end > triangles())
    throw Error(ErrorCode::kInvalidArgument, name_ + " has no triangles [" + std::to_string(begin) +
                                                 ", " + std::to_string(end) + ")");
  std::vector<uint32_t> ids;
  ids.reserve(3 * (end - begin));
  for (uint64_t i = begin; i < end; ++i)
    for (uint32_t v : mesh_.triangles[i]) {
      if (v >= mesh_.positions.size())
        throw Error(ErrorCode::kInvalidMesh, name_ + ": triangle " + std::to_string(i) +
                                                 " has vertex index " + std::to_string(v) +
                                                 ", of " + std::to_string(mesh_.positions.size()) +
                                                 " there are");
      ids.push_back(v);
    }
  const std::vector<uint32_t> used = number_vertices(ids);
  TriangleBlock block;
  block.first = begin;
  for (size_t i = 0; i < ids.size(); i += 3)
    block.triangles.push_back({ids[i], ids[i + 1], ids[i + 2]});
  for (uint32_t v : used) {
    const Vec3& p = mesh_.positions[v];
    block.positions.push_back({origin_.x + p.x, origin_.y + p.y, origin_.z + p.z});
  }
  const auto take = [&](const auto& stream, auto& out) {
    if (stream.empty()) return;
    for (uint32_t v : used) out.push_back(stream[v]);
  };
  take(mesh_.normals, block.normals);
  take(mesh_.tangents, block.tangents);
  take(mesh_.uvs, block.uvs);
  take(mesh_.colors, block.colors);
  if (!mesh_.extras.empty()) {
    const size_t width = extra_width(mesh_.extras);
    for (uint32_t v : used) {
      const auto values = mesh_.extra_values.subspan(v * width, width);
      block.extra_values.insert(block.extra_values.end(), values.begin(), values.end());
    }
  }
  if (!mesh_.materials.empty()) {
    const auto materials = mesh_.materials.subspan(begin, end - begin);
    block.materials.assign(materials.begin(), materials.end());
  }
  check_finite(block, name_, begin);
  return block;
}

}  // namespace umbel::io

namespace umbel {

std::unique_ptr<TriangleSource> source_of(const MeshView& mesh, const Vec3d& origin,
                                          std::string name) {
  return std::make_unique<io::MeshSource>(mesh, origin, std::move(name));
}

}  // namespace umbel
