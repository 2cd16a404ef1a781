// Looks: 0 the surface's normal, turned to the eye; 1 a colour a cluster; 2 grey, lit from the eye.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) flat in uint id;
layout(location = 0) out vec4 color;

void main() {
  vec3 normal = normalize(cross(dFdx(position), dFdy(position)));
  vec3 to_eye = normalize(frame.eye.xyz - position);
  if (dot(normal, to_eye) < 0) normal = -normal;
  vec3 looks = 0.5 + 0.5 * normal;
  if (layer == 1) {
    uint h = (id + 1) * 2654435761u;
    vec3 hue = 0.35 + 0.6 * vec3(h >> 24, h >> 16 & 255, h >> 8 & 255) / 255.0;
    looks = hue * (0.3 + 0.7 * dot(normal, to_eye));
  }
  if (layer == 2) looks = vec3(0.15 + 0.75 * dot(normal, to_eye));
  color = vec4(looks, 1);
}
