// An atlas reset in stages (thesis 3.4 does it at once): a few superblocks a frame are emptied and their
// patches placed anew, most fragmented first. Moving everything in one frame would cost a key frame of video.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace tessera::atlas::blocks {

class StagedReset {
 public:
  explicit StagedReset(size_t superblocks) : due_(superblocks), emptied_(superblocks) {}

  // From now on every superblock in use is due, once.
  void start(std::span<const uint32_t> used_texels);
  void stop() { active_ = false; }
  bool active() const { return active_; }
  // Chooses the superblocks that this frame empties: together they hold at most `budget_texels`, or there is
  // only one. With none left the reset is over.
  void next_stage(std::span<const uint32_t> used_texels, std::span<const uint32_t> fragmented_texels,
                  uint64_t budget_texels);
  // Does this frame empty it?
  bool empties(uint32_t superblock) const { return active_ && emptied_[superblock]; }

 private:
  bool active_ = false;
  std::vector<uint8_t> due_, emptied_;  // a superblock
};

}  // namespace tessera::atlas::blocks
