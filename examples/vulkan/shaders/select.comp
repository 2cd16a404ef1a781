// One layer of the hierarchy: nodes that must be refined pass their children on to the next layer,
// groups that must be refined pass on those of their clusters that are in the cut.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"
#include "refine.glsl"
#include "occlusion.glsl"
#include "show.glsl"

layout(local_size_x = 64) in;

bool is_open(uint group, Instance instance) {
  if (frame.usable.at[group] == 0) return false;
  Group g = frame.groups.at[group];
  return isinf(g.error) || g.error > allowed_error(g.center, g.radius, instance);
}

// Of all instances that want a group, the one that wants it the most asks for it: 16 bits of how
// many times its error is too large, then 16 bits of who.
void ask_for(uint group, float error, float allowed, uint instance) {
  if (isinf(error)) return;
  float times = allowed > 0 ? min(error / allowed, 1e30) : 1e30;
  atomicMax(frame.wanted.at[group], floatBitsToUint(max(times, 1.0)) >> 15 << 16 | instance);
}

void pass_on(Node node, uint instance) {
  uint first = atomicAdd(frame.counts.layers[layer + 1].w, node.children);
  if (first + node.children > frame.capacity) {
    frame.counts.overflow = 1;
    return;
  }
  atomicMax(frame.counts.layers[layer + 1].x, (first + node.children + 63) / 64);
  uint half_start = (layer + 1 & 1) * frame.capacity;
  for (uint c = 0; c < node.children; ++c) {
    frame.queue.at[half_start + first + c] = Item(instance, node.first_child + c);
  }
}

void hide(uint cluster, uint instance) {
  uint slot = atomicAdd(frame.counts.hidden.w, 1);
  if (slot >= frame.capacity) {
    frame.counts.overflow = 1;
    return;
  }
  frame.hidden.at[slot] = Item(instance, cluster);
  atomicMax(frame.counts.hidden.x, slot / 64 + 1);
}

void show_group(uint group, Instance instance, uint index) {
  Group g = frame.groups.at[group];
  for (uint c = g.first_cluster; c < g.first_cluster + g.clusters; ++c) {
    Cluster cluster = frame.clusters.at[c];
    if (cluster.generating_group != kNone && is_open(cluster.generating_group, instance)) continue;
    if (box_is_outside(cluster.low, cluster.high, instance)) continue;
    // Instances stand still; where they move, this takes where they were in the last frame.
    if (frame.occlusion != 0 && is_hidden(cluster.low, cluster.high, instance,
                                          frame.last_clip_from_world)) {
      hide(c, index);
    } else {
      show(c, index, 0);
    }
  }
}

void main() {
  uint i = gl_GlobalInvocationID.x;
  // A layer that was too long for its queue has lost items beyond its end.
  if (i >= min(frame.counts.layers[layer].w, frame.capacity)) return;
  Item item = layer == 0 ? Item(i, 0) : frame.queue.at[(layer & 1) * frame.capacity + i];
  Instance instance = frame.instances.at[item.instance];
  Node node = frame.nodes.at[item.index];
  if (is_outside(node.center, node.radius, instance)) return;
  float allowed = allowed_error(node.center, node.radius, instance);
  if (!isinf(node.error) && node.error <= allowed) return;
  if (node.group == kNone) {
    pass_on(node, item.instance);
    return;
  }
  Group g = frame.groups.at[node.group];
  allowed = allowed_error(g.center, g.radius, instance);
  if (!isinf(g.error) && g.error <= allowed) return;
  ask_for(node.group, g.error, allowed, item.instance);
  if (frame.usable.at[node.group] != 0) show_group(node.group, instance, item.instance);
}
