// A cluster of the pool: its corners, vertices and triangles.
uint cluster_start(Cluster cluster) {
  return frame.first_word.at[frame.groups.at[cluster.group].page] + cluster.words;
}

vec3 local_position(uint start, uint vertex) {
  uint w = start + 4 * vertex;
  return uintBitsToFloat(uvec3(frame.pool.at[w], frame.pool.at[w + 1], frame.pool.at[w + 2]));
}

uint corner(Cluster cluster, uint start, uint index) {
  uint word = frame.pool.at[start + 4 * cluster.vertices + index / 2];
  return (index & 1) == 0 ? word & 0xffff : word >> 16;
}

// The same bits in mesh and vertex shaders, as world_position.
vec4 clip_position(vec3 p) {
  mat4 m = frame.clip_from_world;
  precise vec4 clip = ((m[0] * p.x + m[1] * p.y) + m[2] * p.z) + m[3];
  return clip;
}
