// A tiny scene on the software device, lit and ready to draw.
#pragma once

#include <memory>

#include "base/image.h"
#include "base/view.h"
#include "shading/gather.h"
#include "shading/reference.h"

namespace tessera::shading::test {

// One device for all tests, with validation; the environment asserts that the layer stayed silent.
gpu::Device& device();

struct World {
  std::shared_ptr<const scene::Scene> scene;
  std::unique_ptr<scene::GpuScene> gpu_scene;
  std::unique_ptr<scene::SceneInstant> instant;
  std::unique_ptr<Lighting> lighting;
};

// Small shadow maps; set at time 0 relative to `origin`, lighting updated.
World make_world(std::shared_ptr<const scene::Scene> scene, LightingSettings settings = {},
                 const dvec3& origin = {});

// No light but the scene's own.
LightingSettings no_ambient();

// Looks from `eye` at `target`.
View look(const dvec3& eye, const dvec3& target, uint32_t side = 32);

ReferenceImage render(const World& world, const View& view, const ReferenceRequest& request = {});

// A block of 2^log_w x 2^log_h texels.
atlas::Placement block(scene::PatchId patch, uint32_t x, uint32_t y, uint8_t log_w, uint8_t log_h,
                       bool transposed = false, bool masked = false);

struct GatherResult {
  Image8 atlas;
  std::vector<uint32_t> colors;
  GatherStats stats;
};
GatherResult gather(const World& world, const dvec3& eye, std::span<const atlas::Placement> placements,
                    const GatherSettings& settings);

}  // namespace tessera::shading::test
