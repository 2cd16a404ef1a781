// Each triangle's Morton code: bits of the longest axis alone, then of the two longer ones by turns,
// then of all (Vinkler, Bittner & Havran 2017), under a bit that sets large triangles apart.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "mesh.glsl"

layout(local_size_x = 256) in;

uint cell(float center, int k) {
  precise float x = (center * mesh.grid.prescale - mesh.grid.origin[k]) * mesh.grid.scale[k];
  return uint(max(min(x, mesh.grid.last[k]), 0.0));
}

// Two zero bits after each of the low ten.
uint spread_bits(uint x) {
  x = (x | x << 16) & 0x030000ffu;
  x = (x | x << 8) & 0x0300f00fu;
  x = (x | x << 4) & 0x030c30c3u;
  return (x | x << 2) & 0x09249249u;
}

// One zero bit after each of the low 16.
uint spread_pairs(uint x) {
  x = (x | x << 8) & 0x00ff00ffu;
  x = (x | x << 4) & 0x0f0f0f0fu;
  x = (x | x << 2) & 0x33333333u;
  return (x | x << 1) & 0x55555555u;
}

uint code_of(Box box) {
  vec3 center = center_of(box);
  precise vec3 sides = (box.high - box.low) * mesh.grid.prescale;
  bool large = any(greaterThan(sides, vec3(mesh.grid.large)));
  uint cells[3] = {cell(center.x, 0), cell(center.y, 1), cell(center.z, 2)};
  uint of_all = mesh.grid.of_all, of_two = mesh.grid.of_two, mask = (1u << of_all) - 1;
  uint code = (large ? 1u : 0u) << mesh.grid.large_bit;
  for (int k = 0; k < 3; ++k) code |= spread_bits(cells[k] & mask) << mesh.grid.turn[k];
  if (mesh.grid.has_more == 0) return code;
  uint a = cells[mesh.grid.longest] >> of_all, b = cells[mesh.grid.second] >> of_all;
  uint two = spread_pairs(a & (1u << of_two) - 1) << mesh.grid.longest_first |
             spread_pairs(b) << (1 - mesh.grid.longest_first);
  return code | two << 3 * of_all | (a >> of_two) << (3 * of_all + 2 * of_two);
}

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= count) return;
  mesh.keys[0].at[i] = code_of(box_of(mesh.source.at[first + i]));
  mesh.values[0].at[i] = i;
}
