// The surface of a cluster, seen from any side.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"
#include "looks.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) flat in uint id;
layout(location = 0) out vec4 color;

void main() {
  vec3 normal = normalize(cross(dFdx(position), dFdy(position)));
  vec3 to_eye = normalize(frame.eye.xyz - position);
  if (dot(normal, to_eye) < 0) normal = -normal;
  color = vec4(looks(normal, to_eye, id), 1);
}
