// A cluster's box, a workgroup each.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

layout(local_size_x = 64) in;
shared uint low[3], high[3];

float without_negative_zero(float x) { return x == 0 ? 0 : x; }

void main() {
  uint t = gl_LocalInvocationIndex, cluster = gl_WorkGroupID.x;
  if (t < 3) {
    low[t] = 0xffffffffu;
    high[t] = 0;
  }
  barrier();
  uint end = mesh.offsets.at[cluster + 1];
  for (uint i = mesh.offsets.at[cluster] + t; i < end; i += 64) {
    Box box = box_of(mesh.triangles.at[i]);
    for (int k = 0; k < 3; ++k) {
      atomicMin(low[k], ordered(box.low[k]));
      atomicMax(high[k], ordered(box.high[k]));
    }
  }
  barrier();
  if (t != 0) return;
  Box box;
  for (int k = 0; k < 3; ++k) {
    box.low[k] = without_negative_zero(unordered(low[k]));
    box.high[k] = without_negative_zero(unordered(high[k]));
  }
  mesh.boxes.at[cluster] = box;
}
