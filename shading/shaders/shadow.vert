#version 460
#extension GL_GOOGLE_include_directive : require
// Casters as a light sees them; first_instance is the instance.
#include "scene/shaders/scene.glsl"

layout(push_constant) uniform Light { mat4 clip_from_relative; } light;

layout(location = 0) flat out uint out_material;
layout(location = 1) out vec2 out_uv0;
layout(location = 2) out vec2 out_uv1;

void main() {
  uint instance = uint(gl_InstanceIndex), vertex = uint(gl_VertexIndex);
  out_material = instances[instance].material;
  out_uv0 = vec2(vertices[vertex].u0, vertices[vertex].v0);
  out_uv1 = vec2(vertices[vertex].u1, vertices[vertex].v1);
  gl_Position = light.clip_from_relative * vec4(to_relative(instance, vertex_position(vertex)), 1.0);
}
