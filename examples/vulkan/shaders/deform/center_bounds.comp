// The box around the centres of the triangles' boxes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

layout(local_size_x = 256) in;
shared uint low[3], high[3];

void main() {
  if (gl_LocalInvocationIndex < 3) {
    low[gl_LocalInvocationIndex] = 0xffffffffu;
    high[gl_LocalInvocationIndex] = 0;
  }
  barrier();
  uint i = gl_GlobalInvocationID.x;
  if (i < count) {
    vec3 center = center_of(box_of(mesh.source.at[first + i]));
    for (int k = 0; k < 3; ++k) {
      atomicMin(low[k], ordered(center[k]));
      atomicMax(high[k], ordered(center[k]));
    }
  }
  barrier();
  if (gl_LocalInvocationIndex < 3) {
    atomicMin(mesh.bounds.at[gl_LocalInvocationIndex], low[gl_LocalInvocationIndex]);
    atomicMax(mesh.bounds.at[3 + gl_LocalInvocationIndex], high[gl_LocalInvocationIndex]);
  }
}
