// What shaders read and write, all by address. layouts.hpp has the same for C++.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

struct Node { vec3 center; float radius; float error; uint group, first_child, children; };
struct Group { vec3 center; float radius; float error; uint first_cluster, clusters, page; };
// `words`: where its vertices are, from the start of its page. A vertex takes four words: its
// position and a free one. Triangles follow: three half words each.
struct Cluster { vec3 low, high; uint group, generating_group, words, vertices, triangles; };
// From its space to the world; and the view and the frustum in its space.
struct Instance { vec4 rows[3]; vec3 eye; float threshold; vec4 planes[5]; };
struct Item { uint instance, index; };  // of a queue a node, of the list of the visible a cluster

layout(buffer_reference, scalar) readonly buffer Nodes { Node at[]; };
layout(buffer_reference, scalar) readonly buffer Groups { Group at[]; };
layout(buffer_reference, scalar) readonly buffer Clusters { Cluster at[]; };
layout(buffer_reference, scalar) readonly buffer Instances { Instance at[]; };
layout(buffer_reference, scalar) readonly buffer Words { uint at[]; };
layout(buffer_reference, scalar) buffer Wanted { uint at[]; };
layout(buffer_reference, scalar) buffer Items { Item at[]; };
layout(buffer_reference, scalar) buffer Floats { float at[]; };
// An indirect dispatch a layer of the hierarchy, each with its number of items; the indirect draws
// of both passes, by mesh shaders or without; the indirect dispatch over what the first pass left
// out, with its number; and whether a list was too short.
layout(buffer_reference, scalar) buffer Counts {
  uvec4 layers[32];
  uvec4 mesh_draw[2], draw[2];
  uvec4 hidden;
  uint overflow;
};

// What only a traced picture needs: the top-level structure, the cluster of each geometry, counted
// from its instance's custom index, where the picture goes, and the way through a pixel:
// forward + x right + y up, from -1 to 1 over the picture.
layout(buffer_reference, scalar) buffer Picture { uint at[]; };
layout(buffer_reference, scalar) readonly buffer Rays {
  uint64_t scene;
  Words clusters;
  Picture picture;
  vec3 right, up, forward, sun;
  vec4 background;
  Words positions, triangles, offsets;  // of a deforming mesh
};

layout(buffer_reference, scalar) readonly buffer Frame {
  mat4 clip_from_world, last_clip_from_world;  // of this frame, and of the pyramid so far
  vec4 eye;
  Nodes nodes;
  Groups groups;
  Clusters clusters;
  Instances instances;
  Words pool;    // pages in memory
  Words first_word;  // of each page in the pool; kNone: not there
  Words usable;  // one a group: it and all coarser groups above it are in memory
  Wanted wanted;  // one a group: by which instance the most
  Items queue;   // two halves, for one layer and the next
  Items visible;  // two halves, for the first pass and the second
  Items hidden;  // what the last frame's depth hides
  Floats pyramid;
  Counts counts;
  Rays rays;
  uint capacity;  // of half the list of visible clusters, and of half the queue
  uint occlusion;  // whether what is hidden is left out
  uvec2 size;     // of the picture
};

const uint kNone = 0xffffffffu;
const uint kRow = 128;  // mesh workgroups in a row of the indirect draw

layout(push_constant, scalar) uniform Push { Frame frame; uint layer, pass; };

// `precise`, and in this order: all shaders find the same bits, whoever compiles them.
float along(vec4 row, vec3 p) {
  precise float sum = ((row.x * p.x + row.y * p.y) + row.z * p.z) + row.w;
  return sum;
}

vec3 world_position(vec3 p, Instance instance) {
  return vec3(along(instance.rows[0], p), along(instance.rows[1], p), along(instance.rows[2], p));
}
