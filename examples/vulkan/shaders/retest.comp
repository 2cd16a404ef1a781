// What the last frame's depth hid is tested again with this frame's, which has the first pass by
// now: what is not hidden in truth goes into the second pass.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"
#include "occlusion.glsl"
#include "show.glsl"

layout(local_size_x = 64) in;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= min(frame.counts.hidden.w, frame.capacity)) return;
  Item item = frame.hidden.at[i];
  Cluster cluster = frame.clusters.at[item.index];
  Instance instance = frame.instances.at[item.instance];
  if (is_hidden(cluster.low, cluster.high, instance, frame.clip_from_world)) return;
  show(item.index, item.instance, 1);
}
