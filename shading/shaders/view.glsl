// One camera of a forward pass. Reads: set 3 (ReferenceRenderer) and the draw's push constant.
#ifndef TESSERA_VIEW_GLSL
#define TESSERA_VIEW_GLSL

#include "shading/shaders/surface.glsl"

layout(set = 3, binding = 1, std140) uniform ViewRecord {
  mat4 clip_from_relative;
  vec4 eye;  // relative to the instant's origin
  // The ray through framebuffer position (x, y), in pixels from the upper left: ray_0 + x ray_x + y ray_y, of length 1
  // along the view's axis.
  vec4 ray_0, ray_x, ray_y;
  vec4 pixel_size;  // xy = of a pixel in clip space
} view;

// The software device repeats a load from a storage buffer for every sample, but not one of a push constant: what all
// samples of a draw share comes here.
layout(push_constant) uniform Draw {
  Stand stand;
  vec2 sample_at;  // in the pixel, (0.5, 0.5) = its centre; y down
  uint first_triangle;  // in the index buffer / 3
  uint instance;
} draw;

// Framebuffer position of the sample that a fragment stands for.
vec2 sample_position(vec4 frag_coord) { return floor(frag_coord.xy) + draw.sample_at; }

// Where the ray through `pixel` meets the triangle's plane (Möller-Trumbore), and the exact derivatives of the weights
// over whole pixels. Clamped to the triangle: rounding at an edge-on triangle must not reach outside it.
TrianglePoint triangle_point(Triangle t, vec2 pixel) {
  vec3 ray = view.ray_0.xyz + pixel.x * view.ray_x.xyz + pixel.y * view.ray_y.xyz;
  vec3 to_eye = view.eye.xyz - t.a;
  vec3 p = cross(t.edge2, to_eye), q = cross(to_eye, t.edge1), n = cross(t.edge2, t.edge1);
  float det = dot(ray, n);
  float inverse = abs(det) > 1e-30 ? 1.0 / det : 0.0;
  vec2 w = vec2(dot(ray, p), dot(ray, q)) * inverse;
  TrianglePoint at;
  at.ddx = (vec2(dot(view.ray_x.xyz, p), dot(view.ray_x.xyz, q)) - w * dot(view.ray_x.xyz, n)) * inverse;
  at.ddy = (vec2(dot(view.ray_y.xyz, p), dot(view.ray_y.xyz, q)) - w * dot(view.ray_y.xyz, n)) * inverse;
  w.x = clamp(w.x, 0.0, 1.0);
  at.weights = vec2(w.x, clamp(w.y, 0.0, 1.0 - w.x));
  at.seen_ddx = vec2(0.0);
  at.seen_ddy = vec2(0.0);
  return at;
}

#endif
