// The triangles in the order of their codes. Four passes have brought the values back to the first.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

layout(local_size_x = 256) in;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  uint from = first + mesh.values[0].at[i];
  mesh.triangles.at[first + i] = mesh.source.at[from];
  mesh.items.at[first + i] = mesh.source_items.at[from];
}
