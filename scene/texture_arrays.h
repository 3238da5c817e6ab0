// Puts a scene's textures into few 2D texture arrays: one array holds one size, encoding and sampler, so that
// the number of textures is not limited by the device's bindings.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "gpu/image.h"
#include "scene/scene.h"

namespace tessera::scene {

// Vulkan guarantees 16 sampled images a stage. 2048 layers is what every current device has.
constexpr uint32_t kMaxTextureArrays = 16;
constexpr uint32_t kMaxTextureLayers = 2048;

struct TextureArrayKind {
  bool srgb = false;
  WrapMode wrap_u = WrapMode::repeat, wrap_v = WrapMode::repeat;
  bool nearest = false;
  bool operator==(const TextureArrayKind&) const = default;
};

struct TextureArrayPlan {
  uint32_t width = 1, height = 1;
  TextureArrayKind kind;
  std::vector<uint32_t>
      textures;  // layer i holds Scene::textures[textures[i]], resampled where its size differs
};

// At most `max_arrays` (>= 2) arrays that hold every texture once. Where sizes and kinds are more, the
// smallest arrays go to the nearest size of their own kind, and if none is left, of their own encoding.
std::vector<TextureArrayPlan> plan_texture_arrays(std::span<const Texture> textures, uint32_t max_arrays);

struct TextureSlot {
  uint32_t array, layer;
};

struct TextureArrays {
  std::vector<gpu::Image> images;  // never empty: a scene without textures has one white texel
  std::vector<gpu::Sampler> samplers;
  std::vector<TextureSlot> slots;  // by texture
};

// Uploads all textures with full mip chains; one layer at a time passes through staging memory.
StatusOr<TextureArrays> upload_textures(gpu::Device& device, std::span<const Texture> textures);

}  // namespace tessera::scene
