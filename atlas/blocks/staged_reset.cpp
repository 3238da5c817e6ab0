#include "atlas/blocks/staged_reset.h"

#include <algorithm>

namespace tessera::atlas::blocks {

void StagedReset::start(std::span<const uint32_t> used_texels) {
  std::transform(used_texels.begin(), used_texels.end(), due_.begin(),
                 [](uint32_t texels) { return texels > 0; });
  active_ = true;
}

void StagedReset::next_stage(std::span<const uint32_t> used_texels,
                             std::span<const uint32_t> fragmented_texels, uint64_t budget_texels) {
  std::vector<uint32_t> candidates;
  for (uint32_t i = 0; i < due_.size(); ++i) {
    if (due_[i] && used_texels[i] > 0) candidates.push_back(i);
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [&](uint32_t a, uint32_t b) { return fragmented_texels[a] > fragmented_texels[b]; });
  std::fill(emptied_.begin(), emptied_.end(), uint8_t{0});
  uint64_t moved_texels = 0;
  for (const uint32_t superblock : candidates) {
    if (moved_texels > 0 && moved_texels + used_texels[superblock] > budget_texels) break;
    moved_texels += used_texels[superblock];
    emptied_[superblock] = 1;
    due_[superblock] = 0;
  }
  active_ = moved_texels > 0;
}

}  // namespace tessera::atlas::blocks
