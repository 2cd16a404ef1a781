// A mesh in memory as a source of triangles.
#pragma once

#include <string>

#include "io/source/triangle_source.hpp"

namespace umbel::io {

class MeshSource final : public TriangleSource {
 public:
  /// The mesh must live longer. Its positions are relative to `origin`; `name` names it in errors.
  MeshSource(const MeshView& mesh, const Vec3d& origin, std::string name);

  uint64_t triangles() const override { return mesh_.triangles.size(); }
  SourceStreams streams() const override;
  TriangleBlock read(uint64_t begin, uint64_t end) const override;

 private:
  MeshView mesh_;
  Vec3d origin_;
  std::string name_;
};

}  // namespace umbel::io
