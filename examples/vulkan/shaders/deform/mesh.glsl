// A mesh whose positions change, and what clustering it reads and writes. deform/layouts.hpp has the
// same for C++.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

struct Box { vec3 low, high; };

layout(buffer_reference, scalar) buffer Vectors { vec3 at[]; };
layout(buffer_reference, scalar) buffer Triangles { uvec3 at[]; };
layout(buffer_reference, scalar) buffer Words { uint at[]; };
layout(buffer_reference, scalar) buffer Boxes { Box at[]; };

// Cells of Morton codes: see deform/morton_grid.hpp.
layout(buffer_reference, scalar) readonly buffer Grid {
  vec3 origin, scale, last;
  float prescale, large;
  uint turn[3];
  uint longest, second, of_all, of_two, longest_first, has_more, large_bit;
};

layout(buffer_reference, scalar) readonly buffer Mesh {
  Vectors rest, positions;
  Triangles source, triangles;   // read, and written in the order of the clusters
  Words source_items, items;     // which triangle of the caller's each is
  Words keys[2], values[2];      // of the sort, by turns
  Words counts;                  // of digits, by digit and then by workgroup
  Words bounds;                  // of the centres: least and greatest, as ordered()
  Grid grid;
  Words offsets;                 // of clusters, one more than there are
  Boxes boxes;
  uint vertices;
  float time, size;
};

// `first` and `count`: of the triangles that are clustered. `pass`: of the sort.
layout(push_constant, scalar) uniform Push { Mesh mesh; uint first, count, pass, groups; };

const uint kThreads = 256;
const uint kTiles = 16;  // of so many keys, a workgroup of the sort

// Unsigned numbers in the order of floats.
uint ordered(float x) {
  uint u = floatBitsToUint(x);
  return (u & 0x80000000u) != 0 ? ~u : u | 0x80000000u;
}
float unordered(uint u) {
  return uintBitsToFloat((u & 0x80000000u) != 0 ? u & 0x7fffffffu : ~u);
}

Box box_of(uvec3 t) {
  vec3 a = mesh.positions.at[t.x], b = mesh.positions.at[t.y], c = mesh.positions.at[t.z];
  return Box(min(min(a, b), c), max(max(a, b), c));
}

vec3 center_of(Box box) {
  precise vec3 center = box.low * 0.5 + box.high * 0.5;
  return center;
}
