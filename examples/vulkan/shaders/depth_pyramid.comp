// One level of the depth pyramid from the one below. Sizes are halved upwards, so nothing of an odd
// row is lost.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

void main() {
  uint from = 0;
  uvec2 below = frame.size;
  for (uint l = 1; l < layer; ++l) {
    from += below.x * below.y;
    below = (below + 1) / 2;
  }
  uvec2 size = (below + 1) / 2;
  uvec2 at = gl_GlobalInvocationID.xy;
  if (any(greaterThanEqual(at, size))) return;
  float farthest = 1e30;
  for (uint i = 0; i < 4; ++i) {
    uvec2 source = min(2 * at + uvec2(i & 1, i >> 1), below - 1);
    farthest = min(farthest, frame.pyramid.at[from + source.y * below.x + source.x]);
  }
  frame.pyramid.at[from + below.x * below.y + at.y * size.x + at.x] = farthest;
}
