// How many keys of each workgroup have each digit of eight bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

layout(local_size_x = 256) in;
shared uint bins[256];

void main() {
  uint t = gl_LocalInvocationIndex;
  bins[t] = 0;
  barrier();
  for (uint tile = 0; tile < kTiles; ++tile) {
    uint i = (gl_WorkGroupID.x * kTiles + tile) * kThreads + t;
    if (i < count) atomicAdd(bins[mesh.keys[pass & 1].at[i] >> 8 * pass & 255], 1);
  }
  barrier();
  mesh.counts.at[t * groups + gl_WorkGroupID.x] = bins[t];
}
