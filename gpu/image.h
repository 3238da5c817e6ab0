// 2D images and samplers. Images live in VK_IMAGE_LAYOUT_GENERAL from creation to destruction, so no pass
// tracks layouts.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "base/status.h"
#include "gpu/device.h"

namespace tessera::gpu {

enum class Format {
  rgba8_unorm,
  rgba8_srgb,
  rgba16_float,
  rgba32_float,
  r32_uint,
  r32_float,
  r8_unorm,
  rg32_uint,
  depth32_float
};

struct ImageDesc {
  uint32_t width = 1, height = 1;
  Format format = Format::rgba8_unorm;
  uint32_t layers = 1;
  uint32_t mip_levels = 1;  // 0 = full chain
  uint32_t samples = 1;     // 1 or 4
  bool storage = false;     // bindable as storage image (rgba8_srgb binds through an rgba8_unorm view)
  bool array_view = false;  // sampled as sampler2DArray even with one layer
};

// Usable as attachment, sampled image and copy source/destination; as storage image if `storage`. Colour
// contents start undefined, depth undefined. Move-only.
class Image {
 public:
  static StatusOr<Image> create(Device& device, const ImageDesc& desc, std::string_view name);
  Image();
  Image(Image&&) noexcept;
  Image& operator=(Image&&) noexcept;
  ~Image();

  const ImageDesc& desc() const { return desc_; }
  uint32_t width() const { return desc_.width; }
  uint32_t height() const { return desc_.height; }
  uint32_t mip_levels() const { return desc_.mip_levels; }

  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
  ImageDesc desc_;
};

enum class Wrap { repeat, mirrored_repeat, clamp_to_edge };
enum class Filter { nearest, linear };

struct SamplerDesc {
  Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
  Filter filter = Filter::linear;  // min and mag
  Filter mip = Filter::linear;
  bool compare_greater = false;  // shadow comparison, GREATER_OR_EQUAL (reversed depth)
  bool operator==(const SamplerDesc&) const = default;
};

class Sampler {
 public:
  static StatusOr<Sampler> create(Device& device, const SamplerDesc& desc);
  Sampler();
  Sampler(Sampler&&) noexcept;
  Sampler& operator=(Sampler&&) noexcept;
  ~Sampler();

  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::gpu
