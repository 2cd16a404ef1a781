// Whether a group must be refined, to the last bit as docs/selection.md says (without its scaled
// forms for meshes smaller than 1e-15 or larger than 1e19). `precise` forbids fused operations:
// all threads that ask about one group must find the same.
float allowed_error(vec3 center, float radius, Instance instance) {
  precise float x = center.x - instance.eye.x;
  precise float y = center.y - instance.eye.y;
  precise float z = center.z - instance.eye.z;
  precise float s = (x * x + y * y) + z * z;
  precise float away = max(sqrt(s) - radius, 0.0);
  precise float allowed = instance.threshold * away;
  return allowed;
}

bool is_outside(vec3 center, float radius, Instance instance) {
  for (int p = 0; p < 5; ++p) {
    vec4 plane = instance.planes[p];
    // The margin exceeds rounding, so that what is in the picture is never left out.
    float size = dot(abs(plane.xyz), abs(center)) + abs(plane.w);
    if (dot(plane.xyz, center) + plane.w + size * 1e-6 < -radius) return true;
  }
  return false;
}

bool box_is_outside(vec3 low, vec3 high, Instance instance) {
  vec3 half_size = 0.5 * (high - low);
  vec3 center = low + half_size;
  for (int p = 0; p < 5; ++p) {
    vec4 plane = instance.planes[p];
    float size = dot(abs(plane.xyz), abs(center)) + abs(plane.w);
    float reach = dot(abs(plane.xyz), half_size);
    if (dot(plane.xyz, center) + plane.w + size * 1e-6 < -reach) return true;
  }
  return false;
}
