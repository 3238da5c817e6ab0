#include "bench/mesh_warp.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "bench/shaders/mesh_warp.frag.spv.h"
#include "bench/shaders/mesh_warp.vert.spv.h"
#include "gpu/buffer.h"
#include "gpu/commands.h"
#include "gpu/image.h"
#include "gpu/pipeline.h"

namespace tessera::bench {
namespace {

constexpr uint32_t kSamples = 4;
constexpr float kFovGrowth = 0.2f;  // thesis 7.2
constexpr uint32_t kMaxSourceSide = 8192;

struct Push {  // as in mesh_warp.vert
  mat4 clip_from_source;
  vec4 fov;
  uvec2 size;
};

// Two triangles a quad of the vertex grid.
std::vector<uint32_t> grid_indices(uint32_t width, uint32_t height) {
  std::vector<uint32_t> indices;
  indices.reserve(size_t{6} * (width - 1) * (height - 1));
  for (uint32_t y = 0; y + 1 < height; ++y) {
    for (uint32_t x = 0; x + 1 < width; ++x) {
      const uint32_t a = y * width + x, b = a + 1, c = a + width, d = c + 1;
      indices.insert(indices.end(), {a, c, b, b, c, d});
    }
  }
  return indices;
}

mat4 clip_from_source(const View& source, const View& target) {
  const dvec3& origin = source.pose.position;
  return view_projection(target, origin) * mat4(glm::mat4_cast(normalized(source.pose).orientation));
}

}  // namespace

struct MeshWarp::Impl {
  explicit Impl(gpu::Device& d) : device(d) {}

  Status create_source(uint32_t width, uint32_t height);
  Status create_target(uint32_t width, uint32_t height);
  Status create_pipeline();

  gpu::Device& device;
  std::array<float, 4> background{};
  gpu::Image color, target, resolved, depth;
  gpu::Sampler sampler;
  gpu::Buffer staging, inverse_depths, indices, readback;
  gpu::BindLayout layout;
  gpu::BindGroup group;
  gpu::RasterPipeline pipeline;
  View source;
  double gpu_ms = 0;
};

Status MeshWarp::Impl::create_source(uint32_t width, uint32_t height) {
  using gpu::Memory;
  const uint64_t bytes = uint64_t{4} * width * height;
  TESSERA_ASSIGN_OR_RETURN(staging, gpu::Buffer::create(device, bytes, Memory::upload, "mesh warp staging"));
  TESSERA_ASSIGN_OR_RETURN(inverse_depths,
                           gpu::Buffer::create(device, bytes, Memory::upload, "mesh warp inverse depths"));
  const std::vector<uint32_t> grid = grid_indices(width, height);
  TESSERA_ASSIGN_OR_RETURN(
      indices, gpu::Buffer::create_filled(device, std::as_bytes(std::span(grid)), "mesh warp grid"));
  TESSERA_ASSIGN_OR_RETURN(
      color, gpu::Image::create(device, {.width = width, .height = height}, "mesh warp source"));
  TESSERA_ASSIGN_OR_RETURN(sampler, gpu::Sampler::create(device, {.wrap_u = gpu::Wrap::clamp_to_edge,
                                                                  .wrap_v = gpu::Wrap::clamp_to_edge}));
  return absl::OkStatus();
}

Status MeshWarp::Impl::create_target(uint32_t width, uint32_t height) {
  gpu::ImageDesc desc{.width = width, .height = height};
  TESSERA_ASSIGN_OR_RETURN(resolved, gpu::Image::create(device, desc, "mesh warp result"));
  desc.samples = kSamples;
  TESSERA_ASSIGN_OR_RETURN(target, gpu::Image::create(device, desc, "mesh warp samples"));
  desc.format = gpu::Format::depth32_float;
  TESSERA_ASSIGN_OR_RETURN(depth, gpu::Image::create(device, desc, "mesh warp depth"));
  TESSERA_ASSIGN_OR_RETURN(readback, gpu::Buffer::create(device, uint64_t{4} * width * height,
                                                         gpu::Memory::readback, "mesh warp readback"));
  return absl::OkStatus();
}

Status MeshWarp::Impl::create_pipeline() {
  const gpu::Binding bindings[] = {{0, gpu::BindingKind::storage_buffer},
                                   {1, gpu::BindingKind::sampled_image}};
  TESSERA_ASSIGN_OR_RETURN(layout, gpu::BindLayout::create(device, bindings));
  TESSERA_ASSIGN_OR_RETURN(group, gpu::BindGroup::create(device, layout));
  group.set(0, inverse_depths);
  group.set(1, color, sampler);
  TESSERA_ASSIGN_OR_RETURN(pipeline,
                           gpu::RasterPipeline::create(device, {.name = "mesh warp",
                                                                .vertex = mesh_warp_vert,
                                                                .fragment = mesh_warp_frag,
                                                                .layouts = {&layout},
                                                                .push_bytes = sizeof(Push),
                                                                .colors = {gpu::Format::rgba8_unorm},
                                                                .depth = gpu::Format::depth32_float,
                                                                .samples = kSamples}));
  return absl::OkStatus();
}

StatusOr<std::unique_ptr<MeshWarp>> MeshWarp::create(gpu::Device& device, uint32_t source_width,
                                                     uint32_t source_height, uint32_t target_width,
                                                     uint32_t target_height, const uint8_t background[3]) {
  if (std::min(source_width, source_height) < 2 || std::max(source_width, source_height) > kMaxSourceSide) {
    return absl::InvalidArgumentError(absl::StrCat("mesh warp: source size ", source_width, "x",
                                                   source_height, " is not within 2..", kMaxSourceSide));
  }
  auto impl = std::make_unique<Impl>(device);
  for (int c = 0; c < 3; ++c) impl->background[c] = background[c] / 255.0f;
  impl->background[3] = 1;
  impl->source.width = source_width;
  impl->source.height = source_height;
  TESSERA_RETURN_IF_ERROR(impl->create_source(source_width, source_height));
  TESSERA_RETURN_IF_ERROR(impl->create_target(target_width, target_height));
  TESSERA_RETURN_IF_ERROR(impl->create_pipeline());
  return std::unique_ptr<MeshWarp>(new MeshWarp(std::move(impl)));
}

MeshWarp::MeshWarp(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MeshWarp::~MeshWarp() = default;

Status MeshWarp::set_source(const View& view, const Image8& color, std::span<const float> depth) {
  const uint32_t width = impl_->color.width(), height = impl_->color.height();
  if (color.width != width || color.height != height || depth.size() != size_t{width} * height) {
    return absl::InvalidArgumentError(absl::StrCat("mesh warp: the source is not ", width, "x", height));
  }
  impl_->source = view;
  std::memcpy(impl_->staging.mapped(), color.rgba.data(), color.rgba.size());
  std::ranges::transform(depth, impl_->inverse_depths.as<float>().begin(), [](float d) { return 1 / d; });
  gpu::Commands commands = impl_->device.begin();
  commands.copy_to_image(impl_->staging, 0, impl_->color);
  return impl_->device.run(std::move(commands));
}

StatusOr<Image8> MeshWarp::draw(const View& target) {
  Impl& i = *impl_;
  const uint32_t width = i.resolved.width(), height = i.resolved.height();
  const Fov& fov = i.source.fov;
  const gpu::ColorAttachment attachment{.image = &i.target, .clear = i.background, .resolve = &i.resolved};

  gpu::Commands commands = i.device.begin();
  commands.begin_interval("mesh warp");
  commands.begin_rendering(
      {.colors = std::span(&attachment, 1), .depth = &i.depth, .width = width, .height = height});
  commands.bind(i.pipeline, {&i.group});
  commands.push(Push{clip_from_source(i.source, target),
                     {fov.left, fov.right, fov.down, fov.up},
                     {i.color.width(), i.color.height()}});
  commands.bind_indices(i.indices);
  commands.draw_indexed(static_cast<uint32_t>(i.indices.size() / sizeof(uint32_t)), 1, 0, 0, 0);
  commands.end_rendering();
  commands.end_interval();
  commands.barrier();
  commands.copy_to_buffer(i.resolved, i.readback);
  commands.barrier();
  TESSERA_RETURN_IF_ERROR(i.device.run(std::move(commands)));

  i.gpu_ms = 0;
  for (const auto& interval : i.device.intervals()) i.gpu_ms += interval.ms;
  Image8 image(width, height);
  std::memcpy(image.rgba.data(), i.readback.mapped(), image.rgba.size());
  return image;
}

double MeshWarp::gpu_ms() const {
  return impl_->gpu_ms;
}

View warp_source_view(const View& client) {
  View view = client;
  view.fov =
      client.fov.widened(client.fov.width_rad() * kFovGrowth / 2, client.fov.height_rad() * kFovGrowth / 2);
  const auto even = [](float pixels) { return 2 * static_cast<uint32_t>(std::ceil(pixels / 2)); };
  const float x = (view.fov.right - view.fov.left) / (client.fov.right - client.fov.left);
  const float y = (view.fov.up - view.fov.down) / (client.fov.up - client.fov.down);
  view.width = even(static_cast<float>(client.width) * x);
  view.height = even(static_cast<float>(client.height) * y);
  return view;
}

}  // namespace tessera::bench
