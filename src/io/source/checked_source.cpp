#include "io/source/checked_source.hpp"

#include <string>

namespace umbel::io {

TriangleBlock CheckedSource::read(uint64_t begin, uint64_t end) const {
  TriangleBlock block = source_.read(begin, end);
  block.first = begin;
  const std::string name =
      "the block of triangles [" + std::to_string(begin) + ", " + std::to_string(end) + ")";
  const auto expect = [&](size_t size, size_t wanted, const char* what) {
    if (size == wanted) return;
    throw Error(ErrorCode::kInvalidArgument, name + " has " + std::to_string(size) + " of " + what +
                                                 ", not " + std::to_string(wanted));
  };
  const size_t vertices = block.positions.size();
  expect(block.triangles.size(), end - begin, "triangles");
  expect(block.normals.size(), streams_.normals ? vertices : 0, "normals");
  expect(block.tangents.size(), streams_.tangents ? vertices : 0, "tangents");
  expect(block.uvs.size(), streams_.uvs ? vertices : 0, "uvs");
  expect(block.colors.size(), streams_.colors ? vertices : 0, "colors");
  expect(block.extra_values.size(), vertices * extra_width(streams_.extras), "extra values");
  expect(block.materials.size(), streams_.materials ? end - begin : 0, "materials");
  for (size_t i = 0; i < block.triangles.size(); ++i)
    for (const uint32_t v : block.triangles[i])
      if (v >= vertices)
        throw Error(ErrorCode::kInvalidMesh,
                    "triangle " + std::to_string(begin + i) + " has vertex index " +
                        std::to_string(v) + ", of " + std::to_string(vertices) + " in its block");
  check_finite(block, "the source", begin);
  return block;
}

}  // namespace umbel::io
