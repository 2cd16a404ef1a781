// A source without its attributes: positions, triangles and materials.
#pragma once

#include "io/source/triangle_source.hpp"

namespace umbel::io {

class PlainSource final : public TriangleSource {
 public:
  /// The source must live longer.
  explicit PlainSource(const TriangleSource& source) : source_(source) {}

  uint64_t triangles() const override { return source_.triangles(); }
  SourceStreams streams() const override {
    SourceStreams streams;
    streams.materials = source_.streams().materials;
    return streams;
  }
  TriangleBlock read(uint64_t begin, uint64_t end) const override {
    TriangleBlock block = source_.read(begin, end);
    block.normals = {};
    block.tangents = {};
    block.uvs = {};
    block.colors = {};
    block.extra_values = {};
    return block;
  }

 private:
  const TriangleSource& source_;
};

}  // namespace umbel::io
