// Twists, bends and shakes the mesh: at rest at time 0 and 1, the most between.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

layout(local_size_x = 256) in;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= mesh.vertices) return;
  float wave = sin(3.14159265 * mesh.time);
  float amount = wave * wave;
  vec3 p = mesh.rest.at[i] / mesh.size;
  float angle = 9.4247780 * amount * p.x, c = cos(angle), s = sin(angle);
  p = vec3(p.x, p.y * c - p.z * s, p.y * s + p.z * c);
  if (amount > 1e-3) {
    float bend = 1.8 * amount;
    p.xy = vec2(sin(bend * p.x) * (1 / bend - p.y), 1 / bend - cos(bend * p.x) * (1 / bend - p.y));
  }
  float phase = 31.4159265 * mesh.time;
  p.x += 0.012 * amount * sin(23 * p.x + 31 * p.z + phase);
  p.y += 0.012 * amount * sin(41 * p.x + 17 * p.z + 2 * phase);
  p.z += 0.012 * amount * sin(29 * p.x + 53 * p.z + 3 * phase);
  mesh.positions.at[i] = p * mesh.size;
}
