// Where each workgroup's keys of each digit go: sums of the counts before, a thread a digit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

layout(local_size_x = 256) in;
shared uint sums[256];

void main() {
  uint t = gl_LocalInvocationIndex, own = 0;
  for (uint g = 0; g < groups; ++g) own += mesh.counts.at[t * groups + g];
  sums[t] = own;
  barrier();
  // Hillis & Steele 1986.
  for (uint step = 1; step < kThreads; step *= 2) {
    uint before = t >= step ? sums[t - step] : 0;
    barrier();
    sums[t] += before;
    barrier();
  }
  uint sum = sums[t] - own;
  for (uint g = 0; g < groups; ++g) {
    uint there = mesh.counts.at[t * groups + g];
    mesh.counts.at[t * groups + g] = sum;
    sum += there;
  }
}
