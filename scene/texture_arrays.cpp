#include "scene/texture_arrays.h"

#include <stb_image_resize.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/log.h"
#include "gpu/buffer.h"
#include "gpu/commands.h"

namespace tessera::scene {
namespace {

uint64_t texels(const TextureArrayPlan& array) {
  return uint64_t{array.width} * array.height * array.textures.size();
}

double size_distance(const TextureArrayPlan& a, const TextureArrayPlan& b) {
  return std::abs(std::log2(double(a.width) / b.width)) + std::abs(std::log2(double(a.height) / b.height));
}

// The array that takes `from`'s textures in: the nearest size among those that `accepts` admits, or the end.
template <class Accepts>
std::vector<TextureArrayPlan>::iterator nearest_array(std::vector<TextureArrayPlan>& arrays,
                                                      const TextureArrayPlan& from, Accepts accepts) {
  auto best = arrays.end();
  double best_distance = std::numeric_limits<double>::infinity();
  for (auto it = arrays.begin(); it != arrays.end(); ++it) {
    if (&*it == &from || !accepts(*it)) continue;
    if (const double distance = size_distance(*it, from); distance < best_distance) {
      best = it;
      best_distance = distance;
    }
  }
  return best;
}

// Merges the smallest array that has a partner; false if none has one.
template <class Fits>
bool merge_smallest(std::vector<TextureArrayPlan>& arrays, Fits fits) {
  std::vector<size_t> order(arrays.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return texels(arrays[a]) < texels(arrays[b]); });
  for (const size_t i : order) {
    const TextureArrayPlan& from = arrays[i];
    const auto into = nearest_array(arrays, from, [&](const TextureArrayPlan& to) { return fits(from, to); });
    if (into == arrays.end()) continue;
    spdlog::info("scene: {} textures of {}x{} are resampled to {}x{}: more sizes than texture arrays",
                 from.textures.size(), from.width, from.height, into->width, into->height);
    into->textures.insert(into->textures.end(), from.textures.begin(), from.textures.end());
    arrays.erase(arrays.begin() + static_cast<ptrdiff_t>(i));
    return true;
  }
  return false;
}

gpu::Wrap to_wrap(WrapMode mode) {
  switch (mode) {
    case WrapMode::mirrored_repeat:
      return gpu::Wrap::mirrored_repeat;
    case WrapMode::clamp_to_edge:
      return gpu::Wrap::clamp_to_edge;
    case WrapMode::repeat:
      break;
  }
  return gpu::Wrap::repeat;
}

stbir_edge to_edge(WrapMode mode) {
  switch (mode) {
    case WrapMode::mirrored_repeat:
      return STBIR_EDGE_REFLECT;
    case WrapMode::clamp_to_edge:
      return STBIR_EDGE_CLAMP;
    case WrapMode::repeat:
      break;
  }
  return STBIR_EDGE_WRAP;
}

Status write_layer(const Texture& texture, const TextureArrayPlan& array, std::byte* out) {
  if (texture.width == array.width && texture.height == array.height) {
    std::memcpy(out, texture.rgba.data(), texture.rgba.size());
    return absl::OkStatus();
  }
  // The flag makes the four channels independent: in data textures alpha means nothing.
  const int done = stbir_resize(
      texture.rgba.data(), static_cast<int>(texture.width), static_cast<int>(texture.height), 0, out,
      static_cast<int>(array.width), static_cast<int>(array.height), 0, STBIR_TYPE_UINT8, 4, 3,
      STBIR_FLAG_ALPHA_PREMULTIPLIED, to_edge(texture.wrap_u), to_edge(texture.wrap_v), STBIR_FILTER_DEFAULT,
      STBIR_FILTER_DEFAULT, texture.srgb ? STBIR_COLORSPACE_SRGB : STBIR_COLORSPACE_LINEAR, nullptr);
  if (!done)
    return absl::ResourceExhaustedError(
        absl::StrCat("texture `", texture.name, "`: no memory to resample it"));
  return absl::OkStatus();
}

StatusOr<gpu::Image> upload_array(gpu::Device& device, std::span<const Texture> textures,
                                  const TextureArrayPlan& array, size_t number) {
  const gpu::ImageDesc desc{.width = array.width,
                            .height = array.height,
                            .format = array.kind.srgb ? gpu::Format::rgba8_srgb : gpu::Format::rgba8_unorm,
                            .layers = static_cast<uint32_t>(array.textures.size()),
                            .mip_levels = 0,
                            .array_view = true};
  TESSERA_ASSIGN_OR_RETURN(gpu::Image image,
                           gpu::Image::create(device, desc, absl::StrCat("scene textures ", number)));
  const uint64_t layer_bytes = uint64_t{4} * array.width * array.height;
  TESSERA_ASSIGN_OR_RETURN(gpu::Buffer staging, gpu::Buffer::create(device, layer_bytes, gpu::Memory::upload,
                                                                    "scene texture staging"));
  for (uint32_t layer = 0; layer < desc.layers; ++layer) {
    TESSERA_RETURN_IF_ERROR(write_layer(textures[array.textures[layer]], array, staging.mapped()));
    gpu::Commands commands = device.begin();
    commands.copy_to_image(staging, 0, image, 0, layer);
    commands.barrier();
    if (layer + 1 == desc.layers) {
      commands.generate_mips(image);
      commands.barrier();
    }
    TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  }
  return image;
}

Status check(std::span<const Texture> textures) {
  for (size_t i = 0; i < textures.size(); ++i) {
    const Texture& t = textures[i];
    if (t.width == 0 || t.height == 0 || t.rgba.size() != size_t{4} * t.width * t.height) {
      return absl::InvalidArgumentError(
          absl::StrFormat("texture %d `%s`: %d bytes do not make %dx%d RGBA pixels", i, t.name, t.rgba.size(),
                          t.width, t.height));
    }
  }
  return absl::OkStatus();
}

}  // namespace

std::vector<TextureArrayPlan> plan_texture_arrays(std::span<const Texture> textures, uint32_t max_arrays) {
  std::vector<TextureArrayPlan> arrays;
  for (uint32_t i = 0; i < textures.size(); ++i) {
    const Texture& t = textures[i];
    const TextureArrayKind kind{t.srgb, t.wrap_u, t.wrap_v, t.nearest};
    auto it = std::find_if(arrays.begin(), arrays.end(), [&](const TextureArrayPlan& a) {
      return a.width == t.width && a.height == t.height && a.kind == kind;
    });
    if (it == arrays.end())
      it = arrays.insert(it, {.width = t.width, .height = t.height, .kind = kind, .textures = {}});
    it->textures.push_back(i);
  }
  while (arrays.size() > max_arrays) {
    const auto same_kind = [](const TextureArrayPlan& a, const TextureArrayPlan& b) {
      return a.kind == b.kind;
    };
    const auto same_encoding = [](const TextureArrayPlan& a, const TextureArrayPlan& b) {
      return a.kind.srgb == b.kind.srgb;
    };
    if (!merge_smallest(arrays, same_kind) && !merge_smallest(arrays, same_encoding)) break;
  }
  return arrays;
}

StatusOr<TextureArrays> upload_textures(gpu::Device& device, std::span<const Texture> textures) {
  TESSERA_RETURN_IF_ERROR(check(textures));
  static const Texture kWhite{.name = "none", .width = 1, .height = 1, .rgba = {255, 255, 255, 255}};
  // Old lavapipe crashes on a set with an unwritten texture, so there always is one.
  const std::span<const Texture> all = textures.empty() ? std::span(&kWhite, 1) : textures;

  TextureArrays out;
  out.slots.resize(all.size());
  const std::vector<TextureArrayPlan> plan = plan_texture_arrays(all, kMaxTextureArrays);
  for (uint32_t a = 0; a < plan.size(); ++a) {
    const TextureArrayPlan& array = plan[a];
    if (array.textures.size() > kMaxTextureLayers) {
      return absl::ResourceExhaustedError(
          absl::StrFormat("scene: %d textures of %dx%d, the limit is %d: join small textures",
                          array.textures.size(), array.width, array.height, kMaxTextureLayers));
    }
    for (uint32_t layer = 0; layer < array.textures.size(); ++layer)
      out.slots[array.textures[layer]] = {a, layer};
    TESSERA_ASSIGN_OR_RETURN(gpu::Image image, upload_array(device, all, array, a));
    out.images.push_back(std::move(image));
    const gpu::Filter filter = array.kind.nearest ? gpu::Filter::nearest : gpu::Filter::linear;
    TESSERA_ASSIGN_OR_RETURN(gpu::Sampler sampler,
                             gpu::Sampler::create(device, {.wrap_u = to_wrap(array.kind.wrap_u),
                                                           .wrap_v = to_wrap(array.kind.wrap_v),
                                                           .filter = filter,
                                                           .mip = gpu::Filter::linear}));
    out.samplers.push_back(std::move(sampler));
  }
  return out;
}

}  // namespace tessera::scene
