// A vertex as a row of floats: its position, then the values of all streams that the source has.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "io/source/triangle_source.hpp"

namespace umbel::scale {

/// The vertices of a block as rows.
class VertexRows {
 public:
  /// The block and its points must live longer.
  VertexRows(const io::TriangleBlock& block, std::span<const Vec3> points,
             const io::SourceStreams& streams)
      : block_(block), points_(points), streams_(streams) {}

  static uint32_t floats(const io::SourceStreams& streams);
  void append(uint32_t vertex, std::vector<float>& rows) const;
  /// Appends rows to a mesh's streams.
  static void split(std::span<const float> rows, const io::SourceStreams& streams, Mesh& mesh);

 private:
  const io::TriangleBlock& block_;
  std::span<const Vec3> points_;
  const io::SourceStreams& streams_;
};

}  // namespace umbel::scale
