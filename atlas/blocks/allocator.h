// The three-phase block allocator (thesis 3.4, algorithms 1-3, with the corrections of docs/method.md):
// superblocks of columns of blocks. Request frees and counts, provisioning draws superblocks a column width,
// assignment hands out blocks. In each phase blocks are either freed or allocated, never both, so that a GPU
// version can run it lock-free with the same arrays; this one runs on one CPU thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "atlas/level_selection.h"

namespace tessera::atlas::blocks {

// Position of a block: superblock index and the block's index within it, counted down the columns.
struct BlockAddress {
  uint32_t superblock = 0;
  uint32_t index = 0;
  bool operator==(const BlockAddress&) const = default;
};

// One patch's change of memory in a frame. Frees happen before any allocation. Of one level, earlier requests
// are served first.
struct Request {
  bool frees = false;
  Level old_level;
  BlockAddress old_block;
  bool allocates = false;
  Level level;
};

struct AllocatorStats {
  uint32_t free_superblocks = 0;
  uint64_t used_texels = 0;      // in assigned blocks
  uint64_t stack_texels = 0;     // free, but only for blocks of the same level
  uint64_t carry_texels = 0;     // free in the superblocks that columns carry over, for blocks of their width
  uint64_t capacity_texels = 0;  // of the whole atlas: the sum of the above and of the free superblocks
};

class Allocator {
 public:
  // `superblock_log`: log2 of a superblock's side, 1..8. `superblocks`: how many there are.
  Allocator(uint8_t superblock_log, uint32_t superblocks);

  // Runs the three phases. out[i] = the block of requests[i], or nullopt-like kNoBlock if it does not
  // allocate or memory ran out. Equal inputs give equal outputs.
  void update(std::span<const Request> requests, std::span<BlockAddress> out);
  // Returns every superblock that holds no assigned block to the free ones, for blocks of any level; gives
  // their number. Call it between updates: after one that only frees, it is what makes a staged atlas reset
  // possible.
  uint32_t recycle();
  // Frees everything (atlas reset).
  void reset();
  AllocatorStats stats() const;
  // Texels in assigned blocks, a superblock.
  std::span<const uint32_t> used_texels() const { return used_texels_; }
  // Texels on the stacks, a superblock: what emptying it would win.
  std::vector<uint32_t> fragmented_texels() const;

  // Top-left texel of a block inside its superblock, and back.
  static uvec2 offset_in_superblock(const BlockAddress& block, Level level, uint8_t superblock_log);
  static uint32_t index_in_superblock(uvec2 offset, Level level, uint8_t superblock_log);

  static constexpr BlockAddress kNoBlock{0xffffffffu, 0xffffffffu};

 private:
  // The superblocks that a column width allocates from in this frame (`sb` in algorithm 2). The first is
  // carried over from the frame before, with `carry_offset` square blocks of it already taken.
  struct Column {
    std::vector<uint32_t> superblocks;
    int32_t carry_offset = 0;
  };
  // Per level, indexed by level_index().
  struct LevelState {
    std::vector<BlockAddress> stack;  // free blocks
    int32_t requested = 0;
    int32_t slot_offset = 0,
            slot_count = 0;  // requests below slot_count are served from the column's superblocks
  };

  int32_t blocks_per_superblock(Level level) const {
    return 1 << (2 * superblock_log_ - level.log_w - level.log_h);
  }
  LevelState& at(Level level);
  static uint32_t texel_count(Level level) { return 1u << (level.log_w + level.log_h); }
  // visit(texels of a block, its stack)
  template <typename Visit>
  void for_each_level(Visit visit) const;
  void request(std::span<const Request> requests);
  void provision(uint8_t log_w);
  void draw_superblocks(uint8_t log_w);
  void assign(std::span<const Request> requests, std::span<BlockAddress> out);

  uint8_t superblock_log_;
  std::vector<uint32_t> free_superblocks_;  // a stack
  std::vector<uint8_t> in_use_;             // a superblock: not in free_superblocks_
  std::vector<uint32_t> used_texels_;       // a superblock
  std::vector<LevelState> levels_;
  std::vector<Column> columns_;  // by log2 of the width
  std::vector<int32_t> slots_;   // a request
};

}  // namespace tessera::atlas::blocks
