// The three-phase block allocator (thesis 3.4, algorithms 1-3, with the corrections of docs/method.md): superblocks of
// columns of blocks. Request frees and counts, provisioning draws superblocks a column width, assignment hands out blocks.
// In each phase blocks are either freed or allocated, never both, so that a GPU version can run it lock-free with the same
// arrays; this one runs on one CPU thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "atlas/placement.h"

namespace tessera::atlas::blocks {

// Position of a block: superblock index and the block's index within it, counted down the columns.
struct BlockAddress {
  uint32_t superblock = 0;
  uint32_t index = 0;
  bool operator==(const BlockAddress&) const = default;
};

// One patch's change of memory in a frame. Frees happen before any allocation.
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
  uint64_t capacity_texels = 0;  // of the whole atlas
};

class Allocator {
 public:
  // `superblock_log`: log2 of a superblock's side, 1..8. `superblocks`: how many there are.
  Allocator(uint8_t superblock_log, uint32_t superblocks);

  // Runs the three phases. out[i] = the block of requests[i], or nullopt-like kNoBlock if it does not allocate or memory
  // ran out. Equal inputs give equal outputs.
  void update(std::span<const Request> requests, std::span<BlockAddress> out);
  // Frees everything (atlas reset).
  void reset();
  AllocatorStats stats() const;

  // Top-left texel of a block inside its superblock.
  static uvec2 offset_in_superblock(const BlockAddress& block, Level level, uint8_t superblock_log);

  static constexpr BlockAddress kNoBlock{0xffffffffu, 0xffffffffu};

 private:
  struct Column {  // one a block width
    uint32_t carry_superblock = 0;
    int32_t carry_offset = 0;  // square blocks used in it
    std::vector<uint32_t> superblocks;
  };
  int32_t blocks_per_superblock(uint8_t log_w, uint8_t log_h) const;
  void request(std::span<const Request> requests);
  void provision(uint8_t log_w);
  void assign(std::span<const Request> requests, std::span<BlockAddress> out);

  uint8_t superblock_log_;
  uint32_t superblock_count_;
  std::vector<uint32_t> free_superblocks_;
  std::vector<std::vector<BlockAddress>> stacks_;  // a level
  std::vector<int32_t> requested_, slot_offset_, slot_count_;
  std::vector<uint32_t> slots_;
  std::vector<Column> columns_;
  uint64_t used_texels_ = 0;
};

}  // namespace tessera::atlas::blocks
