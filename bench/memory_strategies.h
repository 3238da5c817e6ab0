// Where the atlas's texels are while a session follows a recorded path, under each strategy of thesis 3.6.3
// (fig. 3.9).
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "atlas/blocks/allocator.h"
#include "base/status.h"
#include "bench/progress.h"
#include "bench/settings.h"
#include "gpu/device.h"

namespace tessera::bench {

// Means over the frames. The shares of the atlas sum to 1.
struct StrategyRow {
  atlas::blocks::Strategy strategy{};
  uint32_t frames = 0;
  double used = 0;                        // in blocks
  double carried = 0;                     // at the end of superblocks that are partly filled
  double stacks = 0;                      // in blocks on the block stacks
  double inaccessible = 0;                // until the whole superblock is free
  double free = 0;                        // in free superblocks
  uint32_t out_of_memory_frames = 0;      // with a patch that found no block
  double out_of_memory_patches = 0;       // a frame
  uint32_t halved_frames = 0;             // with a patch that took a smaller block instead
  double halved_patches = 0;              // a frame
  uint32_t resets = 0, reset_frames = 0;  // started; in which a stage of one moved patches
  double bias = 0, blocks = 0, colors = 0;
};

std::string_view name_of(atlas::blocks::Strategy strategy);  // "S0" to "S3"

// The visible sets are those of a session without loss: path_views(), and patches that left stay as there
// (pvs/retention.h). All strategies get the same ones.
StatusOr<std::vector<StrategyRow>> compare_strategies(gpu::Device& device, const LoopbackSettings& settings,
                                                      uint32_t frames, Progress& progress);

}  // namespace tessera::bench
