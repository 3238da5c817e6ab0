// A frame's placements as the gather shaders want them: sorted by material, cut into chunks.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "atlas/placement.h"
#include "base/status.h"
#include "scene/gpu_scene.h"
#include "shading/gather_choice.h"

namespace tessera::shading {

// Block in shading/shaders/gather.glsl: a block, an L (or two, if masked), a half, or a single colour.
struct BlockRecord {
  uint32_t instance;
  uint32_t first_triangle;  // of the patch, or the one that it is for, in GpuScene::indices() / 3
  uint32_t place;           // x | y << 16 in texels, of an L its pair's; or the slot of a single colour
  // Block: width | height << 16 in texels; 1 x 1 for a single colour.
  // L:     level (7) | splits (5) | number of the sub-triangle (10)
  // Half:  across (8) | along (11) | foot (6) | apex (2) | which half (1)
  uint32_t size;
  uint32_t shape;         // triangle count, 1 of an L and a half | flags
  uint32_t spacing;       // codes of corners 1..4, least significant byte first (atlas::Placement)
  uint32_t first_sample;  // compute path: of all; tessellation path: of its part of a half
};
static_assert(sizeof(BlockRecord) == 28);
constexpr uint32_t kBlockTransposed = 1u << 2, kBlockMasked = 1u << 3, kBlockColor = 1u << 4,
                   kBlockL = 1u << 5, kBlockHalf = 1u << 6, kBlockTurned = 1u << 7;

constexpr uint32_t kChunkSamples = 64;  // local size of gather.comp

// Work of one material: one draw (raster), some (tessellation) or one dispatch (compute).
struct DrawBatch {
  uint32_t material, first_block, block_count;
};
struct ComputeBatch {
  uint32_t material, first_chunk, end_chunk;
};

struct GatherWork {
  // Compute blocks, a sentinel that no sample reaches, raster blocks, then those to tessellate: a masked L
  // twice (for its coverage with kBlockTurned), a half in parts of oversampling_part() samples.
  std::vector<BlockRecord> blocks;
  std::vector<uint32_t> starts;  // by chunk of kChunkSamples samples of one material: its first block
  std::vector<ComputeBatch> compute_batches;
  std::vector<DrawBatch> raster_batches;
  std::vector<DrawBatch> tessellation_batches;          // each at most kMaxPointsADraw points
  uint64_t samples = 0;                                 // without padding, as Placement::texels()
  uint64_t half_samples = 0, half_samples_outside = 0;  // of halves; outside their triangles
  uint32_t colors = 0, compute_blocks = 0, raster_blocks = 0, tessellated_blocks = 0;
};

struct GatherLimits {
  uint32_t width, height;  // of the atlas
  GatherChoice choice;
};

// InvalidArgument if a placement names no patch of the scene or leaves the atlas.
StatusOr<GatherWork> build_gather_work(const scene::GpuScene& scene,
                                       std::span<const atlas::Placement> placements,
                                       const GatherLimits& limits);

}  // namespace tessera::shading
