// Looks: 0 the surface's normal, turned to the eye; 1 a colour a cluster; 2 grey, lit from the eye.
vec3 looks(vec3 normal, vec3 to_eye, uint cluster) {
  if (layer == 0) return 0.5 + 0.5 * normal;
  if (layer == 2) return vec3(0.15 + 0.75 * dot(normal, to_eye));
  uint h = (cluster + 1) * 2654435761u;
  vec3 hue = 0.35 + 0.6 * vec3(h >> 24, h >> 16 & 255, h >> 8 & 255) / 255.0;
  return hue * (0.3 + 0.7 * dot(normal, to_eye));
}
