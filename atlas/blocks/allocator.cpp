#include "atlas/blocks/allocator.h"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace tessera::atlas::blocks {
namespace {

int32_t ceil_divide(int32_t value, int32_t by) {
  return (value + by - 1) / by;
}

}  // namespace

Allocator::Allocator(uint8_t superblock_log, uint32_t superblocks, Strategy strategy)
    : superblock_log_(superblock_log),
      strategy_(strategy),
      in_use_(superblocks),
      used_texels_(superblocks),
      inaccessible_(superblocks),
      levels_(level_index({superblock_log, superblock_log}) + 1) {
  assert(superblock_log >= kMinLog && superblock_log <= 8);
  for (uint8_t log_w = superblock_log; log_w >= kMinLog; --log_w) {
    if (strategy == Strategy::reference) {
      add_column(log_w, kMinLog, log_w);
    } else {
      for (uint8_t log_h = log_w; log_h >= kMinLog; --log_h) add_column(log_w, log_h, log_h);
    }
  }
  reset();
}

void Allocator::add_column(uint8_t log_w, uint8_t lowest, uint8_t highest) {
  for (uint8_t log_h = lowest; log_h <= highest; ++log_h) {
    at({log_w, log_h}).column = static_cast<uint32_t>(columns_.size());
  }
  columns_.push_back({.log_w = log_w, .lowest = lowest, .highest = highest});
}

Allocator::LevelState& Allocator::at(Level level) {
  assert(kMinLog <= level.log_h && level.log_h <= level.log_w && level.log_w <= superblock_log_);
  return levels_[level_index(level)];
}

void Allocator::reset() {
  free_superblocks_.resize(in_use_.size());
  std::iota(free_superblocks_.rbegin(), free_superblocks_.rend(), 0u);  // the lowest is drawn first
  std::fill(in_use_.begin(), in_use_.end(), uint8_t{0});
  std::fill(used_texels_.begin(), used_texels_.end(), 0u);
  std::fill(inaccessible_.begin(), inaccessible_.end(), 0u);
  for (LevelState& level : levels_) level.stack.clear();
  for (Column& column : columns_) {
    column.superblocks = {0};
    column.carry_offset = highest_per_superblock(column);
  }
}

void Allocator::update(std::span<const Request> requests, std::span<BlockAddress> out) {
  assert(requests.size() == out.size());
  request(requests);
  // Widest first: where memory runs out, it runs out for the blocks that a single colour replaces best.
  for (Column& column : columns_) provision(column);
  assign(requests, out);
}

// Thesis algorithm 1.
void Allocator::request(std::span<const Request> requests) {
  slots_.resize(requests.size());
  for (size_t i = 0; i < requests.size(); ++i) {
    const Request& r = requests[i];
    if (r.frees) {
      assert(in_use_[r.old_block.superblock]);
      used_texels_[r.old_block.superblock] -= texel_count(r.old_level);
      if (strategy_ < Strategy::no_stacks) {
        at(r.old_level).stack.push_back(r.old_block);
      } else {
        inaccessible_[r.old_block.superblock] += texel_count(r.old_level);
      }
    }
    if (r.allocates) slots_[i] = at(r.level).requested++;
  }
}

// Thesis algorithm 2, lines 2-13. Space is counted in lines: one texel high, as wide as the column.
void Allocator::draw_superblocks(Column& column) {
  int32_t lines = (column.carry_offset - highest_per_superblock(column)) * (1 << column.highest);
  for (uint8_t log_h = column.lowest; log_h <= column.highest; ++log_h) {
    const LevelState& level = at({column.log_w, log_h});
    // Printed as an assignment in line 4; it is a sum.
    lines += std::max(0, level.requested - static_cast<int32_t>(level.stack.size())) * (1 << log_h);
  }
  column.superblocks.erase(column.superblocks.begin(), column.superblocks.end() - 1);
  for (int32_t i = ceil_divide(lines, blocks_per_superblock({column.log_w, 0}));
       i > 0 && !free_superblocks_.empty(); --i) {
    column.superblocks.push_back(free_superblocks_.back());
    in_use_[free_superblocks_.back()] = 1;
    free_superblocks_.pop_back();
  }
}

// Thesis algorithm 2, lines 14-29.
void Allocator::provision(Column& column) {
  draw_superblocks(column);
  const auto superblocks = static_cast<int32_t>(column.superblocks.size());
  const int32_t highest = highest_per_superblock(column);
  int32_t offset = column.carry_offset;
  int32_t available = superblocks * highest - offset;
  // From high to low, so that no block straddles two columns.
  for (uint8_t log_h = column.highest;; --log_h) {
    LevelState& level = at({column.log_w, log_h});
    const int32_t missing = level.requested - static_cast<int32_t>(level.stack.size());
    level.slot_offset = offset;
    level.slot_count = std::clamp(missing, 0, available);
    level.requested = 0;
    offset += level.slot_count;
    available -= level.slot_count;
    if (log_h == column.lowest) break;
    offset *= 2;
    available *= 2;
  }
  // What is left beside the last square goes to the stacks, so that the next frame starts with a square. The
  // printed loop leaves out the last halving.
  for (uint8_t log_h = column.lowest; log_h < column.highest; ++log_h) {
    if (offset % 2 == 1) {
      const int32_t index = offset % blocks_per_superblock({column.log_w, log_h});
      at({column.log_w, log_h}).stack.push_back({column.superblocks.back(), static_cast<uint32_t>(index)});
    }
    offset = ceil_divide(offset, 2);
  }
  // Relative to the superblock that is carried over; printed without the subtraction (line 28).
  column.carry_offset = offset - (superblocks - 1) * highest;
}

// Thesis algorithm 3.
void Allocator::assign(std::span<const Request> requests, std::span<BlockAddress> out) {
  for (size_t i = 0; i < requests.size(); ++i) {
    out[i] = kNoBlock;
    const Request& r = requests[i];
    if (!r.allocates) continue;
    LevelState& level = at(r.level);
    if (slots_[i] < level.slot_count) {
      const int32_t slot = slots_[i] + level.slot_offset;
      const int32_t per_superblock = blocks_per_superblock(r.level);
      out[i] = {columns_[level.column].superblocks[static_cast<size_t>(slot / per_superblock)],
                static_cast<uint32_t>(slot % per_superblock)};
    } else if (!level.stack.empty()) {
      out[i] = level.stack.back();
      level.stack.pop_back();
    }
    if (out[i] != kNoBlock) used_texels_[out[i].superblock] += texel_count(r.level);
  }
}

uint32_t Allocator::recycle() {
  const auto is_empty = [this](uint32_t superblock) {
    return in_use_[superblock] && used_texels_[superblock] == 0;
  };
  const size_t free_before = free_superblocks_.size();
  for (uint32_t i = 0; i < in_use_.size(); ++i) {
    if (is_empty(i)) free_superblocks_.push_back(i);
  }
  if (free_superblocks_.size() == free_before) return 0;
  for (LevelState& level : levels_) {
    std::erase_if(level.stack, [&](const BlockAddress& block) { return is_empty(block.superblock); });
  }
  for (Column& column : columns_) {
    if (is_empty(column.superblocks.back())) column.carry_offset = highest_per_superblock(column);
  }
  for (size_t i = free_before; i < free_superblocks_.size(); ++i) {
    in_use_[free_superblocks_[i]] = 0;
    inaccessible_[free_superblocks_[i]] = 0;
  }
  const auto recycled = static_cast<uint32_t>(free_superblocks_.size() - free_before);
  std::sort(free_superblocks_.begin(), free_superblocks_.end(), std::greater<>());
  return recycled;
}

template <typename Visit>
void Allocator::for_each_level(Visit visit) const {
  for (uint8_t log_w = kMinLog; log_w <= superblock_log_; ++log_w) {
    for (uint8_t log_h = kMinLog; log_h <= log_w; ++log_h) {
      const Level level{log_w, log_h};
      visit(texel_count(level), levels_[level_index(level)].stack);
    }
  }
}

std::vector<uint32_t> Allocator::fragmented_texels() const {
  std::vector<uint32_t> texels = inaccessible_;
  for_each_level([&](uint32_t block_texels, const std::vector<BlockAddress>& stack) {
    for (const BlockAddress& block : stack) texels[block.superblock] += block_texels;
  });
  return texels;
}

AllocatorStats Allocator::stats() const {
  AllocatorStats stats;
  stats.free_superblocks = static_cast<uint32_t>(free_superblocks_.size());
  stats.used_texels = std::accumulate(used_texels_.begin(), used_texels_.end(), uint64_t{0});
  for_each_level([&](uint32_t block_texels, const std::vector<BlockAddress>& stack) {
    stats.stack_texels += uint64_t{block_texels} * stack.size();
  });
  for (const Column& column : columns_) {
    const int32_t blocks = highest_per_superblock(column) - column.carry_offset;
    stats.carry_texels +=
        uint64_t{texel_count({column.log_w, column.highest})} * static_cast<uint32_t>(blocks);
  }
  stats.inaccessible_texels = std::accumulate(inaccessible_.begin(), inaccessible_.end(), uint64_t{0});
  stats.free_texels = uint64_t{stats.free_superblocks} << (2 * superblock_log_);
  stats.capacity_texels = uint64_t{in_use_.size()} << (2 * superblock_log_);
  return stats;
}

AllocatorState Allocator::state() const {
  AllocatorState state{.free_superblocks = free_superblocks_, .used_texels = used_texels_};
  for (const LevelState& level : levels_) state.stacks.push_back(level.stack);
  for (const Column& column : columns_) {
    state.carries.push_back({column.superblocks.back(), column.carry_offset});
  }
  return state;
}

uvec2 Allocator::offset_in_superblock(const BlockAddress& block, Level level, uint8_t superblock_log) {
  const int rows_log = superblock_log - level.log_h;  // blocks in a column
  const uint32_t column = block.index >> rows_log, row = block.index & ((1u << rows_log) - 1);
  return {column << level.log_w, row << level.log_h};
}

uint32_t Allocator::index_in_superblock(uvec2 offset, Level level, uint8_t superblock_log) {
  return ((offset.x >> level.log_w) << (superblock_log - level.log_h)) + (offset.y >> level.log_h);
}

}  // namespace tessera::atlas::blocks
