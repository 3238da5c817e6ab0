// Whether a device's tessellator makes the samples that the gather's tessellation path counts on: Vulkan
// fixes how many points it makes of a triangle, but gl_TessCoord only roughly.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/status.h"
#include "gpu/device.h"

namespace tessera::shading {

// Points of one draw, at most: see gpu::Commands::bind(const gpu::TessellationPipeline&, ...).
constexpr uint32_t kMaxPointsADraw = 32'000;

// A triangle for the tessellator.
struct Trial {
  int level = 0;    // 1..64: all its levels, each point marks its texels of the L (L-packing)
  int samples = 0;  // else 3..3169: levels for so many points, each marks its number (Oversampling)
};

struct TrialMarks {
  uint32_t evaluations = 0;  // of the evaluation shader
  uint32_t elsewhere = 0;    // marks that have no place below
  std::vector<uint32_t>
      places;  // marks by texel of the L's square of (level + 1)^2, row by row; or by number
};

// Blocks. FailedPrecondition where the device has no tessellation shaders that store, InvalidArgument for a
// trial out of range.
StatusOr<std::vector<TrialMarks>> run_tessellator(gpu::Device& device, std::span<const Trial> trials);

// Every texel of the L, or every number, is marked and nothing else is. How often does not matter: the gather
// stores the same again.
bool fits(const Trial& trial, const TrialMarks& marks);

// OK if all levels and a choice of numbers of samples fit, else FailedPrecondition. Blocks: some 0.1 s on the
// software device, with the pipeline that it makes.
Status check_tessellator(gpu::Device& device);

}  // namespace tessera::shading
