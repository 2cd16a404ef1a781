// Whether a box is behind all that a depth pyramid has seen (Greene, Kass & Miller, Hierarchical
// Z-buffer visibility, 1993). Level 0 is the depth; a texel of a level is the farthest of the two
// by two below. Depth is near / distance: the farthest is the smallest.

// The nearest depth of the corners, and the pixels that the box covers; false if a corner is before
// the near plane.
bool project(vec3 low, vec3 high, Instance instance, mat4 clip_from_world, out float nearest,
             out ivec2 first, out ivec2 last) {
  vec2 least = vec2(1e30), most = vec2(-1e30);
  nearest = 0;
  for (int c = 0; c < 8; ++c) {
    vec3 corner = mix(low, high, bvec3((c & 1) != 0, (c & 2) != 0, (c & 4) != 0));
    vec3 p = world_position(corner, instance);
    vec4 clip = clip_from_world * vec4(p, 1);
    // The margin exceeds rounding, here and where the triangles are drawn.
    float size = 0;
    for (int i = 0; i < 3; ++i) size += abs(clip_from_world[i].w * p[i]);
    float away = clip.w - 1e-6 * (size + abs(clip_from_world[3].w));
    if (away <= clip.z) return false;
    nearest = max(nearest, clip.z / away);
    vec2 pixel = (0.5 * clip.xy / clip.w + 0.5) * vec2(frame.size);
    least = min(least, pixel);
    most = max(most, pixel);
  }
  vec2 end = vec2(frame.size) - 1;
  first = ivec2(clamp(floor(least - 1), vec2(0), end));
  last = ivec2(clamp(floor(most + 1), vec2(0), end));
  return true;
}

bool is_hidden(vec3 low, vec3 high, Instance instance, mat4 clip_from_world) {
  float nearest;
  ivec2 first, last;
  if (!project(low, high, instance, clip_from_world, nearest, first, last)) return false;
  uint start = 0;
  uvec2 size = frame.size;
  while (any(greaterThan(last - first, ivec2(3)))) {
    start += size.x * size.y;
    size = (size + 1) / 2;
    first /= 2;
    last /= 2;
  }
  for (int y = first.y; y <= last.y; ++y) {
    for (int x = first.x; x <= last.x; ++x) {
      if (frame.pyramid.at[start + y * size.x + x] <= nearest) return false;
    }
  }
  return true;
}
