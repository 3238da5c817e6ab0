#include "gpu/image.h"

#include <algorithm>
#include <bit>

#include "gpu/impl.h"

namespace tessera::gpu {
namespace {

using Usage = vk::ImageUsageFlagBits;

Status check(const ImageDesc& desc, const Core& core) {
  const uint32_t limit = core.limits.maxImageDimension2D;
  if (desc.width == 0 || desc.height == 0 || desc.width > limit || desc.height > limit || desc.layers == 0) {
    return absl::InvalidArgumentError(absl::StrCat("sizes must be 1 to ", limit, ", layers at least 1"));
  }
  if (desc.samples != 1 && desc.samples != 4) return absl::InvalidArgumentError("samples must be 1 or 4");
  if (desc.samples > 1 && (desc.mip_levels > 1 || desc.storage)) {
    return absl::InvalidArgumentError("a multisampled image has one mip level and is no storage image");
  }
  if (desc.storage && desc.format == Format::depth32_float) {
    return absl::InvalidArgumentError("a depth image is no storage image");
  }
  return absl::OkStatus();
}

uint32_t full_chain(const ImageDesc& desc) {
  return static_cast<uint32_t>(std::bit_width(std::max(desc.width, desc.height)));
}

// sRGB formats cannot be stored to: such an image is written through its linear twin.
bool has_linear_twin(const ImageDesc& desc) {
  return desc.storage && desc.format == Format::rgba8_srgb;
}

vk::ImageUsageFlags attachment_usage(const ImageDesc& desc) {
  return desc.format == Format::depth32_float ? Usage::eDepthStencilAttachment : Usage::eColorAttachment;
}

vk::ImageCreateInfo create_info(const ImageDesc& desc) {
  vk::ImageCreateInfo info;
  if (has_linear_twin(desc)) {
    info.flags = vk::ImageCreateFlagBits::eMutableFormat | vk::ImageCreateFlagBits::eExtendedUsage;
  }
  info.imageType = vk::ImageType::e2D;
  info.format = vulkan_format(desc.format);
  info.extent = vk::Extent3D(desc.width, desc.height, 1);
  info.mipLevels = desc.mip_levels;
  info.arrayLayers = desc.layers;
  info.samples = desc.samples == 4 ? vk::SampleCountFlagBits::e4 : vk::SampleCountFlagBits::e1;
  info.usage = attachment_usage(desc) | Usage::eSampled | Usage::eTransferSrc | Usage::eTransferDst;
  if (desc.storage) info.usage |= Usage::eStorage;
  return info;
}

struct ViewShape {
  vk::ImageUsageFlags usage;
  Format format;
  bool array;
  uint32_t first_mip, mips, layers;
};

vk::raii::ImageView create_view(const Image::Impl& impl, const ViewShape& shape) {
  const vk::ImageViewUsageCreateInfo usage(shape.usage);
  vk::ImageViewCreateInfo info;
  info.pNext = &usage;
  info.image = *impl.image;
  info.viewType = shape.array ? vk::ImageViewType::e2DArray : vk::ImageViewType::e2D;
  info.format = vulkan_format(shape.format);
  info.subresourceRange = {impl.aspect, shape.first_mip, shape.mips, 0, shape.layers};
  return impl.core->device.createImageView(info);
}

void create_views(Image::Impl& impl, const ImageDesc& desc) {
  const bool array = desc.layers > 1;
  impl.attachment = create_view(impl, {attachment_usage(desc), desc.format, false, 0, 1, 1});
  impl.sampled = create_view(
      impl, {Usage::eSampled, desc.format, array || desc.array_view, 0, desc.mip_levels, desc.layers});
  if (!desc.storage) return;
  const Format format = has_linear_twin(desc) ? Format::rgba8_unorm : desc.format;
  for (uint32_t mip = 0; mip < desc.mip_levels; ++mip) {
    impl.storage.push_back(create_view(impl, {Usage::eStorage, format, array, mip, 1, desc.layers}));
  }
}

vk::SamplerAddressMode address_mode(Wrap wrap) {
  switch (wrap) {
    case Wrap::repeat:
      return vk::SamplerAddressMode::eRepeat;
    case Wrap::mirrored_repeat:
      return vk::SamplerAddressMode::eMirroredRepeat;
    case Wrap::clamp_to_edge:
      break;
  }
  return vk::SamplerAddressMode::eClampToEdge;
}

}  // namespace

vk::Format vulkan_format(Format format) {
  switch (format) {
    case Format::rgba8_unorm:
      return vk::Format::eR8G8B8A8Unorm;
    case Format::rgba8_srgb:
      return vk::Format::eR8G8B8A8Srgb;
    case Format::rgba16_float:
      return vk::Format::eR16G16B16A16Sfloat;
    case Format::rgba32_float:
      return vk::Format::eR32G32B32A32Sfloat;
    case Format::r32_uint:
      return vk::Format::eR32Uint;
    case Format::r32_float:
      return vk::Format::eR32Sfloat;
    case Format::r8_unorm:
      return vk::Format::eR8Unorm;
    case Format::rg32_uint:
      return vk::Format::eR32G32Uint;
    case Format::depth32_float:
      return vk::Format::eD32Sfloat;
  }
  return vk::Format::eUndefined;
}

StatusOr<Image> Image::create(Device& device, const ImageDesc& desc, std::string_view name) {
  auto created = guarded([&]() -> StatusOr<Image> {
    Image image;
    image.impl_ = std::make_unique<Impl>();
    Impl& impl = *image.impl_;
    impl.core = device.impl().core();
    impl.name = name;
    TESSERA_RETURN_IF_ERROR(check(desc, *impl.core));
    image.desc_ = desc;
    image.desc_.mip_levels =
        desc.mip_levels == 0 ? full_chain(desc) : std::min(desc.mip_levels, full_chain(desc));
    impl.aspect = desc.format == Format::depth32_float ? vk::ImageAspectFlagBits::eDepth
                                                       : vk::ImageAspectFlagBits::eColor;
    impl.image = impl.core->device.createImage(create_info(image.desc_));
    impl.memory = impl.core->allocator->allocate(impl.image.getMemoryRequirements(), Memory::device);
    impl.image.bindMemory(impl.memory.memory(), impl.memory.offset());
    impl.core->set_name(*impl.image, name);
    create_views(impl, image.desc_);
    impl.core->new_images.push_back({*impl.image, impl.aspect});
    return image;
  });
  if (created.ok()) return created;
  return with_context(created.status(),
                      absl::StrCat("image `", std::string(name), "` of ", desc.width, "x", desc.height));
}

Image::Impl::~Impl() {
  if (core) std::erase_if(core->new_images, [&](const Core::NewImage& i) { return i.image == *image; });
}

Image::Image() = default;
Image::Image(Image&&) noexcept = default;
Image& Image::operator=(Image&&) noexcept = default;
Image::~Image() = default;

StatusOr<Sampler> Sampler::create(Device& device, const SamplerDesc& desc) {
  return guarded([&]() -> StatusOr<Sampler> {
    vk::SamplerCreateInfo info;
    info.magFilter = info.minFilter =
        desc.filter == Filter::linear ? vk::Filter::eLinear : vk::Filter::eNearest;
    info.mipmapMode =
        desc.mip == Filter::linear ? vk::SamplerMipmapMode::eLinear : vk::SamplerMipmapMode::eNearest;
    info.addressModeU = address_mode(desc.wrap_u);
    info.addressModeV = address_mode(desc.wrap_v);
    info.addressModeW = vk::SamplerAddressMode::eClampToEdge;
    info.maxLod = VK_LOD_CLAMP_NONE;
    info.compareEnable = desc.compare_greater;
    info.compareOp = vk::CompareOp::eGreaterOrEqual;
    Sampler sampler;
    sampler.impl_ = std::make_unique<Impl>();
    sampler.impl_->core = device.impl().core();
    sampler.impl_->sampler = sampler.impl_->core->device.createSampler(info);
    return sampler;
  });
}

Sampler::Sampler() = default;
Sampler::Sampler(Sampler&&) noexcept = default;
Sampler& Sampler::operator=(Sampler&&) noexcept = default;
Sampler::~Sampler() = default;

}  // namespace tessera::gpu
