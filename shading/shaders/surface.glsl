// A point of a triangle with all that shading asks about it. Reads: set 0 and 1 (scene.glsl).
#ifndef TESSERA_SURFACE_GLSL
#define TESSERA_SURFACE_GLSL

#include "scene/shaders/scene.glsl"
#include "shading/shaders/brdf.glsl"
#include "shading/shaders/features.glsl"

// Where an instance stands: the rows of its 3x4 matrix, relative to the instant's origin. Normals go by the cofactors
// of its 3x3 part, which need no inverse and no loads of their own.
struct Stand {
  vec4 row0, row1, row2;
};

Stand load_stand(uint instance) {
  return Stand(transforms[instance].row0, transforms[instance].row1, transforms[instance].row2);
}

vec3 stand_direction(Stand s, vec3 d) { return vec3(dot(s.row0.xyz, d), dot(s.row1.xyz, d), dot(s.row2.xyz, d)); }

vec3 stand_position(Stand s, vec3 p) { return stand_direction(s, p) + vec3(s.row0.w, s.row1.w, s.row2.w); }

// -1 for a mirroring transform, else +1.
float stand_side(Stand s) { return dot(s.row0.xyz, cross(s.row1.xyz, s.row2.xyz)) < 0.0 ? -1.0 : 1.0; }

// Not normalised.
vec3 stand_normal(Stand s, vec3 n) {
  return stand_side(s) * vec3(dot(cross(s.row1.xyz, s.row2.xyz), n), dot(cross(s.row2.xyz, s.row0.xyz), n),
                              dot(cross(s.row0.xyz, s.row1.xyz), n));
}

struct Triangle {
  uint v0, v1, v2;    // in vertices[]
  vec3 a, edge1, edge2;  // first corner and the edges from it, relative to the instant's origin
};

// A place in a triangle: weights of its second and third corner, and how these change along the two axes of the
// sampling grid (pixels or texels). `seen_ddx`, `seen_ddy`: along the pixels of the viewer, where that is another grid,
// else zero. Textures are filtered for the wider of the two.
struct TrianglePoint {
  vec2 weights, ddx, ddy;
  vec2 seen_ddx, seen_ddy;
};

struct SurfacePoint {
  vec3 position;          // relative to the instant's origin
  vec3 geometric_normal;  // unit, out of the front face
  vec3 normal;            // unit, interpolated
  vec4 tangent;           // world direction, w = handedness; zero without normal maps
  vec2 uv0, uv1;
  vec4 uv0_gradient, uv1_gradient;  // ddx, ddy
  vec4 uv0_seen, uv1_seen;          // seen_ddx, seen_ddy
  vec4 color;
};

// `triangle`: in the index buffer / 3.
Triangle fetch_triangle(Stand stand, uint triangle) {
  Triangle t;
  t.v0 = indices[3 * triangle];
  t.v1 = indices[3 * triangle + 1];
  t.v2 = indices[3 * triangle + 2];
  // Edges before the transform: the translation would cost them precision.
  vec3 a = vertex_position(t.v0);
  t.a = stand_position(stand, a);
  t.edge1 = stand_direction(stand, vertex_position(t.v1) - a);
  t.edge2 = stand_direction(stand, vertex_position(t.v2) - a);
  return t;
}

vec3 interpolate_normal(Triangle t, vec2 w) {
  vec3 n0 = vec3(vertices[t.v0].nx, vertices[t.v0].ny, vertices[t.v0].nz);
  vec3 n1 = vec3(vertices[t.v1].nx, vertices[t.v1].ny, vertices[t.v1].nz);
  vec3 n2 = vec3(vertices[t.v2].nx, vertices[t.v2].ny, vertices[t.v2].nz);
  return n0 + w.x * (n1 - n0) + w.y * (n2 - n0);
}

vec4 interpolate_tangent(Triangle t, vec2 w) {
  vec3 t0 = vec3(vertices[t.v0].tx, vertices[t.v0].ty, vertices[t.v0].tz);
  vec3 t1 = vec3(vertices[t.v1].tx, vertices[t.v1].ty, vertices[t.v1].tz);
  vec3 t2 = vec3(vertices[t.v2].tx, vertices[t.v2].ty, vertices[t.v2].tz);
  return vec4(t0 + w.x * (t1 - t0) + w.y * (t2 - t0), vertices[t.v0].tw);
}

vec4 interpolate_color(Triangle t, vec2 w) {
  vec4 c0 = unpackUnorm4x8(vertices[t.v0].color);
  vec4 c1 = unpackUnorm4x8(vertices[t.v1].color);
  vec4 c2 = unpackUnorm4x8(vertices[t.v2].color);
  return c0 + w.x * (c1 - c0) + w.y * (c2 - c0);
}

// uv, then its two derivatives, of one texture coordinate set.
void set_uv0(inout SurfacePoint p, Triangle t, TrianglePoint at) {
  vec2 a = vec2(vertices[t.v0].u0, vertices[t.v0].v0);
  vec2 e1 = vec2(vertices[t.v1].u0, vertices[t.v1].v0) - a;
  vec2 e2 = vec2(vertices[t.v2].u0, vertices[t.v2].v0) - a;
  p.uv0 = a + at.weights.x * e1 + at.weights.y * e2;
  p.uv0_gradient = vec4(at.ddx.x * e1 + at.ddx.y * e2, at.ddy.x * e1 + at.ddy.y * e2);
  p.uv0_seen = vec4(at.seen_ddx.x * e1 + at.seen_ddx.y * e2, at.seen_ddy.x * e1 + at.seen_ddy.y * e2);
}

void set_uv1(inout SurfacePoint p, Triangle t, TrianglePoint at) {
  vec2 a = vec2(vertices[t.v0].u1, vertices[t.v0].v1);
  vec2 e1 = vec2(vertices[t.v1].u1, vertices[t.v1].v1) - a;
  vec2 e2 = vec2(vertices[t.v2].u1, vertices[t.v2].v1) - a;
  p.uv1 = a + at.weights.x * e1 + at.weights.y * e2;
  p.uv1_gradient = vec4(at.ddx.x * e1 + at.ddx.y * e2, at.ddy.x * e1 + at.ddy.y * e2);
  p.uv1_seen = vec4(at.seen_ddx.x * e1 + at.seen_ddx.y * e2, at.seen_ddy.x * e1 + at.seen_ddy.y * e2);
}

// What texture lookups need, and no more: alpha tests stop here.
SurfacePoint texture_point(Triangle t, TrianglePoint at) {
  SurfacePoint p;
  p.position = t.a + at.weights.x * t.edge1 + at.weights.y * t.edge2;
  set_uv0(p, t, at);
  p.uv1 = vec2(0.0);
  p.uv1_gradient = vec4(0.0);
  p.uv1_seen = vec4(0.0);
  if (kSecondTexcoord) set_uv1(p, t, at);
  p.color = vec4(1.0);
  if (kVertexColors) p.color = interpolate_color(t, at.weights);
  p.geometric_normal = vec3(0.0);
  p.normal = vec3(0.0);
  p.tangent = vec4(0.0);
  return p;
}

SurfacePoint surface_point(Stand stand, Triangle t, TrianglePoint at) {
  SurfacePoint p = texture_point(t, at);
  float side = stand_side(stand);
  vec3 interpolated = stand_normal(stand, interpolate_normal(t, at.weights));
  // Scaled, so that neither a crumb's nor a planet's cross product leaves the range of float.
  vec3 reach = max(abs(t.edge1), abs(t.edge2));
  float scale = 1.0 / clamp(max(reach.x, max(reach.y, reach.z)), 1e-18, 1e18);
  vec3 winding = side * cross(t.edge1 * scale, t.edge2 * scale);
  // Vertex normals that cancel out, or a triangle without area: each stands in for the other.
  vec3 unit = safe_normalize(interpolated, vec3(0.0, 1.0, 0.0));
  p.geometric_normal = safe_normalize(winding, unit);
  p.normal = safe_normalize(interpolated, p.geometric_normal);
  if (kNormalMaps) {
    vec4 tangent = interpolate_tangent(t, at.weights);
    p.tangent = vec4(stand_direction(stand, tangent.xyz), side * tangent.w);
  }
  return p;
}

#endif
