#include "gpu/commands.h"

#include "gpu/impl.h"

namespace tessera::gpu {
namespace {

uint32_t bytes_per_texel(Format format) {
  switch (format) {
    case Format::r8_unorm:
      return 1;
    case Format::rgba8_unorm:
    case Format::rgba8_srgb:
    case Format::r32_uint:
    case Format::r32_float:
    case Format::depth32_float:
      return 4;
    case Format::rgba16_float:
    case Format::rg32_uint:
      return 8;
    case Format::rgba32_float:
      break;
  }
  return 16;
}

bool is_integer(Format format) {
  return format == Format::r32_uint || format == Format::rg32_uint;
}

uint32_t mip_size(uint32_t size, uint32_t mip) {
  return std::max(1u, size >> mip);
}

Status check_range(const Buffer& buffer, uint64_t offset, uint64_t bytes, const char* call) {
  if (offset <= buffer.size() && bytes <= buffer.size() - offset) return absl::OkStatus();
  return absl::OutOfRangeError(
      absl::StrCat(call, ": ", bytes, " bytes at ", offset, " do not fit in buffer `",
                   buffer.size() == 0 ? "(empty)" : buffer.impl().name, "` of ", buffer.size(), " bytes"));
}

// The copied region of one mip level of one layer, or why there is none.
StatusOr<vk::BufferImageCopy> copy_region(const Image& image, uint32_t mip, uint32_t layer,
                                          const Buffer& buffer, uint64_t offset, const char* call) {
  const ImageDesc& desc = image.desc();
  if (mip >= desc.mip_levels || layer >= desc.layers || desc.samples != 1) {
    return absl::OutOfRangeError(absl::StrCat(call, ": image `", image.impl().name, "` has ", desc.mip_levels,
                                              " mip levels, ", desc.layers, " layers, ", desc.samples,
                                              " samples; asked for mip ", mip, " of layer ", layer));
  }
  const uint32_t width = mip_size(desc.width, mip), height = mip_size(desc.height, mip);
  const uint64_t bytes = uint64_t{width} * height * bytes_per_texel(desc.format);
  TESSERA_RETURN_IF_ERROR(check_range(buffer, offset, bytes, call));
  return vk::BufferImageCopy(offset, 0, 0, {image.impl().aspect, mip, layer, 1}, {}, {width, height, 1});
}

vk::CullModeFlags cull_mode(Cull cull) {
  switch (cull) {
    case Cull::none:
      return vk::CullModeFlagBits::eNone;
    case Cull::back:
      return vk::CullModeFlagBits::eBack;
    case Cull::front:
      break;
  }
  return vk::CullModeFlagBits::eFront;
}

vk::RenderingAttachmentInfo color_attachment(const ColorAttachment& color) {
  vk::RenderingAttachmentInfo info;
  info.imageView = *color.image->impl().attachment;
  info.imageLayout = vk::ImageLayout::eGeneral;
  const bool clears = color.clear_uint || color.clear;
  info.loadOp = clears ? vk::AttachmentLoadOp::eClear : vk::AttachmentLoadOp::eLoad;
  if (color.clear_uint) info.clearValue.color.setUint32(*color.clear_uint);
  if (color.clear) info.clearValue.color.setFloat32(*color.clear);
  if (color.resolve != nullptr) {
    info.resolveMode = is_integer(color.image->desc().format) ? vk::ResolveModeFlagBits::eSampleZero
                                                              : vk::ResolveModeFlagBits::eAverage;
    info.resolveImageView = *color.resolve->impl().attachment;
    info.resolveImageLayout = vk::ImageLayout::eGeneral;
  }
  return info;
}

vk::RenderingAttachmentInfo depth_attachment(const Image& depth, bool clears) {
  vk::RenderingAttachmentInfo info;
  info.imageView = *depth.impl().attachment;
  info.imageLayout = vk::ImageLayout::eGeneral;
  info.loadOp = clears ? vk::AttachmentLoadOp::eClear : vk::AttachmentLoadOp::eLoad;
  info.clearValue.depthStencil = vk::ClearDepthStencilValue(0, 0);
  return info;
}

// Binds the pipeline and its groups, whichever kind it is.
void bind_all(Commands::Impl& impl, const PipelineObjects& pipeline, vk::PipelineBindPoint point,
              std::initializer_list<const BindGroup*> groups) {
  if (groups.size() != pipeline.sets) {
    impl.fail(
        absl::InvalidArgumentError(absl::StrCat("bind: pipeline `", pipeline.name, "` has ", pipeline.sets,
                                                " descriptor sets, ", groups.size(), " groups were given")));
  }
  std::vector<vk::DescriptorSet> sets;
  for (const BindGroup* group : groups) {
    if (const Status usable = group->impl().usable(); !usable.ok()) {
      impl.fail(
          with_context(usable, absl::StrCat("bind: pipeline `", pipeline.name, "`, set ", sets.size())));
    }
    sets.push_back(group->impl().set);
  }
  if (!impl.ok()) return;
  impl.pipeline = &pipeline;
  impl.bind_point = point;
  impl.cmd().bindPipeline(point, *pipeline.pipeline);
  if (!sets.empty()) impl.cmd().bindDescriptorSets(point, *pipeline.layout, 0, sets, {});
}

void write_timestamp(Commands::Impl& impl, uint32_t query) {
  impl.cmd().writeTimestamp2(vk::PipelineStageFlagBits2::eAllCommands, *impl.recorder->queries, query);
  // lavapipe queues a timestamp that follows a rendering without attachments, and dispatches overtake it.
  if (impl.core->info.software && !impl.rendering) full_barrier(impl.cmd());
}

// A dispatch or draw without its pipeline would crash the driver.
bool ready(Commands::Impl& impl, vk::PipelineBindPoint point, const char* call) {
  const bool raster = point == vk::PipelineBindPoint::eGraphics;
  if (impl.pipeline == nullptr || impl.bind_point != point || impl.rendering != raster) {
    impl.fail(absl::FailedPreconditionError(
        absl::StrCat(call, ": bind a ", raster ? "raster or tessellation" : "compute", " pipeline first, ",
                     raster ? "inside" : "outside", " begin_rendering and end_rendering")));
  }
  return impl.ok();
}

bool ready_to_draw(Commands::Impl& impl, const char* call) {
  return ready(impl, vk::PipelineBindPoint::eGraphics, call);
}

bool ready_to_dispatch(Commands::Impl& impl, const char* call) {
  return ready(impl, vk::PipelineBindPoint::eCompute, call);
}

}  // namespace

Commands::Commands(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Commands::Commands(Commands&&) noexcept = default;
Commands& Commands::operator=(Commands&&) noexcept = default;
Commands::~Commands() = default;

void Commands::begin_interval(std::string_view name) {
  if (!impl_->ok()) return;
  auto& names = impl_->recorder->intervals;
  if (impl_->in_interval || names.size() == kMaxIntervals) {
    return impl_->fail(absl::FailedPreconditionError(
        absl::StrCat("begin_interval `", std::string(name),
                     "`: intervals do not nest, and a submission has at most ", kMaxIntervals)));
  }
  impl_->in_interval = true;
  names.emplace_back(name);
  const auto query = static_cast<uint32_t>(2 * (names.size() - 1));
  write_timestamp(*impl_, query);
}

void Commands::end_interval() {
  if (!impl_->ok()) return;
  if (!impl_->in_interval) return impl_->fail(absl::FailedPreconditionError("end_interval: none was begun"));
  impl_->in_interval = false;
  const auto query = static_cast<uint32_t>(2 * impl_->recorder->intervals.size() - 1);
  write_timestamp(*impl_, query);
}

void Commands::barrier() {
  if (!impl_->ok()) return;
  if (impl_->rendering) {
    return impl_->fail(absl::FailedPreconditionError("barrier: not between begin_ and end_rendering"));
  }
  full_barrier(impl_->cmd());
}

void Commands::bind(const ComputePipeline& pipeline, std::initializer_list<const BindGroup*> groups) {
  if (impl_->ok()) bind_all(*impl_, pipeline.impl(), vk::PipelineBindPoint::eCompute, groups);
}

void Commands::dispatch(uint32_t x, uint32_t y, uint32_t z) {
  if (!ready_to_dispatch(*impl_, "dispatch")) return;
  ++impl_->core->dispatches;
  impl_->cmd().dispatch(x, y, z);
}

void Commands::begin_rendering(const RenderTarget& target) {
  if (!impl_->ok()) return;
  if (impl_->rendering) return impl_->fail(absl::FailedPreconditionError("begin_rendering: already begun"));
  impl_->rendering = true;
  std::vector<vk::RenderingAttachmentInfo> colors;
  for (const ColorAttachment& color : target.colors) colors.push_back(color_attachment(color));
  vk::RenderingAttachmentInfo depth;
  vk::RenderingInfo info;
  info.renderArea.extent = vk::Extent2D(target.width, target.height);
  info.layerCount = 1;
  info.setColorAttachments(colors);
  if (target.depth != nullptr) {
    depth = depth_attachment(*target.depth, target.clear_depth);
    info.pDepthAttachment = &depth;
  }
  impl_->cmd().beginRendering(info);
  set_viewport(0, 0, target.width, target.height);
}

void Commands::end_rendering() {
  if (!impl_->ok()) return;
  if (!impl_->rendering) return impl_->fail(absl::FailedPreconditionError("end_rendering: none was begun"));
  impl_->rendering = false;
  impl_->cmd().endRendering();
}

void Commands::bind(const RasterPipeline& pipeline, std::initializer_list<const BindGroup*> groups) {
  if (!impl_->ok()) return;
  bind_all(*impl_, pipeline.impl(), vk::PipelineBindPoint::eGraphics, groups);
  set_cull(pipeline.impl().cull);
}

void Commands::bind(const TessellationPipeline& pipeline, std::initializer_list<const BindGroup*> groups) {
  if (impl_->ok()) bind_all(*impl_, pipeline.impl(), vk::PipelineBindPoint::eGraphics, groups);
}

void Commands::set_cull(Cull cull) {
  if (impl_->ok()) impl_->cmd().setCullMode(cull_mode(cull));
}

void Commands::set_viewport(uint32_t x, uint32_t y, uint32_t width, uint32_t height) {
  if (!impl_->ok()) return;
  const auto left = static_cast<float>(x), bottom = static_cast<float>(y + height);
  const vk::Viewport flipped(left, bottom, static_cast<float>(width), -static_cast<float>(height), 0, 1);
  impl_->cmd().setViewport(0, flipped);
  impl_->cmd().setScissor(0, vk::Rect2D({static_cast<int32_t>(x), static_cast<int32_t>(y)}, {width, height}));
}

void Commands::bind_indices(const Buffer& buffer) {
  if (impl_->ok()) impl_->cmd().bindIndexBuffer(*buffer.impl().buffer, 0, vk::IndexType::eUint32);
}

void Commands::draw(uint32_t vertices, uint32_t instances, uint32_t first_vertex, uint32_t first_instance) {
  if (!ready_to_draw(*impl_, "draw")) return;
  ++impl_->core->draws;
  impl_->cmd().draw(vertices, instances, first_vertex, first_instance);
}

void Commands::draw_indexed(uint32_t indices, uint32_t instances, uint32_t first_index, int32_t vertex_offset,
                            uint32_t first_instance) {
  if (!ready_to_draw(*impl_, "draw_indexed")) return;
  ++impl_->core->draws;
  impl_->cmd().drawIndexed(indices, instances, first_index, vertex_offset, first_instance);
}

void Commands::draw_indexed_indirect_count(const Buffer& buffer, uint64_t offset, const Buffer& count,
                                           uint64_t count_offset, uint32_t max_draws) {
  constexpr uint32_t kStride = sizeof(VkDrawIndexedIndirectCommand);
  constexpr const char* kCall = "draw_indexed_indirect_count";
  impl_->fail(check_range(buffer, offset, uint64_t{kStride} * max_draws, kCall));
  impl_->fail(check_range(count, count_offset, sizeof(uint32_t), kCall));
  if (!ready_to_draw(*impl_, kCall)) return;
  ++impl_->core->draws;
  impl_->cmd().drawIndexedIndirectCount(*buffer.impl().buffer, offset, *count.impl().buffer, count_offset,
                                        max_draws, kStride);
}

void Commands::push_bytes(std::span<const std::byte> bytes) {
  if (!impl_->ok()) return;
  const PipelineObjects* pipeline = impl_->pipeline;
  if (pipeline == nullptr || bytes.size() > pipeline->push_bytes || bytes.size() % 4 != 0) {
    return impl_->fail(absl::InvalidArgumentError(absl::StrCat(
        "push: ", bytes.size(), " bytes, but pipeline `", pipeline == nullptr ? "(none)" : pipeline->name,
        "` takes ", pipeline == nullptr ? 0 : pipeline->push_bytes, ", in whole words")));
  }
  impl_->cmd().pushConstants<std::byte>(*pipeline->layout, vk::ShaderStageFlagBits::eAll, 0,
                                        {static_cast<uint32_t>(bytes.size()), bytes.data()});
}

void Commands::copy(const Buffer& from, uint64_t from_offset, const Buffer& to, uint64_t to_offset,
                    uint64_t bytes) {
  impl_->fail(check_range(from, from_offset, bytes, "copy from"));
  impl_->fail(check_range(to, to_offset, bytes, "copy to"));
  if (!impl_->ok() || bytes == 0) return;
  impl_->cmd().copyBuffer(*from.impl().buffer, *to.impl().buffer,
                          vk::BufferCopy(from_offset, to_offset, bytes));
}

void Commands::fill(const Buffer& buffer, uint32_t word, uint64_t offset, uint64_t bytes) {
  const bool rest = bytes == ~0ull;
  impl_->fail(check_range(buffer, offset, rest ? 0 : bytes, "fill"));
  if (offset % 4 != 0 || (!rest && bytes % 4 != 0)) {
    impl_->fail(absl::InvalidArgumentError("fill: offset and size must be multiples of 4"));
  }
  if (!impl_->ok() || bytes == 0 || offset == buffer.size()) return;
  impl_->cmd().fillBuffer(*buffer.impl().buffer, offset, rest ? VK_WHOLE_SIZE : bytes, word);
}

void Commands::clear(const Image& image, std::array<float, 4> color) {
  if (!impl_->ok()) return;
  const Image::Impl& target = image.impl();
  const vk::ImageSubresourceRange all(target.aspect, 0, VK_REMAINING_MIP_LEVELS, 0,
                                      VK_REMAINING_ARRAY_LAYERS);
  if (image.desc().format == Format::depth32_float) {
    const vk::ClearDepthStencilValue value(color[0], 0);
    return impl_->cmd().clearDepthStencilImage(*target.image, vk::ImageLayout::eGeneral, value, all);
  }
  vk::ClearColorValue value(color);
  if (is_integer(image.desc().format)) {
    value.setUint32({static_cast<uint32_t>(color[0]), static_cast<uint32_t>(color[1]),
                     static_cast<uint32_t>(color[2]), static_cast<uint32_t>(color[3])});
  }
  impl_->cmd().clearColorImage(*target.image, vk::ImageLayout::eGeneral, value, all);
}

void Commands::copy_to_image(const Buffer& from, uint64_t offset, const Image& to, uint32_t mip,
                             uint32_t layer) {
  const auto region = copy_region(to, mip, layer, from, offset, "copy_to_image");
  impl_->fail(region.status());
  if (!impl_->ok()) return;
  impl_->cmd().copyBufferToImage(*from.impl().buffer, *to.impl().image, vk::ImageLayout::eGeneral, *region);
}

void Commands::copy_to_buffer(const Image& from, const Buffer& to, uint64_t offset, uint32_t mip,
                              uint32_t layer) {
  const auto region = copy_region(from, mip, layer, to, offset, "copy_to_buffer");
  impl_->fail(region.status());
  if (!impl_->ok()) return;
  impl_->cmd().copyImageToBuffer(*from.impl().image, vk::ImageLayout::eGeneral, *to.impl().buffer, *region);
}

void Commands::generate_mips(const Image& image) {
  const ImageDesc& desc = image.desc();
  if (is_integer(desc.format) || desc.format == Format::depth32_float || desc.samples != 1) {
    impl_->fail(absl::InvalidArgumentError(
        absl::StrCat("generate_mips: image `", image.impl().name, "` is not of a filterable format")));
  }
  if (!impl_->ok()) return;
  constexpr auto kLayout = vk::ImageLayout::eGeneral;
  const vk::Image handle = *image.impl().image;
  const auto corners = [&](uint32_t mip) {
    const auto width = static_cast<int32_t>(mip_size(desc.width, mip));
    const auto height = static_cast<int32_t>(mip_size(desc.height, mip));
    return std::array{vk::Offset3D(0, 0, 0), vk::Offset3D(width, height, 1)};
  };
  for (uint32_t mip = 1; mip < desc.mip_levels; ++mip) {
    const vk::ImageSubresourceLayers from(image.impl().aspect, mip - 1, 0, desc.layers);
    const vk::ImageSubresourceLayers to(image.impl().aspect, mip, 0, desc.layers);
    if (mip > 1) full_barrier(impl_->cmd());
    impl_->cmd().blitImage(handle, kLayout, handle, kLayout,
                           vk::ImageBlit(from, corners(mip - 1), to, corners(mip)), vk::Filter::eLinear);
  }
}

}  // namespace tessera::gpu
