#include "shading/reference.h"

#include <bit>
#include <cstring>

#include "shading/draw_list.h"
#include "shading/features.h"
#include "shading/growing_buffer.h"
#include "shading/shaders/forward.frag.spv.h"
#include "shading/shaders/forward.vert.spv.h"
#include "shading/shaders/forward_mask.frag.spv.h"
#include "shading/shaders/ids.frag.spv.h"

namespace tessera::shading {
namespace {

constexpr gpu::Format kColor = gpu::Format::rgba8_unorm;  // sRGB-encoded by the shader, so that resolving averages that
constexpr gpu::Format kIds = gpu::Format::rg32_uint;
constexpr gpu::Format kDepth = gpu::Format::depth32_float;
constexpr uint32_t kMaxSide = 16384;

// shading/shaders/view.glsl
struct ViewRecord {
  mat4 clip_from_relative;
  vec4 eye;
  vec4 ray_0, ray_x, ray_y;
};

struct DrawPush {
  uint32_t first_triangle, instance, material;
};

ViewRecord view_record(const View& view, const dvec3& origin) {
  const glm::dmat3 world_from_camera = glm::mat3_cast(view.pose.orientation);
  const Fov& f = view.fov;
  const vec3 step_x((f.right - f.left) / static_cast<float>(view.width), 0, 0);
  const vec3 step_y(0, (f.down - f.up) / static_cast<float>(view.height), 0);
  const mat3 rotation(world_from_camera);
  return {view_projection(view, origin), vec4(vec3(view.pose.position - origin), 1),
          vec4(rotation * vec3(f.left, f.up, -1), 0), vec4(rotation * step_x, 0), vec4(rotation * step_y, 0)};
}

// The same pass for opaque and for alpha-masked materials.
struct Pipelines {
  gpu::RasterPipeline opaque, masked;
};

// Images of one size and sample count.
struct Targets {
  uint32_t width = 0, height = 0, samples = 0;
  gpu::Image color, depth, resolved;  // `resolved` only with several samples
  gpu::Buffer readback;
  const gpu::Image& final_color() const { return samples > 1 ? resolved : color; }
};

struct IdTargets {
  uint32_t width = 0, height = 0;
  gpu::Image ids, depth;
  gpu::Buffer readback;
};

}  // namespace

struct ReferenceRenderer::Impl {
  gpu::Device& device;
  const scene::GpuScene& scene;
  const Lighting& lighting;
  gpu::BindLayout view_layout;
  gpu::BindGroup view_group;
  gpu::Buffer view_buffer;
  // Made when first asked for: a sample count, and ids, that nobody wants cost nothing.
  struct ColorPass {
    Pipelines depth, color;
    bool ready = false;
  };
  ColorPass color_passes[2];  // 1 and 4 samples
  Pipelines id_pass;
  bool id_pass_ready = false;
  Targets targets;
  IdTargets id_targets;
  double gpu_ms = 0;

  Status create();
  StatusOr<Pipelines> create_pipelines(gpu::RasterPipelineDesc desc, gpu::Spirv opaque, gpu::Spirv masked);
  StatusOr<ColorPass*> color_pass(uint32_t samples);
  Status ensure_id_pass();
  Status ensure_targets(const View& view, uint32_t samples);
  Status ensure_id_targets(const View& view);
  void draw(gpu::Commands& commands, const scene::SceneInstant& instant, const Pipelines& pipelines,
            const DrawList& list);
  void record_color(gpu::Commands& commands, const scene::SceneInstant& instant, const ColorPass& pass,
                    const DrawList& list);
  void record_ids(gpu::Commands& commands, const scene::SceneInstant& instant, const DrawList& list);
  ReferenceImage read(const View& view, const ReferenceRequest& request) const;
};

Status ReferenceRenderer::Impl::create() {
  const gpu::Binding binding{0, gpu::BindingKind::uniform_buffer};
  TESSERA_ASSIGN_OR_RETURN(view_layout, gpu::BindLayout::create(device, {&binding, 1}));
  TESSERA_ASSIGN_OR_RETURN(view_group, gpu::BindGroup::create(device, view_layout));
  TESSERA_ASSIGN_OR_RETURN(view_buffer,
                           gpu::Buffer::create(device, sizeof(ViewRecord), gpu::Memory::upload, "reference view"));
  view_group.set(0, view_buffer);
  return absl::OkStatus();
}

StatusOr<Pipelines> ReferenceRenderer::Impl::create_pipelines(gpu::RasterPipelineDesc desc, gpu::Spirv opaque,
                                                              gpu::Spirv masked) {
  desc.vertex = forward_vert;
  desc.layouts = {&scene.layout(), &scene.instant_layout(), &lighting.layout(), &view_layout};
  desc.push_bytes = sizeof(DrawPush);
  desc.depth = kDepth;
  desc.constants = scene.constants();
  for (const gpu::Constant& c : lighting.constants()) desc.constants.push_back(c);
  Pipelines pipelines;
  desc.fragment = opaque;
  TESSERA_ASSIGN_OR_RETURN(pipelines.opaque, gpu::RasterPipeline::create(device, desc));
  if (!scene.scene().features.alpha_mask) return pipelines;
  desc.name += ", masked";
  desc.fragment = masked;
  desc.constants.push_back({kMaskedDrawId, 1});
  TESSERA_ASSIGN_OR_RETURN(pipelines.masked, gpu::RasterPipeline::create(device, desc));
  return pipelines;
}

StatusOr<ReferenceRenderer::Impl::ColorPass*> ReferenceRenderer::Impl::color_pass(uint32_t samples) {
  ColorPass& pass = color_passes[samples == 4];
  if (pass.ready) return &pass;
  const gpu::RasterPipelineDesc depth{
      .name = "reference depth", .samples = samples, .sample_shading = samples > 1};
  const gpu::RasterPipelineDesc color{.name = "reference color",
                                      .colors = {kColor},
                                      .depth_write = false,
                                      .samples = samples,
                                      .sample_shading = samples > 1};
  TESSERA_ASSIGN_OR_RETURN(pass.depth, create_pipelines(depth, {}, forward_mask_frag));
  TESSERA_ASSIGN_OR_RETURN(pass.color, create_pipelines(color, forward_frag, forward_frag));
  pass.ready = true;
  return &pass;
}

Status ReferenceRenderer::Impl::ensure_id_pass() {
  if (id_pass_ready) return absl::OkStatus();
  TESSERA_ASSIGN_OR_RETURN(id_pass, create_pipelines({.name = "reference ids", .colors = {kIds}}, ids_frag, ids_frag));
  id_pass_ready = true;
  return absl::OkStatus();
}

Status ReferenceRenderer::Impl::ensure_targets(const View& view, uint32_t samples) {
  Targets& t = targets;
  if (t.width == view.width && t.height == view.height && t.samples == samples) return absl::OkStatus();
  t = {};
  gpu::ImageDesc desc{.width = view.width, .height = view.height, .format = kColor, .samples = samples};
  TESSERA_ASSIGN_OR_RETURN(t.color, gpu::Image::create(device, desc, "reference color"));
  desc.format = kDepth;
  TESSERA_ASSIGN_OR_RETURN(t.depth, gpu::Image::create(device, desc, "reference depth"));
  desc.format = kColor;
  desc.samples = 1;
  if (samples > 1) {
    TESSERA_ASSIGN_OR_RETURN(t.resolved, gpu::Image::create(device, desc, "reference resolved"));
  }
  const uint64_t bytes = uint64_t{4} * view.width * view.height;
  TESSERA_ASSIGN_OR_RETURN(t.readback,
                           gpu::Buffer::create(device, bytes, gpu::Memory::readback, "reference readback"));
  t.width = view.width, t.height = view.height, t.samples = samples;
  return absl::OkStatus();
}

Status ReferenceRenderer::Impl::ensure_id_targets(const View& view) {
  IdTargets& t = id_targets;
  if (t.width == view.width && t.height == view.height) return absl::OkStatus();
  t = {};
  gpu::ImageDesc desc{.width = view.width, .height = view.height, .format = kIds};
  TESSERA_ASSIGN_OR_RETURN(t.ids, gpu::Image::create(device, desc, "reference ids"));
  desc.format = kDepth;
  TESSERA_ASSIGN_OR_RETURN(t.depth, gpu::Image::create(device, desc, "reference id depth"));
  const uint64_t bytes = uint64_t{8} * view.width * view.height;
  TESSERA_ASSIGN_OR_RETURN(t.readback,
                           gpu::Buffer::create(device, bytes, gpu::Memory::readback, "reference id readback"));
  t.width = view.width, t.height = view.height;
  return absl::OkStatus();
}

void ReferenceRenderer::Impl::draw(gpu::Commands& commands, const scene::SceneInstant& instant,
                                   const Pipelines& pipelines, const DrawList& list) {
  const auto draw_ranges = [&](const gpu::RasterPipeline& pipeline, std::span<const DrawRange> ranges) {
    if (ranges.empty()) return;
    commands.bind(pipeline, {&scene.group(), &instant.group(), &lighting.group(), &view_group});
    commands.bind_indices(scene.indices());
    record_draws(commands, ranges, [&](const DrawRange& r) {
      commands.push(DrawPush{r.first_triangle, r.instance, scene.scene().instances[r.instance].material});
    });
  };
  draw_ranges(pipelines.opaque, list.opaque);
  draw_ranges(pipelines.masked, list.masked);
}

// Depth first, so that each sample is shaded once.
void ReferenceRenderer::Impl::record_color(gpu::Commands& commands, const scene::SceneInstant& instant,
                                           const ColorPass& pass, const DrawList& list) {
  const Targets& t = targets;
  commands.begin_rendering({.depth = &t.depth, .width = t.width, .height = t.height});
  draw(commands, instant, pass.depth, list);
  commands.end_rendering();
  commands.barrier();
  gpu::ColorAttachment color{.image = &t.color, .resolve = t.samples > 1 ? &t.resolved : nullptr};
  color.clear = {kBackground[0] / 255.0f, kBackground[1] / 255.0f, kBackground[2] / 255.0f, 0.0f};
  commands.begin_rendering({.colors = {&color, 1},
                            .depth = &t.depth,
                            .clear_depth = false,
                            .width = t.width,
                            .height = t.height});
  draw(commands, instant, pass.color, list);
  commands.end_rendering();
  commands.barrier();
  commands.copy_to_buffer(t.final_color(), t.readback);
}

void ReferenceRenderer::Impl::record_ids(gpu::Commands& commands, const scene::SceneInstant& instant,
                                         const DrawList& list) {
  const IdTargets& t = id_targets;
  const gpu::ColorAttachment ids{.image = &t.ids, .clear_uint = std::array<uint32_t, 4>{}};
  commands.begin_rendering({.colors = {&ids, 1}, .depth = &t.depth, .width = t.width, .height = t.height});
  draw(commands, instant, id_pass, list);
  commands.end_rendering();
  commands.barrier();
  commands.copy_to_buffer(t.ids, t.readback);
}

ReferenceImage ReferenceRenderer::Impl::read(const View& view, const ReferenceRequest& request) const {
  ReferenceImage image;
  image.color = Image8(view.width, view.height);
  std::memcpy(image.color.rgba.data(), targets.readback.mapped(), image.color.rgba.size());
  const size_t pixels = size_t{view.width} * view.height;
  if (request.ids) image.covered.resize(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    uint8_t& alpha = image.color.rgba[4 * i + 3];
    if (request.ids) image.covered[i] = alpha == 255;  // the share of samples on geometry
    alpha = 255;
  }
  if (!request.ids && !request.depth) return image;
  const auto id_depth = id_targets.readback.as<uvec2>();
  if (request.ids) image.triangle_plus_one.resize(pixels);
  if (request.depth) image.depth.resize(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    const bool hit = id_depth[i].x != 0;
    if (request.ids) image.triangle_plus_one[i] = id_depth[i].x;
    if (request.depth)
      image.depth[i] = hit ? std::bit_cast<float>(id_depth[i].y) : std::numeric_limits<float>::infinity();
  }
  return image;
}

ReferenceRenderer::ReferenceRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ReferenceRenderer::~ReferenceRenderer() = default;

StatusOr<std::unique_ptr<ReferenceRenderer>> ReferenceRenderer::create(gpu::Device& device,
                                                                       const scene::GpuScene& scene,
                                                                       const Lighting& lighting) {
  auto impl = std::unique_ptr<Impl>(new Impl{.device = device, .scene = scene, .lighting = lighting});
  TESSERA_RETURN_IF_ERROR(impl->create());
  return std::unique_ptr<ReferenceRenderer>(new ReferenceRenderer(std::move(impl)));
}

StatusOr<ReferenceImage> ReferenceRenderer::render(const scene::SceneInstant& instant, const View& requested_view,
                                                   const ReferenceRequest& request) {
  Impl& r = *impl_;
  View view = requested_view;
  view.pose = normalized(view.pose);
  if (view.width == 0 || view.height == 0 || view.width > kMaxSide || view.height > kMaxSide)
    return absl::InvalidArgumentError(absl::StrFormat("reference: %ux%u pixels, each side must be 1..%u", view.width,
                                                      view.height, kMaxSide));
  if (request.samples != 1 && request.samples != 4)
    return absl::InvalidArgumentError(absl::StrFormat("reference: %u samples, must be 1 or 4", request.samples));

  TESSERA_ASSIGN_OR_RETURN(Impl::ColorPass* const pass, r.color_pass(request.samples));
  TESSERA_RETURN_IF_ERROR(r.ensure_targets(view, request.samples));
  const bool ids = request.ids || request.depth;
  if (ids) TESSERA_RETURN_IF_ERROR(r.ensure_id_pass());
  if (ids) TESSERA_RETURN_IF_ERROR(r.ensure_id_targets(view));

  const ViewRecord record = view_record(view, instant.origin());
  write<ViewRecord>(r.view_buffer, {&record, 1});
  const Frustum frustum(record.clip_from_relative, instant.origin(), false);
  const DrawList list = build_draw_list(r.scene, instant, frustum, false);

  gpu::Commands commands = r.device.begin();
  commands.begin_interval("reference");
  r.record_color(commands, instant, *pass, list);
  if (ids) r.record_ids(commands, instant, list);
  commands.barrier();
  commands.end_interval();
  TESSERA_RETURN_IF_ERROR(r.device.run(std::move(commands)));
  r.gpu_ms = 0;
  for (const auto& interval : r.device.intervals()) r.gpu_ms += interval.ms;
  return r.read(view, request);
}

double ReferenceRenderer::gpu_ms() const { return impl_->gpu_ms; }

}  // namespace tessera::shading
