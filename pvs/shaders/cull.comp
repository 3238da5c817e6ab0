// Reads: instanced meshlets, the last view's visibility, in the second phase the depth pyramid.
// Writes: each meshlet's instance if it is to be drawn in this phase, and how many draws a workgroup needs by
// bucket; in the second phase the visibility for the next view.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "pvs/shaders/visibility.glsl"

layout(local_size_x = 64) in;

const uint kFrustum = 1u;  // leave out what is outside the view
// First phase: only what the last view saw. Second phase: what else the pyramid does not hide.
const uint kOcclusion = 2u;
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
shared uint lane_instance[kGroupSize];  // kNone = not drawn

// What the view sees of a box, rounding included.
struct Extent {
  float nearest, farthest;  // distance ahead
  vec4 inside;              // greatest distance inside the planes of left, right, down, up, unscaled
  vec2 low, high;           // tangents; only if the whole box is ahead of the near plane
};

Extent project(uint instance, MeshletBounds box) {
  InstanceTransform t = transforms[instance];
  // Room for the rounding of a vertex, which grows with the terms that cancel.
  vec4 largest = vec4(max(abs(box.low.xyz), abs(box.high.xyz)), 1.0);
  vec3 terms = vec3(dot(abs(t.row0), largest), dot(abs(t.row1), largest), dot(abs(t.row2), largest));
  float slack = 2e-6 * max(max(terms.x, terms.y), terms.z);

  Extent e = Extent(1e38, -1e38, vec4(-1e38), vec2(1e38), vec2(-1e38));
  for (uint corner = 0; corner < 8; ++corner) {
    vec3 p = mix(box.low.xyz, box.high.xyz, bvec3((corner & 1) != 0, (corner & 2) != 0, (corner & 4) != 0));
    vec4 relative = vec4(to_relative(instance, p), 1.0);
    vec2 across = vec2(dot(view_rows[0], relative), dot(view_rows[1], relative));
    float ahead = -dot(view_rows[2], relative);
    e.nearest = min(e.nearest, ahead);
    e.farthest = max(e.farthest, ahead);
    e.inside = max(e.inside, vec4(across.x - fov.x * ahead, fov.y * ahead - across.x,
                                  across.y - fov.z * ahead, fov.w * ahead - across.y));
    e.low = min(e.low, across / ahead);
    e.high = max(e.high, across / ahead);
  }
  e.nearest -= slack;
  e.farthest += slack;
  e.inside += slack * (1.0 + abs(fov));
  e.low -= slack / e.nearest;
  e.high += slack / e.nearest;
  return e;
}

bool is_in_frustum(Extent e) {
  return e.farthest > near_m && all(greaterThan(e.inside, vec4(0.0)));
}

bool is_occluded(Extent e) {
  if (e.nearest <= near_m) return false;
  vec2 pixels = vec2(width, height);
  // Half a pixel of room for rounding. Rows count from the top.
  vec2 low = vec2((e.low.x - fov.x) / (fov.y - fov.x), (fov.w - e.high.y) / (fov.w - fov.z)) * pixels - 0.5;
  vec2 high = vec2((e.high.x - fov.x) / (fov.y - fov.x), (fov.w - e.low.y) / (fov.w - fov.z)) * pixels + 0.5;
  uvec2 a = uvec2(clamp(low, vec2(0.0), pixels - 1.0)) / kPyramidTile;
  uvec2 b = uvec2(clamp(high, vec2(0.0), pixels - 1.0)) / kPyramidTile;

  uvec2 size = (uvec2(width, height) + kPyramidTile - 1) / kPyramidTile;
  uint level_start = 0;
  while (any(greaterThan(b - a, uvec2(7)))) {  // at most 8x8 fetches
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
  return near_m / e.nearest * 1.00001 < farthest;
}

bool is_drawn(uint index, Extent e) {
  bool visible = (flags & kFrustum) == 0 || is_in_frustum(e);
  if ((flags & kOcclusion) == 0) return visible;
  bool was = was_visible[index] != 0;
  if ((flags & kSecondPhase) == 0) return visible && was;
  visible = visible && !is_occluded(e);
  was_visible[index] = visible ? 1 : 0;
  return visible && !was;
}

void main() {
  uint lane = gl_LocalInvocationID.x;
  uint index = gl_GlobalInvocationID.x;
  if (lane < kBuckets) found[lane] = 0;
  uint drawn_instance = kNone;
  if (index < meshlet_count) {
    uint instance = instanced_meshlets[index].x;
    if (is_drawn(index, project(instance, bounds[instanced_meshlets[index].y]))) drawn_instance = instance;
    survivor[index] = drawn_instance;
  }
  lane_instance[lane] = drawn_instance;
  barrier();
  // One draw covers the meshlets of an instance that follow each other.
  if (drawn_instance != kNone && (lane == 0 || lane_instance[lane - 1] != drawn_instance)) {
    atomicAdd(found[instance_bucket[drawn_instance]], 1);
  }
  barrier();
  if (lane < kBuckets) group_counts[gl_WorkGroupID.x * kBuckets + lane] = found[lane];
}
