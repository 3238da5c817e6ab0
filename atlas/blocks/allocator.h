// The three-phase block allocator (thesis 3.4, algorithms 1-3; allocator.cpp says where they are corrected):
// superblocks of columns of blocks. Request frees and counts, provisioning draws superblocks a column width,
// assignment hands out blocks. In each phase blocks are either freed or allocated, never both, so that
// gpu_allocator.h can run it lock-free with the same arrays; this one runs on one CPU thread.
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

// The strategies that thesis 3.6.3 compares; each lacks what the one before it lacks, and one part more.
enum class Strategy : uint8_t {
  reference,   // S0
  no_columns,  // S1: a superblock holds blocks of one level alone
  no_stacks,   // S2: a freed block is out of reach until recycle() finds its superblock empty
  no_resets,   // S3: the layout never resets the atlas; to the allocator the same as S2
};

// Where the atlas's texels are (thesis fig. 3.9).
struct AllocatorStats {
  uint32_t free_superblocks = 0;
  uint64_t used_texels = 0;   // in assigned blocks
  uint64_t stack_texels = 0;  // free, but only for blocks of the same level
  // Free at the end of the superblocks that are carried over, for blocks of their column width (level without
  // columns).
  uint64_t carry_texels = 0;
  uint64_t inaccessible_texels = 0;  // freed, but out of reach: only without stacks
  uint64_t free_texels = 0;          // in free superblocks
  uint64_t capacity_texels = 0;      // of the whole atlas: the sum of the above
};

// All that an allocator knows, to compare two of them.
struct AllocatorState {
  // What is carried over, in the allocator's order.
  struct Carry {
    uint32_t superblock = 0;
    int32_t offset = 0;
    bool operator==(const Carry&) const = default;
  };
  std::vector<uint32_t> free_superblocks;         // the last is drawn first
  std::vector<uint32_t> used_texels;              // a superblock
  std::vector<std::vector<BlockAddress>> stacks;  // by level_index()
  std::vector<Carry> carries;                     // widest first
  bool operator==(const AllocatorState&) const = default;
};

// Levels with log_h <= log_w, counted row by row.
constexpr uint32_t level_index(Level level) {
  return uint32_t{level.log_w} * (level.log_w + 1u) / 2 + level.log_h;
}

class Allocator {
 public:
  // `superblock_log`: log2 of a superblock's side, 1..8. `superblocks`: how many there are.
  Allocator(uint8_t superblock_log, uint32_t superblocks, Strategy strategy = Strategy::reference);

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
  // Texels on the stacks and out of reach, a superblock: what emptying it would win.
  std::vector<uint32_t> fragmented_texels() const;
  AllocatorState state() const;

  // Top-left texel of a block inside its superblock, and back.
  static uvec2 offset_in_superblock(const BlockAddress& block, Level level, uint8_t superblock_log);
  static uint32_t index_in_superblock(uvec2 offset, Level level, uint8_t superblock_log);

  static constexpr BlockAddress kNoBlock{0xffffffffu, 0xffffffffu};

 private:
  // The superblocks that a column width (level without columns) allocates from in this frame (`sb` in
  // algorithm 2). The first is carried over from the frame before, with `carry_offset` of its highest blocks
  // already taken.
  struct Column {
    uint8_t log_w = 0, lowest = 0, highest = 0;  // its levels' width and heights
    std::vector<uint32_t> superblocks;
    int32_t carry_offset = 0;
  };
  // Per level, indexed by level_index().
  struct LevelState {
    std::vector<BlockAddress> stack;  // free blocks
    int32_t requested = 0;
    int32_t slot_offset = 0,
            slot_count = 0;  // requests below slot_count are served from the column's superblocks
    uint32_t column = 0;     // in columns_
  };

  int32_t blocks_per_superblock(Level level) const {
    return 1 << (2 * superblock_log_ - level.log_w - level.log_h);
  }
  LevelState& at(Level level);
  static uint32_t texel_count(Level level) { return 1u << (level.log_w + level.log_h); }
  // visit(texels of a block, its stack)
  template <typename Visit>
  void for_each_level(Visit visit) const;
  void add_column(uint8_t log_w, uint8_t lowest, uint8_t highest);
  int32_t highest_per_superblock(const Column& column) const {
    return blocks_per_superblock({column.log_w, column.highest});
  }
  void request(std::span<const Request> requests);
  void provision(Column& column);
  void draw_superblocks(Column& column);
  void assign(std::span<const Request> requests, std::span<BlockAddress> out);

  uint8_t superblock_log_;
  Strategy strategy_;
  std::vector<uint32_t> free_superblocks_;  // a stack
  std::vector<uint8_t> in_use_;             // a superblock: not in free_superblocks_
  std::vector<uint32_t> used_texels_;       // a superblock
  std::vector<uint32_t> inaccessible_;      // a superblock: texels
  std::vector<LevelState> levels_;
  std::vector<Column> columns_;  // widest first
  std::vector<int32_t> slots_;   // a request
};

}  // namespace tessera::atlas::blocks
