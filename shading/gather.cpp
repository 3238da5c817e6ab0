#include "shading/gather.h"

#include <algorithm>
#include <optional>

#include "base/time.h"
#include "shading/features.h"
#include "shading/gather_pass.h"
#include "shading/gather_work.h"
#include "shading/growing_buffer.h"
#include "shading/material_groups.h"
#include "shading/shaders/gather.comp.spv.h"
#include "shading/shaders/gather.frag.spv.h"
#include "shading/shaders/gather.tese.spv.h"
#include "shading/shaders/gather.vert.spv.h"
#include "shading/shaders/gather_patch.vert.spv.h"
#include "shading/shaders/patch.tesc.spv.h"
#include "shading/tessellator.h"

namespace tessera::shading {
namespace {

constexpr gpu::Format kAtlasFormat = gpu::Format::rgba8_srgb;
// Linear value of sRGB 128; alpha 0 marks texels that were never used.
constexpr std::array<float, 4> kMidGrey{0.2158605f, 0.2158605f, 0.2158605f, 0};
constexpr uint32_t kMaxGroupsX = 32768;  // Vulkan guarantees 65535

enum GatherBinding : uint32_t { kBlocks = 1, kStarts, kColors, kAtlas };

}  // namespace

struct Gather::Impl {
  gpu::Device& device;
  const scene::GpuScene& scene;
  const Lighting& lighting;
  GatherSettings settings;
  MaterialGroups groups;
  GatherChoice choice;
  gpu::ComputePipeline compute;               // single colours are computed on every path
  std::optional<gpu::RasterPipeline> raster;  // these only if they are used
  std::optional<gpu::TessellationPipeline> tessellation;
  gpu::Image image;
  gpu::Buffer blocks, starts, colors;
  uint32_t color_count = 0;
  mutable GatherStats stats;

  Status create();
  Status create_compute();
  Status create_raster();
  Status create_tessellation();
  Status choose(const GatherChoice& wanted);
  std::vector<const gpu::BindLayout*> layouts() const;
  std::vector<gpu::Constant> constants() const;
  Status upload(const GatherWork& work);
  Status fit(uint32_t binding, gpu::Buffer& buffer, uint64_t bytes, gpu::Memory memory);
  void record_compute(gpu::Commands& commands, const scene::SceneInstant& instant, PassPush push,
                      const GatherWork& work);
  void record_raster(gpu::Commands& commands, const scene::SceneInstant& instant, PassPush push,
                     const GatherWork& work);
  void record_tessellation(gpu::Commands& commands, const scene::SceneInstant& instant, PassPush push,
                           const GatherWork& work);
};

Status Gather::Impl::create() {
  constexpr gpu::Binding kBindings[] = {{kBlocks, gpu::BindingKind::storage_buffer},
                                        {kStarts, gpu::BindingKind::storage_buffer},
                                        {kColors, gpu::BindingKind::storage_buffer},
                                        {kAtlas, gpu::BindingKind::storage_image}};
  if (settings.width == 0 || settings.height == 0 || settings.width > 65536 || settings.height > 65536)
    return absl::InvalidArgumentError(absl::StrFormat(
        "gather: atlas of %ux%u texels, each side must be 1..65536", settings.width, settings.height));
  TESSERA_ASSIGN_OR_RETURN(groups, MaterialGroups::create(device, scene, kBindings));
  const gpu::ImageDesc desc{
      .width = settings.width, .height = settings.height, .format = kAtlasFormat, .storage = true};
  TESSERA_ASSIGN_OR_RETURN(image, gpu::Image::create(device, desc, "atlas"));
  groups.set(kAtlas, image);
  TESSERA_RETURN_IF_ERROR(upload({}));
  TESSERA_RETURN_IF_ERROR(create_compute());
  TESSERA_RETURN_IF_ERROR(
      choose(settings.path == GatherPath::automatic ? settings.choice : only(settings.path)));
  gpu::Commands commands = device.begin();
  commands.clear(image, kMidGrey);
  commands.barrier();
  return device.run(std::move(commands));
}

std::vector<const gpu::BindLayout*> Gather::Impl::layouts() const {
  return {&scene.layout(), &scene.instant_layout(), &lighting.layout(), &groups.layout()};
}

std::vector<gpu::Constant> Gather::Impl::constants() const {
  std::vector<gpu::Constant> constants = scene.constants();
  for (const gpu::Constant& c : lighting.constants()) constants.push_back(c);
  return constants;
}

Status Gather::Impl::create_compute() {
  TESSERA_ASSIGN_OR_RETURN(compute, gpu::ComputePipeline::create(device, {.name = "gather compute",
                                                                          .shader = gather_comp,
                                                                          .layouts = layouts(),
                                                                          .push_bytes = sizeof(PassPush),
                                                                          .constants = constants()}));
  return absl::OkStatus();
}

Status Gather::Impl::create_raster() {
  TESSERA_ASSIGN_OR_RETURN(raster, gpu::RasterPipeline::create(device, {.name = "gather raster",
                                                                        .vertex = gather_vert,
                                                                        .fragment = gather_frag,
                                                                        .layouts = layouts(),
                                                                        .push_bytes = sizeof(PassPush),
                                                                        .constants = constants(),
                                                                        .colors = {kAtlasFormat}}));
  return absl::OkStatus();
}

Status Gather::Impl::create_tessellation() {
  TESSERA_RETURN_IF_ERROR(check_tessellator(device));
  TESSERA_ASSIGN_OR_RETURN(tessellation,
                           gpu::TessellationPipeline::create(device, {.name = "gather tessellation",
                                                                      .vertex = gather_patch_vert,
                                                                      .control = patch_tesc,
                                                                      .evaluation = gather_tese,
                                                                      .layouts = layouts(),
                                                                      .push_bytes = sizeof(PassPush),
                                                                      .constants = constants()}));
  return absl::OkStatus();
}

Status Gather::Impl::choose(const GatherChoice& wanted) {
  if (wanted.uses(GatherPath::raster) && !raster) TESSERA_RETURN_IF_ERROR(create_raster());
  if (wanted.uses(GatherPath::tessellation) && !tessellation) TESSERA_RETURN_IF_ERROR(create_tessellation());
  choice = wanted;
  return absl::OkStatus();
}

Status Gather::Impl::fit(uint32_t binding, gpu::Buffer& buffer, uint64_t bytes, gpu::Memory memory) {
  TESSERA_ASSIGN_OR_RETURN(const bool is_new, grow(device, buffer, bytes, memory, "gather"));
  if (is_new) groups.set(binding, buffer);
  return absl::OkStatus();
}

Status Gather::Impl::upload(const GatherWork& work) {
  TESSERA_RETURN_IF_ERROR(
      fit(kBlocks, blocks, work.blocks.size() * sizeof(BlockRecord), gpu::Memory::upload));
  TESSERA_RETURN_IF_ERROR(fit(kStarts, starts, work.starts.size() * sizeof(uint32_t), gpu::Memory::upload));
  TESSERA_RETURN_IF_ERROR(fit(kColors, colors, work.colors * sizeof(uint32_t), gpu::Memory::readback));
  write<BlockRecord>(blocks, work.blocks);
  write<uint32_t>(starts, work.starts);
  color_count = work.colors;
  stats = {.samples = work.samples,
           .color_samples = work.colors,
           .half_samples = work.half_samples,
           .half_samples_outside = work.half_samples_outside,
           .raster_blocks = work.raster_blocks,
           .compute_blocks = work.compute_blocks,
           .tessellated_blocks = work.tessellated_blocks};
  return absl::OkStatus();
}

void Gather::Impl::record_compute(gpu::Commands& commands, const scene::SceneInstant& instant, PassPush push,
                                  const GatherWork& work) {
  for (const ComputeBatch& batch : work.compute_batches) {
    commands.bind(compute, {&scene.group(), &instant.group(), &lighting.group(), &groups.of(batch.material)});
    push.first_chunk = batch.first_chunk;
    push.end_chunk = batch.end_chunk;
    commands.push(push);
    const uint32_t chunks = batch.end_chunk - batch.first_chunk;
    const uint32_t groups_x = std::min(chunks, kMaxGroupsX);
    commands.dispatch(groups_x, (chunks + groups_x - 1) / groups_x);
  }
}

void Gather::Impl::record_raster(gpu::Commands& commands, const scene::SceneInstant& instant, PassPush push,
                                 const GatherWork& work) {
  if (work.raster_batches.empty()) return;
  commands.barrier();  // a render pass loads and stores all of the atlas, what others wrote included
  const gpu::ColorAttachment atlas{.image = &image};
  commands.begin_rendering({.colors = {&atlas, 1}, .width = settings.width, .height = settings.height});
  for (const DrawBatch& batch : work.raster_batches) {
    commands.bind(*raster, {&scene.group(), &instant.group(), &lighting.group(), &groups.of(batch.material)});
    commands.push(push);
    commands.draw(6, batch.block_count, 0, batch.first_block);
  }
  commands.end_rendering();
}

void Gather::Impl::record_tessellation(gpu::Commands& commands, const scene::SceneInstant& instant,
                                       PassPush push, const GatherWork& work) {
  if (work.tessellation_batches.empty()) return;
  commands.barrier();
  commands.begin_rendering({.width = 1, .height = 1});  // nothing is rasterised
  for (const DrawBatch& batch : work.tessellation_batches) {
    commands.bind(*tessellation,
                  {&scene.group(), &instant.group(), &lighting.group(), &groups.of(batch.material)});
    commands.push(push);
    commands.draw(batch.block_count, 1, batch.first_block);
  }
  commands.end_rendering();
}

Gather::Gather(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Gather::~Gather() = default;

StatusOr<std::unique_ptr<Gather>> Gather::create(gpu::Device& device, const scene::GpuScene& scene,
                                                 const Lighting& lighting, const GatherSettings& settings) {
  auto impl = std::unique_ptr<Impl>(
      new Impl{.device = device, .scene = scene, .lighting = lighting, .settings = settings});
  TESSERA_RETURN_IF_ERROR(impl->create());
  return std::unique_ptr<Gather>(new Gather(std::move(impl)));
}

Status Gather::choose(const GatherChoice& choice) {
  return impl_->choose(choice);
}

Status Gather::record(gpu::Commands& commands, const scene::SceneInstant& instant, const View& viewer,
                      std::span<const atlas::Placement> placements) {
  const SteadyClock clock;
  const TimeNs begin = clock.now();
  const GatherLimits limits{impl_->settings.width, impl_->settings.height, impl_->choice};
  TESSERA_ASSIGN_OR_RETURN(const GatherWork work, build_gather_work(impl_->scene, placements, limits));
  TESSERA_RETURN_IF_ERROR(impl_->upload(work));
  impl_->stats.list_ms = to_ms(clock.now() - begin);
  PassPush push = pass_of(viewer, instant.origin());
  push.width = impl_->settings.width;
  push.height = impl_->settings.height;
  commands.begin_interval("gather");
  impl_->record_compute(commands, instant, push, work);
  impl_->record_raster(commands, instant, push, work);
  impl_->record_tessellation(commands, instant, push, work);
  commands.barrier();
  commands.end_interval();
  return absl::OkStatus();
}

std::span<const uint32_t> Gather::colors() const {
  return impl_->colors.as<const uint32_t>().first(impl_->color_count);
}
const gpu::Image& Gather::image() const {
  return impl_->image;
}

const GatherStats& Gather::stats() const {
  for (const auto& interval : impl_->device.intervals())
    if (interval.name == "gather") impl_->stats.gpu_ms = interval.ms;
  return impl_->stats;
}

}  // namespace tessera::shading
