// The same without mesh shaders: an instance a visible cluster, with as many corners as the largest
// cluster has; what a smaller one has not becomes empty triangles.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"
#include "cluster.glsl"

layout(location = 0) out vec3 position;
layout(location = 1) flat out uint id;

void main() {
  Item item = frame.visible.at[pass * frame.capacity + gl_InstanceIndex];
  Cluster cluster = frame.clusters.at[item.index];
  uint index = uint(gl_VertexIndex);
  position = vec3(0);
  id = item.index;
  gl_Position = vec4(0, 0, 0, 1);
  if (index >= 3 * cluster.triangles) return;
  uint start = cluster_start(cluster);
  vec3 p = local_position(start, corner(cluster, start, index));
  position = world_position(p, frame.instances.at[item.instance]);
  gl_Position = clip_position(position);
}
