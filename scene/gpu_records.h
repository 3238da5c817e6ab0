// The records of scene/shaders/scene.glsl as C++ (std430). Keep the two files alike.
#pragma once

#include <cstdint>

#include "base/math.h"

namespace tessera::scene {

struct PatchRecord {
  uint32_t first_triangle;  // in GpuScene::indices() / 3
  uint32_t triangle_count;
};
static_assert(sizeof(PatchRecord) == 8);

struct InstanceRecord {
  uint32_t geometry, material;
  uint32_t first_patch, first_triangle;
  uint32_t geometry_first_patch, geometry_first_triangle;
  uint32_t first_instanced_meshlet;
  uint32_t flags;
};
static_assert(sizeof(InstanceRecord) == 32);
constexpr uint32_t kInstanceMoves = 1;

struct MeshletRecord {
  vec3 center;
  float radius;
  uint32_t first_triangle, triangle_count;
  uint32_t first_patch, patch_count;
};
static_assert(sizeof(MeshletRecord) == 32);

struct InstancedMeshlet {
  uint32_t instance, meshlet;
};
static_assert(sizeof(InstancedMeshlet) == 8);

struct TextureUse {
  uint32_t array;
  uint32_t layer_texcoord;
  vec2 columns[3];
};
static_assert(sizeof(TextureUse) == 32);

struct MaterialRecord {
  vec4 base_color;
  vec4 emissive_metallic;
  float roughness, normal_scale, occlusion_strength, alpha_cutoff;
  uint32_t flags;
  uint32_t pad[3];
  TextureUse base_color_texture, metallic_roughness_texture, normal_texture, emissive_texture,
      occlusion_texture;
};
static_assert(sizeof(MaterialRecord) == 224);
constexpr uint32_t kMaterialMask = 1, kMaterialDoubleSided = 2, kMaterialUnlit = 4;

struct InstanceTransform {
  vec4 rows[3];
  vec4 normal[3];
};
static_assert(sizeof(InstanceTransform) == 96);

}  // namespace tessera::scene
