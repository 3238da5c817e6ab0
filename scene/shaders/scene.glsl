// The scene on the device. Reads: set 0 (GpuScene) and set 1 (SceneInstant). Shared by every pass of the server.
// Include after `#version 460` and `#extension GL_GOOGLE_include_directive : require`.
#ifndef TESSERA_SCENE_GLSL
#define TESSERA_SCENE_GLSL

layout(constant_id = 0) const uint kTextureArrays = 1;  // GpuScene::constants()

const uint kNone = 0xffffffffu;

// Packed as floats so that C++ and std430 agree without padding rules: scene::Vertex.
struct Vertex {
  float px, py, pz, u0;
  float nx, ny, nz, v0;
  float tx, ty, tz, tw;
  float u1, v1;
  uint color;
  uint pad;
};

struct PatchRecord {  // one a patch of a geometry (not of an instance)
  uint first_triangle;  // global: in the index buffer / 3
  uint triangle_count;
};

struct InstanceRecord {
  uint geometry;
  uint material;
  uint first_patch;           // global patch id of its first patch
  uint first_triangle;        // global instanced triangle id of its first triangle
  uint geometry_first_patch;  // in patches[]
  uint geometry_first_triangle;  // in the index buffer / 3
  uint first_instanced_meshlet;  // in instanced_meshlets[]
  uint flags;                    // kInstance…
};
const uint kInstanceMoves = 1u;

struct MeshletRecord {
  float cx, cy, cz, radius;  // geometry space
  uint first_triangle;       // global: in the index buffer / 3
  uint triangle_count;
  uint first_patch;  // in patches[]
  uint patch_count;
};

struct TextureUse {     // scene::TextureRef
  uint array;           // kNone = no texture
  uint layer_texcoord;  // layer | texcoord << 16; an array holds one size, format and sampler
  float m00, m10, m01, m11, m02, m12;  // uv = (m00 u + m01 v + m02, m10 u + m11 v + m12)
};

struct MaterialRecord {
  vec4 base_color;
  vec4 emissive_metallic;               // rgb emissive, a metallic
  float roughness, normal_scale, occlusion_strength, alpha_cutoff;
  uint flags;  // kMaterial…
  uint pad0, pad1, pad2;
  TextureUse base_color_texture, metallic_roughness_texture, normal_texture, emissive_texture, occlusion_texture;
};
const uint kMaterialMask = 1u;
const uint kMaterialDoubleSided = 2u;
const uint kMaterialUnlit = 4u;

layout(set = 0, binding = 0, std430) readonly buffer Vertices { Vertex vertices[]; };
layout(set = 0, binding = 1, std430) readonly buffer Indices { uint indices[]; };
layout(set = 0, binding = 2, std430) readonly buffer Patches { PatchRecord patches[]; };
layout(set = 0, binding = 3, std430) readonly buffer Instances { InstanceRecord instances[]; };
layout(set = 0, binding = 4, std430) readonly buffer Meshlets { MeshletRecord meshlets[]; };
layout(set = 0, binding = 5, std430) readonly buffer InstancedMeshlets { uvec2 instanced_meshlets[]; };  // instance, meshlet
layout(set = 0, binding = 6, std430) readonly buffer Materials { MaterialRecord materials[]; };
layout(set = 0, binding = 7) uniform sampler2DArray scene_textures[kTextureArrays];

// Rows of a 3x4 matrix: position relative to the instant's origin = (dot(row0, p), dot(row1, p), dot(row2, p)), p.w = 1.
// normal0..2: rows of the inverse transpose 3x3, any scale; normal0.w = -1 for a mirroring transform, else +1.
struct InstanceTransform {
  vec4 row0, row1, row2;
  vec4 normal0, normal1, normal2;
};
layout(set = 1, binding = 0, std430) readonly buffer Transforms { InstanceTransform transforms[]; };

vec3 vertex_position(uint vertex) { return vec3(vertices[vertex].px, vertices[vertex].py, vertices[vertex].pz); }

vec3 to_relative(uint instance, vec3 p) {
  vec4 h = vec4(p, 1.0);
  return vec3(dot(transforms[instance].row0, h), dot(transforms[instance].row1, h), dot(transforms[instance].row2, h));
}

// Geometry-space normal to world space; not normalised.
vec3 normal_to_world(uint instance, vec3 n) {
  return vec3(dot(transforms[instance].normal0.xyz, n), dot(transforms[instance].normal1.xyz, n),
              dot(transforms[instance].normal2.xyz, n));
}

// Geometry-space direction (tangent) to world space; not normalised.
vec3 direction_to_world(uint instance, vec3 d) {
  return vec3(dot(transforms[instance].row0.xyz, d), dot(transforms[instance].row1.xyz, d),
              dot(transforms[instance].row2.xyz, d));
}

bool is_mirrored(uint instance) { return transforms[instance].normal0.w < 0.0; }

vec2 texture_uv(TextureUse use, vec2 uv0, vec2 uv1) {
  vec2 t = ((use.layer_texcoord >> 16) & 3u) == 1u ? uv1 : uv0;
  return vec2(use.m00 * t.x + use.m01 * t.y + use.m02, use.m10 * t.x + use.m11 * t.y + use.m12);
}

// The same map without its offset, for gradients.
vec2 texture_gradient(TextureUse use, vec2 d0, vec2 d1) {
  vec2 t = ((use.layer_texcoord >> 16) & 3u) == 1u ? d1 : d0;
  return vec2(use.m00 * t.x + use.m01 * t.y, use.m10 * t.x + use.m11 * t.y);
}

// One texture fetch with explicit gradients (level of detail never depends on quad derivatives). `use.array` must be
// dynamically uniform: passes draw or dispatch one material at a time.
vec4 sample_texture(TextureUse use, vec2 uv, vec2 ddx, vec2 ddy) {
  return textureGrad(scene_textures[use.array], vec3(uv, float(use.layer_texcoord & 0xffffu)), ddx, ddy);
}

#endif
