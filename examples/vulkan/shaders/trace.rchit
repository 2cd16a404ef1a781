// Which cluster was hit, and its triangle's normal from the page in the pool.
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"
#include "cluster.glsl"
#include "trace.glsl"

layout(location = 0) rayPayloadInEXT Hit hit;

void main() {
  uint id = frame.rays.clusters.at[gl_InstanceCustomIndexEXT + gl_GeometryIndexEXT];
  Cluster cluster = frame.clusters.at[id];
  uint start = cluster_start(cluster);
  vec3 p[3];
  for (uint k = 0; k < 3; ++k) {
    p[k] = gl_ObjectToWorldEXT *
           vec4(local_position(start, corner(cluster, start, 3 * gl_PrimitiveID + k)), 1);
  }
  hit = Hit(cross(p[1] - p[0], p[2] - p[0]), gl_HitTEXT, id);
}
