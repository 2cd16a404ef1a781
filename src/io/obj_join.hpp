// The blocks of an OBJ file as one mesh.
#pragma once

#include <vector>

#include "io/obj.hpp"
#include "io/obj_block.hpp"

namespace umbel::io {

/// How much stands before a block.
struct ObjOffsets {
  ObjCounts rows;
  uint64_t corners = 0, triangles = 0, lines = 0;
};

/// How much stands before the block after this one.
ObjOffsets after(const ObjOffsets& before, const ObjBlock& block);

/// A block whose faces name what is not there.
struct BadIndices {
  bool vertices = false;
  bool attributes = false;
};

/// Makes the block's indices those of the whole file. Ones beyond its tables become kBadIndex.
BadIndices resolve(ObjBlock& block, const ObjCounts& before, const ObjCounts& total);

/// The arrays of blocks that are resolved; takes the blocks apart.
ObjMesh join(std::vector<ObjBlock>& blocks, const std::vector<ObjOffsets>& offsets);

}  // namespace umbel::io
