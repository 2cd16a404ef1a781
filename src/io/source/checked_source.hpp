// A source that is somebody else's, whose blocks are not believed.
#pragma once

#include "io/source/triangle_source.hpp"

namespace umbel::io {

class CheckedSource final : public TriangleSource {
 public:
  /// The source must live longer.
  explicit CheckedSource(const TriangleSource& source)
      : source_(source), triangles_(source.triangles()), streams_(source.streams()) {}

  uint64_t triangles() const override { return triangles_; }
  SourceStreams streams() const override { return streams_; }
  /// Throws kInvalidMesh for an index beyond the vertices or a value that is not finite, and
  /// kInvalidArgument for a block that is not what was asked for.
  TriangleBlock read(uint64_t begin, uint64_t end) const override;

 private:
  const TriangleSource& source_;
  uint64_t triangles_;
  SourceStreams streams_;
};

}  // namespace umbel::io
