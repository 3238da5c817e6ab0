// Reads: instanced meshlets, the last view's visibility, in the second phase the depth pyramid.
// Writes: each meshlet's bucket if it is to be drawn in this phase, and how many a workgroup found; in the second phase
// the visibility for the next view.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "pvs/shaders/visibility.glsl"

layout(local_size_x = 64) in;

const uint kFrustum = 1u;    // leave out what is outside the view
const uint kOcclusion = 2u;  // first phase: only what the last view saw; second phase: what the pyramid does not hide
const uint kSecondPhase = 4u;

layout(push_constant) uniform Cull {
  vec4 view_rows[3];  // world to camera, relative to the instant's origin
  vec4 fov;           // tangents: left, right, down, up
  float near_m;
  uint width, height;  // of the depth buffer's used part
  uint meshlet_count;
  uint flags;
};

shared uint found[kBuckets];

struct Sphere {
  vec3 center;  // camera axes, z = distance ahead
  float radius;
};

// Largest factor by which the transform lengthens any vector: the root of a Gershgorin bound on its Gram matrix, exact for
// rotations with a scale along the axes.
float largest_stretch(vec3 r0, vec3 r1, vec3 r2) {
  vec3 x = vec3(r0.x, r1.x, r2.x), y = vec3(r0.y, r1.y, r2.y), z = vec3(r0.z, r1.z, r2.z);
  float xy = abs(dot(x, y)), yz = abs(dot(y, z)), zx = abs(dot(z, x));
  return sqrt(max(max(dot(x, x) + xy + zx, dot(y, y) + xy + yz), dot(z, z) + yz + zx));
}

Sphere bounds(uint instance, MeshletRecord meshlet) {
  vec4 p = vec4(meshlet.cx, meshlet.cy, meshlet.cz, 1.0);
  InstanceTransform t = transforms[instance];
  vec4 relative = vec4(to_relative(instance, p.xyz), 1.0);
  Sphere s;
  s.center = vec3(dot(view_rows[0], relative), dot(view_rows[1], relative), -dot(view_rows[2], relative));
  // Room for the rounding of a vertex and of this centre, which grows with the terms that cancel.
  float terms = max(max(dot(abs(t.row0), abs(p)), dot(abs(t.row1), abs(p))), dot(abs(t.row2), abs(p)));
  s.radius = meshlet.radius * largest_stretch(t.row0.xyz, t.row1.xyz, t.row2.xyz) * 1.0001 + 2e-6 * terms;
  return s;
}

bool is_in_frustum(Sphere s) {
  vec4 inside = vec4(s.center.x - fov.x * s.center.z, fov.y * s.center.z - s.center.x,
                     s.center.y - fov.z * s.center.z, fov.w * s.center.z - s.center.y);
  return s.center.z + s.radius > near_m && all(greaterThan(inside, -s.radius * sqrt(1.0 + fov * fov)));
}

// Smallest and largest tangent under which the eye sees a circle (across, ahead) of this radius; it lies ahead of the eye.
vec2 tangent_range(float across, float ahead, float radius) {
  float t = sqrt(max(across * across + ahead * ahead - radius * radius, 0.0));
  return vec2((across * t - ahead * radius) / (ahead * t + across * radius),
              (across * t + ahead * radius) / (ahead * t - across * radius));
}

bool is_occluded(Sphere s) {
  if (s.center.z - s.radius <= near_m) return false;
  vec2 x = tangent_range(s.center.x, s.center.z, s.radius);
  vec2 y = tangent_range(s.center.y, s.center.z, s.radius);
  vec2 pixels = vec2(width, height);
  // Half a pixel of room for rounding. Rows count from the top.
  vec2 low = vec2((x.x - fov.x) / (fov.y - fov.x), (fov.w - y.y) / (fov.w - fov.z)) * pixels - 0.5;
  vec2 high = vec2((x.y - fov.x) / (fov.y - fov.x), (fov.w - y.x) / (fov.w - fov.z)) * pixels + 0.5;
  uvec2 a = uvec2(clamp(low, vec2(0.0), pixels - 1.0)) / kPyramidTile;
  uvec2 b = uvec2(clamp(high, vec2(0.0), pixels - 1.0)) / kPyramidTile;

  uvec2 size = (uvec2(width, height) + kPyramidTile - 1) / kPyramidTile;
  uint level_start = 0;
  while (any(greaterThan(b - a, uvec2(3)))) {  // at most 4x4 fetches
    level_start += size.x * size.y;
    size = half_size(size);
    a /= 2;
    b /= 2;
  }
  float farthest = 1.0;
  for (uint row = a.y; row <= b.y; ++row) {
    for (uint column = a.x; column <= b.x; ++column) {
      farthest = min(farthest, pyramid[level_start + row * size.x + column]);
    }
  }
  float nearest_point = near_m / (s.center.z - s.radius) * 1.00001;
  return nearest_point < farthest;
}

bool is_drawn(uint index, Sphere s) {
  bool visible = (flags & kFrustum) == 0 || is_in_frustum(s);
  if ((flags & kOcclusion) == 0) return visible;
  bool was = was_visible[index] != 0;
  if ((flags & kSecondPhase) == 0) return visible && was;
  visible = visible && !is_occluded(s);
  was_visible[index] = visible ? 1 : 0;
  return visible && !was;
}

void main() {
  if (gl_LocalInvocationID.x < kBuckets) found[gl_LocalInvocationID.x] = 0;
  barrier();
  uint index = gl_GlobalInvocationID.x;
  if (index < meshlet_count) {
    uint instance = instanced_meshlets[index].x;
    bool drawn = is_drawn(index, bounds(instance, meshlets[instanced_meshlets[index].y]));
    uint bucket = drawn ? instance_bucket[instance] : kNone;
    survivor_bucket[index] = bucket;
    if (drawn) atomicAdd(found[bucket], 1);
  }
  barrier();
  if (gl_LocalInvocationID.x < kBuckets) {
    group_counts[gl_WorkGroupID.x * kBuckets + gl_LocalInvocationID.x] = found[gl_LocalInvocationID.x];
  }
}
