#include "codec/yuv_converter.h"

#include <array>

#include "codec/shaders/rgb_to_yuv.comp.spv.h"
#include "gpu/buffer.h"
#include "gpu/pipeline.h"

namespace tessera::codec {
namespace {

struct Push {
  uint32_t width, height;
};

// Texels of one work group of rgb_to_yuv.comp.
constexpr uint32_t kGroupWidth = 64, kGroupHeight = 16;

constexpr uint32_t divided_up(uint32_t a, uint32_t b) {
  return (a + b - 1) / b;
}

}  // namespace

struct YuvConverter::Impl {
  uint32_t width = 0, height = 0;
  gpu::Buffer planes;
  gpu::BindLayout layout;
  gpu::BindGroup group;
  gpu::ComputePipeline pipeline;
  const gpu::Image::Impl* bound = nullptr;
};

YuvConverter::YuvConverter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
YuvConverter::~YuvConverter() = default;

StatusOr<std::unique_ptr<YuvConverter>> YuvConverter::create(gpu::Device& device, uint32_t width,
                                                             uint32_t height) {
  if (width == 0 || height == 0 || width % 8 != 0 || height % 2 != 0)
    return absl::InvalidArgumentError(absl::StrFormat(
        "colour conversion of %ux%u: the width must be a multiple of 8, the height even", width, height));
  auto impl = std::make_unique<Impl>();
  impl->width = width;
  impl->height = height;
  TESSERA_ASSIGN_OR_RETURN(impl->planes, gpu::Buffer::create(device, uint64_t{width} * height * 3 / 2,
                                                             gpu::Memory::readback, "yuv planes"));
  const std::array<gpu::Binding, 2> bindings = {
      {{0, gpu::BindingKind::storage_image}, {1, gpu::BindingKind::storage_buffer}}};
  TESSERA_ASSIGN_OR_RETURN(impl->layout, gpu::BindLayout::create(device, bindings));
  TESSERA_ASSIGN_OR_RETURN(impl->group, gpu::BindGroup::create(device, impl->layout));
  impl->group.set(1, impl->planes);
  TESSERA_ASSIGN_OR_RETURN(impl->pipeline,
                           gpu::ComputePipeline::create(device, {.name = "rgb_to_yuv",
                                                                 .shader = rgb_to_yuv_comp,
                                                                 .layouts = {&impl->layout},
                                                                 .push_bytes = sizeof(Push)}));
  return std::unique_ptr<YuvConverter>(new YuvConverter(std::move(impl)));
}

Status YuvConverter::record(gpu::Commands& commands, const gpu::Image& image) {
  Impl& c = *impl_;
  if (image.width() != c.width || image.height() != c.height)
    return absl::InvalidArgumentError(absl::StrFormat("colour conversion: the image is %ux%u, expected %ux%u",
                                                      image.width(), image.height(), c.width, c.height));
  const gpu::Format format = image.desc().format;
  if (!image.desc().storage || (format != gpu::Format::rgba8_srgb && format != gpu::Format::rgba8_unorm))
    return absl::InvalidArgumentError(
        "colour conversion: the image must be RGBA8 and bindable as storage image");
  if (c.bound != &image.impl()) {
    c.group.set(0, image);
    c.bound = &image.impl();
  }
  commands.barrier();
  commands.bind(c.pipeline, {&c.group});
  commands.push(Push{c.width, c.height});
  commands.dispatch(divided_up(c.width, kGroupWidth), divided_up(c.height, kGroupHeight));
  commands.barrier();
  return absl::OkStatus();
}

YuvView YuvConverter::result() const {
  const Impl& c = *impl_;
  const auto* y = reinterpret_cast<const uint8_t*>(c.planes.mapped());
  const size_t luma = size_t{c.width} * c.height;
  return {c.width, c.height, y, y + luma, y + luma + luma / 4, c.width, c.width / 2};
}

}  // namespace tessera::codec
