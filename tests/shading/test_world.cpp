#include "test_world.h"

#include <gmock/gmock.h>

#include <cstring>

namespace tessera::shading::test {
namespace {

std::shared_ptr<gpu::Device> shared_device;

class DeviceEnvironment : public testing::Environment {
 public:
  void TearDown() override {
    if (shared_device) {
      EXPECT_EQ(shared_device->validation_messages(), 0u);
    }
    shared_device.reset();
  }
};

[[maybe_unused]] const auto* const kEnvironment = testing::AddGlobalTestEnvironment(new DeviceEnvironment);

template <class T>
T value(StatusOr<T> result) {
  if (!result.ok()) throw std::runtime_error(std::string(result.status().message()));
  return *std::move(result);
}

void check(const Status& status) {
  if (!status.ok()) throw std::runtime_error(std::string(status.message()));
}

}  // namespace

gpu::Device& device() {
  if (!shared_device)
    shared_device =
        value(gpu::Device::create({.select = "cpu", .validation = true, .validate_synchronization = true}));
  return *shared_device;
}

World make_world(std::shared_ptr<const scene::Scene> scene, LightingSettings settings, const dvec3& origin) {
  settings.sun_shadow_side = std::min(settings.sun_shadow_side, 512u);
  settings.spot_shadow_side = std::min(settings.spot_shadow_side, 256u);
  World w{.scene = scene};
  w.gpu_scene = value(scene::GpuScene::create(device(), scene));
  w.instant = value(scene::SceneInstant::create(device(), *w.gpu_scene));
  w.instant->set(0, origin);
  w.lighting = value(Lighting::create(device(), *w.gpu_scene, settings));
  check(w.lighting->update(*w.instant));
  return w;
}

LightingSettings no_ambient() {
  LightingSettings s;
  s.ambient_sky = s.ambient_ground = vec3(0);
  return s;
}

View look(const dvec3& eye, const dvec3& target, uint32_t side) {
  View view{.fov = Fov::symmetric(0.9f, 1), .width = side, .height = side};
  view.pose.position = eye;
  const dvec3 d = glm::normalize(target - eye);
  view.pose.orientation = glm::quatLookAt(d, std::abs(d.y) < 0.99 ? dvec3(0, 1, 0) : dvec3(0, 0, -1));
  return view;
}

ReferenceImage render(const World& world, const View& view, const ReferenceRequest& request) {
  const auto renderer = value(ReferenceRenderer::create(device(), *world.gpu_scene, *world.lighting));
  return value(renderer->render(*world.instant, view, request));
}

atlas::Placement block(scene::PatchId patch, uint32_t x, uint32_t y, uint8_t log_w, uint8_t log_h,
                       bool transposed, bool masked) {
  return {.patch = patch,
          .kind = atlas::PlacementKind::block,
          .x = static_cast<uint16_t>(x),
          .y = static_cast<uint16_t>(y),
          .width = static_cast<uint16_t>(1u << log_w),
          .height = static_cast<uint16_t>(1u << log_h),
          .transposed = transposed,
          .masked = masked};
}

GatherResult gather(const World& world, const dvec3& eye, std::span<const atlas::Placement> placements,
                    const GatherSettings& settings) {
  const auto gather = value(Gather::create(device(), *world.gpu_scene, *world.lighting, settings));
  auto readback = value(gpu::Buffer::create(device(), uint64_t{4} * settings.width * settings.height,
                                            gpu::Memory::readback, "test atlas"));
  gpu::Commands commands = device().begin();
  // Pixels much finer than any texel: textures are filtered for the texels.
  View viewer{.fov = Fov::symmetric(0.5f, 1), .width = 1u << 20, .height = 1u << 20};
  viewer.pose.position = eye;
  check(gather->record(commands, *world.instant, viewer, placements));
  commands.copy_to_buffer(gather->image(), readback);
  commands.barrier();
  check(device().run(std::move(commands)));
  GatherResult result{Image8(settings.width, settings.height), {}, gather->stats()};
  std::memcpy(result.atlas.rgba.data(), readback.mapped(), result.atlas.rgba.size());
  result.colors.assign(gather->colors().begin(), gather->colors().end());
  return result;
}

}  // namespace tessera::shading::test
