// A triangle of a deforming mesh: each cluster is an instance.
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"
#include "trace.glsl"

layout(location = 0) rayPayloadInEXT Hit hit;

vec3 position(uint vertex) {
  uint w = 3 * vertex;
  Words positions = frame.rays.positions;
  return uintBitsToFloat(uvec3(positions.at[w], positions.at[w + 1], positions.at[w + 2]));
}

void main() {
  uint cluster = gl_InstanceCustomIndexEXT;
  uint t = 3 * (frame.rays.offsets.at[cluster] + gl_PrimitiveID);
  Words corners = frame.rays.triangles;
  vec3 a = position(corners.at[t]), b = position(corners.at[t + 1]), c = position(corners.at[t + 2]);
  hit = Hit(cross(b - a, c - a), gl_HitTEXT, cluster);
}
