// Moves keys and values to their places. Within a tile, equal digits keep their order: each thread
// counts those before it in a mask of the threads that have its digit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

layout(local_size_x = 256) in;
const uint kWords = kThreads / 32;
shared uint place[256];
shared uint has[256][kWords];

void main() {
  uint t = gl_LocalInvocationIndex, from = pass & 1, to = 1 - from;
  place[t] = mesh.counts.at[t * groups + gl_WorkGroupID.x];
  for (uint tile = 0; tile < kTiles; ++tile) {
    for (uint w = 0; w < kWords; ++w) has[t][w] = 0;
    barrier();
    uint i = (gl_WorkGroupID.x * kTiles + tile) * kThreads + t;
    bool any = i < count;
    uint key = any ? mesh.keys[from].at[i] : 0, digit = key >> 8 * pass & 255;
    if (any) atomicOr(has[digit][t / 32], 1u << (t & 31));
    barrier();
    if (any) {
      uint before = bitCount(has[digit][t / 32] & (1u << (t & 31)) - 1);
      for (uint w = 0; w < t / 32; ++w) before += bitCount(has[digit][w]);
      mesh.keys[to].at[place[digit] + before] = key;
      mesh.values[to].at[place[digit] + before] = mesh.values[from].at[i];
    }
    barrier();
    for (uint w = 0; w < kWords; ++w) place[t] += bitCount(has[t][w]);
    barrier();
  }
}
