#include "shading/shadow_maps.h"

#include "shading/draw_list.h"
#include "shading/shaders/shadow.vert.spv.h"
#include "shading/shaders/shadow_mask.frag.spv.h"

namespace tessera::shading {
namespace {

constexpr gpu::Format kDepth = gpu::Format::depth32_float;

mat4 relative_to(const dmat4& clip_from_world, const dvec3& origin) {
  dmat4 m = clip_from_world;
  m[3] = clip_from_world * glm::dvec4(origin, 1.0);
  return mat4(m);
}

}  // namespace

StatusOr<std::unique_ptr<ShadowMaps>> ShadowMaps::create(gpu::Device& device, const scene::GpuScene& scene,
                                                         const LightPlan& plan,
                                                         const ShadowMapSettings& settings) {
  std::unique_ptr<ShadowMaps> maps(new ShadowMaps(device, scene, plan, settings));
  const uint32_t sun_side = plan.sun_shadows ? settings.sun_side : 1;
  const uint32_t spot_side = plan.spot_shadows ? settings.spot_side : 1;
  const uint32_t spot_width = spot_side * std::max(plan.spot_shadows, 1u);
  TESSERA_ASSIGN_OR_RETURN(maps->sun_map_,
                           gpu::Image::create(device, {sun_side, sun_side, kDepth}, "sun shadow map"));
  TESSERA_ASSIGN_OR_RETURN(maps->spot_maps_,
                           gpu::Image::create(device, {spot_width, spot_side, kDepth}, "spot shadow maps"));
  if (plan.sun_shadows) TESSERA_RETURN_IF_ERROR(maps->create_pipelines(maps->sun_pipelines_, true));
  if (plan.spot_shadows) TESSERA_RETURN_IF_ERROR(maps->create_pipelines(maps->spot_pipelines_, false));
  return maps;
}

Status ShadowMaps::create_pipelines(Pipelines& pipelines, bool depth_clamp) {
  gpu::RasterPipelineDesc desc{.name = "shadow",
                               .vertex = shadow_vert,
                               .layouts = {&scene_.layout(), &scene_.instant_layout()},
                               .push_bytes = sizeof(mat4),
                               .constants = scene_.constants(),
                               .depth = kDepth,
                               .depth_clamp = depth_clamp};
  TESSERA_ASSIGN_OR_RETURN(pipelines.opaque, gpu::RasterPipeline::create(device_, desc));
  if (!scene_.scene().features.alpha_mask) return absl::OkStatus();
  desc.name = "shadow, masked";
  desc.fragment = shadow_mask_frag;
  TESSERA_ASSIGN_OR_RETURN(pipelines.masked, gpu::RasterPipeline::create(device_, desc));
  return absl::OkStatus();
}

void ShadowMaps::record_map(gpu::Commands& commands, const scene::SceneInstant& instant, const ShadowFit& fit,
                            const Pipelines& pipelines, bool depth_clamp) const {
  const mat4 clip_from_relative = relative_to(fit.clip_from_world, instant.origin());
  const Frustum frustum(clip_from_relative, instant.origin(), depth_clamp);
  const DrawList list = build_draw_list(scene_, instant, frustum, true);
  const auto draw = [&](const gpu::RasterPipeline& pipeline, std::span<const DrawRange> ranges) {
    if (ranges.empty()) return;
    commands.bind(pipeline, {&scene_.group(), &instant.group()});
    commands.bind_indices(scene_.indices());
    commands.push(clip_from_relative);
    record_draws(commands, ranges, [](const DrawRange&) {});
  };
  draw(pipelines.opaque, list.opaque);
  draw(pipelines.masked, list.masked);
}

Status ShadowMaps::draw(const scene::SceneInstant& instant, std::span<const PlacedLight> lights) {
  if (count() == 0) return absl::OkStatus();
  fits_.clear();
  gpu::Commands commands = device_.begin();
  commands.begin_interval("shadow maps");
  if (plan_.sun_shadows) {
    fits_.push_back(
        fit_sun(scene_.scene(), instant.instance_transforms(), lights[0].direction, settings_.sun_side));
    commands.begin_rendering({.depth = &sun_map_, .width = sun_map_.width(), .height = sun_map_.height()});
    record_map(commands, instant, fits_.back(), sun_pipelines_, true);
    commands.end_rendering();
  }
  if (plan_.spot_shadows) {
    commands.begin_rendering(
        {.depth = &spot_maps_, .width = spot_maps_.width(), .height = spot_maps_.height()});
    for (uint32_t i = 0; i < plan_.spot_shadows; ++i) {
      fits_.push_back(fit_spot(lights[plan_.directional + i], settings_.spot_side));
      commands.set_viewport(i * settings_.spot_side, 0, settings_.spot_side, settings_.spot_side);
      record_map(commands, instant, fits_.back(), spot_pipelines_, false);
    }
    commands.end_rendering();
  }
  commands.barrier();
  commands.end_interval();
  return device_.run(std::move(commands));
}

std::vector<ShadowRecord> ShadowMaps::records(const dvec3& origin) const {
  std::vector<ShadowRecord> records;
  for (uint32_t i = 0; i < fits_.size(); ++i) {
    const bool sun = i < plan_.sun_shadows;
    const float share = sun ? 1 : 1 / static_cast<float>(plan_.spot_shadows);
    const float left = sun ? 0 : static_cast<float>(i - plan_.sun_shadows) * share;
    const gpu::Image& map = sun ? sun_map_ : spot_maps_;
    ShadowRecord r{};
    r.clip_from_relative = relative_to(fits_[i].clip_from_world, origin);
    r.rectangle_offset = vec2(left, 0);
    r.rectangle_size = vec2(share, 1);
    r.texel_m = static_cast<float>(fits_[i].texel_m);
    r.texel_size = 1.0f / vec2(map.width(), map.height());
    records.push_back(r);
  }
  return records;
}

}  // namespace tessera::shading
