// Reads: the scene; gl_InstanceIndex is an index in instanced_meshlets[]. A draw covers triangles of one
// instance, from the first of that meshlet on. Writes: the id of the draw's first triangle, and what the
// alpha test needs.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene/shaders/scene.glsl"

layout(constant_id = 1) const bool kMasked = false;

layout(push_constant) uniform Draw {
  mat4 view_projection;
};

layout(location = 0) flat out uint first_id;
layout(location = 1) flat out uint material;
layout(location = 2) out vec3 uv_alpha;  // base colour's texture coordinates, vertex alpha

void main() {
  uvec2 pair = instanced_meshlets[gl_InstanceIndex];
  InstanceRecord instance = instances[pair.x];
  gl_Position = view_projection * vec4(to_relative(pair.x, vertex_position(gl_VertexIndex)), 1.0);
  // Ids start at 1: 0 is the background.
  first_id = instance.first_triangle + meshlets[pair.y].first_triangle - instance.geometry_first_triangle + 1;
  material = instance.material;
  uv_alpha = vec3(0.0);
  if (kMasked) {
    Vertex v = vertices[gl_VertexIndex];
    uv_alpha.xy = texture_uv(materials[material].base_color_texture, vec2(v.u0, v.v0), vec2(v.u1, v.v1));
    uv_alpha.z = unpackUnorm4x8(v.color).a;
  }
}
