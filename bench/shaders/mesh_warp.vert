// One vertex a source pixel, moved to where its depth puts it in the target view.
// Reads: inverse depths. Writes: position, texture coordinate.
#version 460

layout(push_constant, std430) uniform Push {
  mat4 clip_from_source;  // source camera space to the target's clip space
  vec4 fov;               // of the source: tangents left, right, down, up
  uvec2 size;             // of the source, pixels
} push;

layout(set = 0, binding = 0, std430) readonly buffer InverseDepths { float inverse_depths[]; };  // 1/m, 0 = infinitely far

layout(location = 0) out vec2 uv;

// Pixel centres; the outermost vertices reach the border, so that the mesh covers the whole source view.
float grid_position(uint i, uint size) {
  if (i == 0u) return 0.0;
  return i == size - 1u ? 1.0 : (float(i) + 0.5) / float(size);
}

void main() {
  uint index = uint(gl_VertexIndex);
  uv = vec2(grid_position(index % push.size.x, push.size.x), grid_position(index / push.size.x, push.size.y));
  vec3 ray = vec3(mix(push.fov.x, push.fov.y, uv.x), mix(push.fov.w, push.fov.z, uv.y), -1.0);
  // ray * depth in homogeneous coordinates, divided by depth: finite for the background too.
  gl_Position = push.clip_from_source * vec4(ray, inverse_depths[index]);
}
