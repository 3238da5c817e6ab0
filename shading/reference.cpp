#include "shading/reference.h"

#include <bit>

#include "shading/draw_list.h"
#include "shading/features.h"
#include "shading/growing_buffer.h"
#include "shading/material_groups.h"
#include "shading/shaders/forward.frag.spv.h"
#include "shading/shaders/forward.vert.spv.h"
#include "shading/shaders/forward_mask.frag.spv.h"
#include "shading/shaders/ids.frag.spv.h"

namespace tessera::shading {
namespace {

constexpr gpu::Format kColor =
    gpu::Format::rgba8_unorm;  // sRGB-encoded by the shader, so that resolving averages that
constexpr gpu::Format kIds = gpu::Format::rg32_uint;
constexpr gpu::Format kDepth = gpu::Format::depth32_float;
constexpr uint32_t kMaxSide = 16384;
constexpr uint32_t kViewBinding = 1;

// Standard sample positions in a pixel (Vulkan specification, "Multisampling"). Each is a pass of its own: on
// the software device sample shading would run the fragment shader for occluded samples too (measured: 3 to 4
// times the time).
constexpr vec2 kCentre{0.5f, 0.5f};
constexpr vec2 kFourSamples[] = {{0.375f, 0.125f}, {0.875f, 0.375f}, {0.125f, 0.625f}, {0.625f, 0.875f}};

// shading/shaders/view.glsl
struct ViewRecord {
  mat4 clip_from_relative;
  vec4 eye;
  vec4 ray_0, ray_x, ray_y;
  vec4 pixel_size;
};

struct DrawPush {
  vec4 rows[3];  // of the instance's matrix, relative to the instant's origin
  vec2 sample_at;
  uint32_t first_triangle, instance;
};

DrawPush draw_push(const scene::SceneInstant& instant, const DrawRange& range, vec2 sample_at) {
  dmat4 m = instant.instance_transforms()[range.instance];
  m[3] -= glm::dvec4(instant.origin(), 0.0);
  const mat4 rows = glm::transpose(mat4(m));
  return {{rows[0], rows[1], rows[2]}, sample_at, range.first_triangle, range.instance};
}

ViewRecord view_record(const View& view, const dvec3& origin) {
  const mat3 rotation(glm::mat3_cast(view.pose.orientation));
  const Fov& f = view.fov;
  const vec2 pixel(1.0f / static_cast<float>(view.width), 1.0f / static_cast<float>(view.height));
  return {view_projection(view, origin),
          vec4(vec3(view.pose.position - origin), 1),
          vec4(rotation * vec3(f.left, f.up, -1), 0),
          vec4(rotation * vec3((f.right - f.left) * pixel.x, 0, 0), 0),
          vec4(rotation * vec3(0, (f.down - f.up) * pixel.y, 0), 0),
          vec4(2.0f * pixel, 0, 0)};
}

// The same pass for opaque and for alpha-masked materials.
struct Pipelines {
  gpu::RasterPipeline opaque, masked;
};

// Images of one size; one picture a sample is read back.
struct Targets {
  uint32_t width = 0, height = 0, samples = 0;
  gpu::Image color, depth;
  gpu::Buffer readback;
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
  MaterialGroups groups;
  gpu::Buffer view_buffer;
  Pipelines depth_pass, color_pass, id_pass;
  bool id_pass_ready = false;  // ids that nobody wants cost nothing
  Targets targets;
  IdTargets id_targets;
  double gpu_ms = 0;

  Status create();
  StatusOr<Pipelines> create_pipelines(gpu::RasterPipelineDesc desc, gpu::Spirv opaque, gpu::Spirv masked);
  Status ensure_id_pass();
  Status ensure_targets(const View& view, uint32_t samples);
  Status ensure_id_targets(const View& view);
  void draw(gpu::Commands& commands, const scene::SceneInstant& instant, const Pipelines& pipelines,
            const DrawList& list, vec2 sample_at);
  void record_color(gpu::Commands& commands, const scene::SceneInstant& instant, const DrawList& list);
  void record_sample(gpu::Commands& commands, const scene::SceneInstant& instant, const DrawList& list,
                     uint32_t sample);
  void record_ids(gpu::Commands& commands, const scene::SceneInstant& instant, const DrawList& list);
  void read_color(ReferenceImage& image, bool covered) const;
  void read_ids(ReferenceImage& image, const ReferenceRequest& request) const;
};

Status ReferenceRenderer::Impl::create() {
  const gpu::Binding binding{kViewBinding, gpu::BindingKind::uniform_buffer};
  TESSERA_ASSIGN_OR_RETURN(groups, MaterialGroups::create(device, scene, {&binding, 1}));
  TESSERA_ASSIGN_OR_RETURN(
      view_buffer, gpu::Buffer::create(device, sizeof(ViewRecord), gpu::Memory::upload, "reference view"));
  groups.set(kViewBinding, view_buffer);
  TESSERA_ASSIGN_OR_RETURN(depth_pass, create_pipelines({.name = "reference depth"}, {}, forward_mask_frag));
  TESSERA_ASSIGN_OR_RETURN(
      color_pass, create_pipelines({.name = "reference color", .colors = {kColor}, .depth_write = false},
                                   forward_frag, forward_frag));
  return absl::OkStatus();
}

StatusOr<Pipelines> ReferenceRenderer::Impl::create_pipelines(gpu::RasterPipelineDesc desc, gpu::Spirv opaque,
                                                              gpu::Spirv masked) {
  desc.vertex = forward_vert;
  desc.layouts = {&scene.layout(), &scene.instant_layout(), &lighting.layout(), &groups.layout()};
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

Status ReferenceRenderer::Impl::ensure_id_pass() {
  if (id_pass_ready) return absl::OkStatus();
  TESSERA_ASSIGN_OR_RETURN(id_pass,
                           create_pipelines({.name = "reference ids", .colors = {kIds}}, ids_frag, ids_frag));
  id_pass_ready = true;
  return absl::OkStatus();
}

Status ReferenceRenderer::Impl::ensure_targets(const View& view, uint32_t samples) {
  Targets& t = targets;
  if (t.width == view.width && t.height == view.height && t.samples == samples) return absl::OkStatus();
  t = {};
  gpu::ImageDesc desc{.width = view.width, .height = view.height, .format = kColor};
  TESSERA_ASSIGN_OR_RETURN(t.color, gpu::Image::create(device, desc, "reference color"));
  desc.format = kDepth;
  TESSERA_ASSIGN_OR_RETURN(t.depth, gpu::Image::create(device, desc, "reference depth"));
  const uint64_t bytes = uint64_t{4} * view.width * view.height * samples;
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
  TESSERA_ASSIGN_OR_RETURN(
      t.readback, gpu::Buffer::create(device, bytes, gpu::Memory::readback, "reference id readback"));
  t.width = view.width, t.height = view.height;
  return absl::OkStatus();
}

void ReferenceRenderer::Impl::draw(gpu::Commands& commands, const scene::SceneInstant& instant,
                                   const Pipelines& pipelines, const DrawList& list, vec2 sample_at) {
  const auto draw_ranges = [&](const gpu::RasterPipeline& pipeline, std::span<const DrawRange> ranges) {
    if (ranges.empty()) return;
    std::optional<uint32_t> bound;
    record_draws(commands, ranges, [&](const DrawRange& range) {
      const uint32_t material = scene.scene().instances[range.instance].material;
      if (bound != material) {
        commands.bind(pipeline, {&scene.group(), &instant.group(), &lighting.group(), &groups.of(material)});
        if (!bound) commands.bind_indices(scene.indices());
        bound = material;
      }
      commands.set_cull(range.cull);
      commands.push(draw_push(instant, range, sample_at));
    });
  };
  draw_ranges(pipelines.opaque, list.opaque);
  draw_ranges(pipelines.masked, list.masked);
}

// Depth first, so that each sample is shaded once.
void ReferenceRenderer::Impl::record_sample(gpu::Commands& commands, const scene::SceneInstant& instant,
                                            const DrawList& list, uint32_t sample) {
  const Targets& t = targets;
  const vec2 sample_at = t.samples == 1 ? kCentre : kFourSamples[sample];
  commands.begin_interval("reference depth");
  commands.begin_rendering({.depth = &t.depth, .width = t.width, .height = t.height});
  draw(commands, instant, depth_pass, list, sample_at);
  commands.end_rendering();
  commands.barrier();
  commands.end_interval();
  commands.begin_interval("reference color");
  gpu::ColorAttachment color{.image = &t.color};
  color.clear = {kBackground[0] / 255.0f, kBackground[1] / 255.0f, kBackground[2] / 255.0f, 0.0f};
  commands.begin_rendering(
      {.colors = {&color, 1}, .depth = &t.depth, .clear_depth = false, .width = t.width, .height = t.height});
  draw(commands, instant, color_pass, list, sample_at);
  commands.end_rendering();
  commands.barrier();
  commands.end_interval();
  commands.begin_interval("reference copy");
  commands.copy_to_buffer(t.color, t.readback, uint64_t{4} * t.width * t.height * sample);
  commands.barrier();
  commands.end_interval();
}

void ReferenceRenderer::Impl::record_color(gpu::Commands& commands, const scene::SceneInstant& instant,
                                           const DrawList& list) {
  for (uint32_t sample = 0; sample < targets.samples; ++sample)
    record_sample(commands, instant, list, sample);
}

void ReferenceRenderer::Impl::record_ids(gpu::Commands& commands, const scene::SceneInstant& instant,
                                         const DrawList& list) {
  const IdTargets& t = id_targets;
  commands.begin_interval("reference ids");
  const gpu::ColorAttachment ids{.image = &t.ids, .clear_uint = std::array<uint32_t, 4>{}};
  commands.begin_rendering({.colors = {&ids, 1}, .depth = &t.depth, .width = t.width, .height = t.height});
  draw(commands, instant, id_pass, list, kCentre);
  commands.end_rendering();
  commands.barrier();
  commands.copy_to_buffer(t.ids, t.readback);
  commands.end_interval();
}

// The mean of the samples' pictures, rounded as a resolve does. Their alpha tells whether geometry covers
// them.
void ReferenceRenderer::Impl::read_color(ReferenceImage& image, bool covered) const {
  image.color = Image8(targets.width, targets.height);
  const size_t bytes = image.color.rgba.size();
  if (covered) image.covered.resize(bytes / 4);
  const auto samples = targets.readback.as<const uint8_t>();
  for (size_t i = 0; i < bytes; ++i) {
    uint32_t sum = targets.samples / 2;
    for (uint32_t s = 0; s < targets.samples; ++s) sum += samples[s * bytes + i];
    image.color.rgba[i] = static_cast<uint8_t>(sum / targets.samples);
    if (i % 4 != 3) continue;
    if (covered) image.covered[i / 4] = image.color.rgba[i] == 255;
    image.color.rgba[i] = 255;
  }
}

void ReferenceRenderer::Impl::read_ids(ReferenceImage& image, const ReferenceRequest& request) const {
  const auto id_depth = id_targets.readback.as<const uvec2>();
  const size_t pixels = size_t{id_targets.width} * id_targets.height;
  if (request.ids) image.triangle_plus_one.resize(pixels);
  if (request.depth) image.depth.resize(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    const bool hit = id_depth[i].x != 0;
    if (request.ids) image.triangle_plus_one[i] = id_depth[i].x;
    if (request.depth)
      image.depth[i] = hit ? std::bit_cast<float>(id_depth[i].y) : std::numeric_limits<float>::infinity();
  }
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

StatusOr<ReferenceImage> ReferenceRenderer::render(const scene::SceneInstant& instant,
                                                   const View& requested_view,
                                                   const ReferenceRequest& request) {
  Impl& r = *impl_;
  View view = requested_view;
  view.pose = normalized(view.pose);
  if (view.width == 0 || view.height == 0 || view.width > kMaxSide || view.height > kMaxSide)
    return absl::InvalidArgumentError(absl::StrFormat("reference: %ux%u pixels, each side must be 1..%u",
                                                      view.width, view.height, kMaxSide));
  if (request.samples != 1 && request.samples != 4)
    return absl::InvalidArgumentError(
        absl::StrFormat("reference: %u samples, must be 1 or 4", request.samples));

  TESSERA_RETURN_IF_ERROR(r.ensure_targets(view, request.samples));
  const bool ids = request.ids || request.depth;
  if (ids) TESSERA_RETURN_IF_ERROR(r.ensure_id_pass());
  if (ids) TESSERA_RETURN_IF_ERROR(r.ensure_id_targets(view));

  const ViewRecord record = view_record(view, instant.origin());
  write<ViewRecord>(r.view_buffer, {&record, 1});
  const Frustum frustum(record.clip_from_relative, instant.origin(), false);
  const DrawList list = build_draw_list(r.scene, instant, frustum, false);

  gpu::Commands commands = r.device.begin();
  r.record_color(commands, instant, list);
  if (ids) r.record_ids(commands, instant, list);
  commands.barrier();
  TESSERA_RETURN_IF_ERROR(r.device.run(std::move(commands)));
  r.gpu_ms = 0;
  for (const auto& interval : r.device.intervals()) r.gpu_ms += interval.ms;
  ReferenceImage image;
  r.read_color(image, request.ids);
  if (ids) r.read_ids(image, request);
  return image;
}

double ReferenceRenderer::gpu_ms() const {
  return impl_->gpu_ms;
}

}  // namespace tessera::shading
