#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"
#include "trace.glsl"

layout(location = 0) rayPayloadInEXT Hit hit;

void main() { hit.cluster = kNone; }
