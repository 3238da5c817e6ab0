// A scene as the rest of the house sees it, after import: geometries cut into meshlets and patches, instances
// that place them, materials, textures, lights, animations. Plain values; immutable after import but for
// animation.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/math.h"
#include "base/time.h"

namespace tessera::scene {

// Index of a patch over all instances: Instance::first_patch + index of the patch in its geometry.
using PatchId = uint32_t;
constexpr uint32_t kNone = 0xffffffffu;

// Same layout as `Vertex` in scene/shaders/scene.glsl (std430, 64 bytes).
struct Vertex {
  vec3 position;
  float u0;
  vec3 normal;  // unit
  float v0;
  vec4 tangent;  // unit; w = handedness (+1 or -1), bitangent = w * cross(normal, tangent)
  vec2 uv1;
  uint32_t color;  // RGBA8 unorm, linear
  uint32_t pad = 0;
};
static_assert(sizeof(Vertex) == 64);

// 1 to 3 adjacent triangles that share one rectangular block of the atlas (thesis fig. 3.3, 3.4). Corners (u
// to the right, v down) and triangles, always in this order and with the winding of the source:
//   1 triangle   (0,0) (1,0) (0,1)
//   2 triangles  + (1,1) (0,1) (1,0)                    the two share the edge (1,0)-(0,1)
//   3 triangles  (0,0) (1,0) (.5,1);  (0,1) (0,0) (.5,1);  (1,0) (1,1) (.5,1)
// See patch_corners() for the same as data.
struct Patch {
  uint32_t first_triangle;  // in its geometry; its triangles follow each other
  uint32_t triangle_count;  // 1..3
};

// A cluster of at most kMeshletTriangles triangles, made of whole patches; the unit of culling.
struct Meshlet {
  uint32_t first_triangle, triangle_count;
  uint32_t first_patch, patch_count;
  vec3 center;  // bounding sphere, geometry space
  float radius;
};
constexpr uint32_t kMeshletTriangles = 124;

// One glTF primitive: triangles of one material slot. Shared by all instances that place it. Triangles are
// ordered by meshlet, then by patch.
struct Geometry {
  std::string name;
  std::vector<Vertex> vertices;
  std::vector<uint32_t> indices;  // 3 a triangle
  std::vector<Patch> patches;
  std::vector<Meshlet> meshlets;
  Aabb bounds;
  uint32_t triangle_count() const { return static_cast<uint32_t>(indices.size() / 3); }
};

enum class AlphaMode : uint32_t { opaque, mask, blend };  // blend is drawn opaque for now, in every pass

// KHR_texture_transform is folded into `uv_from_texcoord`.
struct TextureRef {
  uint32_t texture = kNone;                                                  // index into Scene::textures
  uint32_t texcoord = 0;                                                     // 0 or 1
  std::array<vec2, 3> uv_from_texcoord{vec2(1, 0), vec2(0, 1), vec2(0, 0)};  // columns of a 2x3 affine map
};

struct Material {
  std::string name;
  vec4 base_color{1};
  vec3 emissive{0};  // factor times KHR_materials_emissive_strength
  float metallic = 1, roughness = 1;
  float normal_scale = 1, occlusion_strength = 1;
  AlphaMode alpha_mode = AlphaMode::opaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false;
  bool unlit = false;
  TextureRef base_color_texture, metallic_roughness_texture, normal_texture, emissive_texture,
      occlusion_texture;
};

enum class WrapMode : uint32_t { repeat, mirrored_repeat, clamp_to_edge };

// RGBA8, decoded. `srgb` = colour data (base colour, emissive).
struct Texture {
  std::string name;
  uint32_t width = 0, height = 0;
  std::vector<uint8_t> rgba;
  bool srgb = false;
  WrapMode wrap_u = WrapMode::repeat, wrap_v = WrapMode::repeat;
  bool nearest = false;  // magnification filter of the sampler
};

enum class LightType : uint32_t { directional, point, spot };

struct Light {
  LightType type = LightType::point;
  vec3 color{1};        // linear
  float intensity = 1;  // KHR_lights_punctual: candela (point, spot) or lux (directional)
  float range = 0;      // metres; 0 = unlimited
  float inner_cone_rad = 0, outer_cone_rad = 0.785398163f;
  uint32_t node = kNone;  // shines along the node's -Z from its origin
};

struct Node {
  std::string name;
  uint32_t parent = kNone;  // always an earlier node
  dvec3 translation{0};
  dquat rotation{1, 0, 0, 0};
  dvec3 scale{1};
  std::optional<dmat4> matrix;  // if set, instead of translation, rotation, scale
  bool moves = false;           // it or an ancestor is animated
};

struct Instance {
  uint32_t geometry, material, node;
  PatchId first_patch = 0;      // filled in by index_instances()
  uint32_t first_triangle = 0;  // likewise, over all instances
};

enum class AnimationPath : uint32_t { translation, rotation, scale };
enum class Interpolation : uint32_t { step, linear, cubic_spline };

struct AnimationChannel {
  uint32_t node;
  AnimationPath path;
  Interpolation interpolation;
  std::vector<double> times_s;  // strictly increasing
  std::vector<vec4>
      values;  // one a key (three with cubic_spline: in-tangent, value, out-tangent); rotation = xyzw
};

// What the scene contains, for the frame plan: a pass that nothing needs is left out.
struct Features {
  uint32_t directional_lights = 0, point_lights = 0, spot_lights = 0;
  bool alpha_mask = false, alpha_blend = false, double_sided = false, unlit = false;
  bool normal_maps = false, metallic_roughness_maps = false, emissive = false, occlusion_maps = false;
  bool vertex_colors = false, second_texcoord = false, rigid_animation = false, mirrored_instances = false;
  uint64_t unique_triangles = 0, instanced_triangles = 0, instanced_patches = 0;
  float largest_triangle_m2 = 0, most_slanted_triangle = 0;  // slantedness = longest edge / height
};

struct Scene {
  std::string name;
  std::vector<Geometry> geometries;
  std::vector<Instance> instances;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<Light> lights;
  std::vector<Node> nodes;
  std::vector<AnimationChannel> animations;
  double animation_length_s = 0;  // animations loop with this period; 0 = nothing moves
  Features features;

  uint32_t patch_count = 0;     // over all instances
  uint32_t triangle_count = 0;  // over all instances

  // Fills in Instance::first_patch, first_triangle, the counts above and `features`. Call once, after all
  // else is set.
  void index_instances();
  // The instance that owns a patch (binary search).
  uint32_t instance_of(PatchId patch) const;

  // World matrix of every node at `time_ns` (animations loop), double precision.
  std::vector<dmat4> node_transforms(TimeNs time_ns) const;
  // World bounds of all instances at `time_ns`.
  Aabb world_bounds(TimeNs time_ns) const;
};

// Block coordinates of corner `corner` (0..2) of triangle `triangle` in a patch of `count` triangles.
vec2 patch_corner(uint32_t count, uint32_t triangle, uint32_t corner);

}  // namespace tessera::scene
