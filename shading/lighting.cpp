#include "shading/lighting.h"

#include <algorithm>
#include <optional>

#include "shading/features.h"
#include "shading/growing_buffer.h"
#include "shading/light_grid.h"
#include "shading/shadow_maps.h"

namespace tessera::shading {
namespace {

enum LightingBinding : uint32_t { kLeading, kGridLights, kSunMap, kSpotMaps, kCells, kCellLights };

constexpr gpu::Binding kBindings[] = {
    {kLeading, gpu::BindingKind::uniform_buffer}, {kGridLights, gpu::BindingKind::uniform_buffer},
    {kSunMap, gpu::BindingKind::sampled_image},   {kSpotMaps, gpu::BindingKind::sampled_image},
    {kCells, gpu::BindingKind::storage_buffer},   {kCellLights, gpu::BindingKind::storage_buffer}};

}  // namespace

struct Lighting::Impl {
  gpu::Device& device;
  const scene::GpuScene& scene;
  LightingSettings settings;
  LightPlan plan;
  std::unique_ptr<ShadowMaps> maps;
  gpu::BindLayout layout;
  gpu::BindGroup group;
  gpu::Sampler sampler;
  gpu::Buffer leading, grid_lights, cells, cell_lights;
  std::vector<PlacedLight> placed;
  LightGrid grid;
  std::optional<TimeNs> drawn_at;

  Status create();
  bool out_of_date(TimeNs time_ns) const;
  Status refresh(const scene::SceneInstant& instant);
  void write_buffers(const dvec3& origin);
  Status bind_grown(uint32_t binding, gpu::Buffer& buffer, uint64_t bytes);
};

Status Lighting::Impl::create() {
  const uint32_t spots = settings.spot_shadow_side > 0 ? settings.max_spot_shadows : 0;
  plan = plan_lights(scene.scene(), settings.sun_shadow_side > 0, spots);
  TESSERA_ASSIGN_OR_RETURN(
      maps, ShadowMaps::create(device, scene, plan, {settings.sun_shadow_side, settings.spot_shadow_side}));
  TESSERA_ASSIGN_OR_RETURN(layout, gpu::BindLayout::create(device, kBindings));
  TESSERA_ASSIGN_OR_RETURN(group, gpu::BindGroup::create(device, layout));
  TESSERA_ASSIGN_OR_RETURN(sampler, gpu::Sampler::create(device, {.wrap_u = gpu::Wrap::clamp_to_edge,
                                                                  .wrap_v = gpu::Wrap::clamp_to_edge,
                                                                  .filter = gpu::Filter::nearest,
                                                                  .mip = gpu::Filter::nearest}));
  group.set(kSunMap, maps->sun_map(), sampler);
  group.set(kSpotMaps, maps->spot_maps(), sampler);
  TESSERA_RETURN_IF_ERROR(bind_grown(kLeading, leading, sizeof(LightingRecord)));
  TESSERA_RETURN_IF_ERROR(bind_grown(kGridLights, grid_lights, sizeof(LightRecord) * kMaxGridLights));
  TESSERA_RETURN_IF_ERROR(bind_grown(kCells, cells, sizeof(LightCell)));
  return bind_grown(kCellLights, cell_lights, sizeof(uint32_t));
}

Status Lighting::Impl::bind_grown(uint32_t binding, gpu::Buffer& buffer, uint64_t bytes) {
  TESSERA_ASSIGN_OR_RETURN(const bool is_new, grow(device, buffer, bytes, gpu::Memory::upload, "lighting"));
  if (is_new) group.set(binding, buffer);
  return absl::OkStatus();
}

bool Lighting::Impl::out_of_date(TimeNs time_ns) const {
  if (!drawn_at) return true;
  return scene.scene().features.rigid_animation && *drawn_at != time_ns;
}

// What depends on where lights and casters are in the world.
Status Lighting::Impl::refresh(const scene::SceneInstant& instant) {
  placed = place_lights(scene.scene(), plan, scene.scene().node_transforms(instant.time_ns()));
  if (plan.grid_lights() > 0) {
    grid = build_light_grid(std::span(placed).subspan(plan.first_grid_light()));
    TESSERA_RETURN_IF_ERROR(bind_grown(kCells, cells, grid.cells.size() * sizeof(LightCell)));
    TESSERA_RETURN_IF_ERROR(bind_grown(kCellLights, cell_lights, grid.lights.size() * sizeof(uint32_t)));
    write<LightCell>(cells, grid.cells);
    write<uint32_t>(cell_lights, grid.lights);
  }
  TESSERA_RETURN_IF_ERROR(maps->draw(instant, placed));
  drawn_at = instant.time_ns();
  return absl::OkStatus();
}

// What depends on the origin.
void Lighting::Impl::write_buffers(const dvec3& origin) {
  LightingRecord record{};
  record.ambient_sky = settings.ambient_sky;
  record.exposure = settings.exposure;
  record.ambient_ground = vec4(settings.ambient_ground, 0);
  record.grid_min = vec4(vec3(grid.min - origin), 0);
  record.grid_scale = vec4(grid.cells_per_m, 0);
  std::copy(std::begin(grid.size), std::end(grid.size), record.grid_size);
  record.outside_cell = grid.cells.empty() ? 0 : grid.outside_cell();
  std::vector<LightRecord> records;
  for (const PlacedLight& light : placed) records.push_back(light_record(light, origin));
  const auto first_grid_light = records.begin() + plan.first_grid_light();
  std::copy(records.begin(), first_grid_light, record.leading_lights);
  std::ranges::copy(maps->records(origin), record.shadows);
  write<LightingRecord>(leading, {&record, 1});
  write<LightRecord>(grid_lights, std::span(first_grid_light, records.end()));
}

Lighting::Lighting(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Lighting::~Lighting() = default;

StatusOr<std::unique_ptr<Lighting>> Lighting::create(gpu::Device& device, const scene::GpuScene& scene,
                                                     const LightingSettings& settings) {
  auto impl = std::unique_ptr<Impl>(new Impl{.device = device, .scene = scene, .settings = settings});
  TESSERA_RETURN_IF_ERROR(impl->create());
  return std::unique_ptr<Lighting>(new Lighting(std::move(impl)));
}

Status Lighting::update(const scene::SceneInstant& instant) {
  if (impl_->out_of_date(instant.time_ns())) TESSERA_RETURN_IF_ERROR(impl_->refresh(instant));
  impl_->write_buffers(instant.origin());
  return absl::OkStatus();
}

const gpu::BindLayout& Lighting::layout() const {
  return impl_->layout;
}
const gpu::BindGroup& Lighting::group() const {
  return impl_->group;
}
std::vector<gpu::Constant> Lighting::constants() const {
  return feature_constants(impl_->scene.scene().features, impl_->plan);
}
uint32_t Lighting::shadow_maps() const {
  return impl_->maps->count();
}

}  // namespace tessera::shading
