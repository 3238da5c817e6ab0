#include "atlas/blocks/allocator.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "occupancy.h"
#include "random_level.h"

namespace tessera::atlas::blocks {
namespace {

struct Owner {
  Level level;
  BlockAddress block = Allocator::kNoBlock;
};

// Drives an allocator and knows who owns what. Its superblocks lie below each other.
class Model {
 public:
  Model(uint8_t superblock_log, uint32_t superblocks, size_t patches, Strategy strategy = Strategy::reference)
      : superblock_log_(superblock_log),
        superblocks_(superblocks),
        allocator(superblock_log, superblocks, strategy),
        owners(patches) {}

  // Sets the wish of a patch for the next step(); nullopt = leaves.
  void wish(size_t patch, std::optional<Level> level) {
    Request r;
    Owner& owner = owners[patch];
    if (owner.block != Allocator::kNoBlock) {
      r.frees = true;
      r.old_level = owner.level;
      r.old_block = owner.block;
    }
    owner.block = Allocator::kNoBlock;
    if (level) {
      r.allocates = true;
      r.level = owner.level = *level;
    }
    if (!r.frees && !r.allocates) return;
    requests_.push_back(r);
    patches_.push_back(patch);
  }

  // Runs the wishes; returns how many found no memory.
  uint32_t step() {
    std::vector<BlockAddress> blocks(requests_.size());
    allocator.update(requests_, blocks);
    uint32_t failed = 0;
    for (size_t i = 0; i < blocks.size(); ++i) {
      EXPECT_TRUE(requests_[i].allocates || blocks[i] == Allocator::kNoBlock);
      owners[patches_[i]].block = blocks[i];
      failed += requests_[i].allocates && blocks[i] == Allocator::kNoBlock;
    }
    requests_.clear();
    patches_.clear();
    return failed;
  }

  void leave_all() {
    for (size_t i = 0; i < owners.size(); ++i) wish(i, std::nullopt);
    EXPECT_EQ(step(), 0u);
  }

  // No overlap, and every texel is accounted for.
  void check() const {
    const uint32_t side = 1u << superblock_log_;
    Occupancy occupancy(side, side * superblocks_);
    for (const Owner& owner : owners) {
      if (owner.block == Allocator::kNoBlock) continue;
      const uvec2 offset = Allocator::offset_in_superblock(owner.block, owner.level, superblock_log_);
      ASSERT_EQ(Allocator::index_in_superblock(offset, owner.level, superblock_log_), owner.block.index);
      ASSERT_LE(offset.y + (1u << owner.level.log_h), side);
      ASSERT_TRUE(occupancy.take(offset.x, owner.block.superblock * side + offset.y, 1u << owner.level.log_w,
                                 1u << owner.level.log_h));
    }
    const AllocatorStats s = allocator.stats();
    ASSERT_EQ(s.used_texels, occupancy.texels());
    ASSERT_EQ(s.capacity_texels, uint64_t{side} * side * superblocks_);
    ASSERT_EQ(s.free_texels, uint64_t{s.free_superblocks} * side * side);
    ASSERT_EQ(s.used_texels + s.stack_texels + s.carry_texels + s.inaccessible_texels + s.free_texels,
              s.capacity_texels);
    const std::vector<uint32_t> fragmented = allocator.fragmented_texels();
    ASSERT_EQ(std::accumulate(fragmented.begin(), fragmented.end(), uint64_t{0}),
              s.stack_texels + s.inaccessible_texels);
  }

 private:
  uint8_t superblock_log_;
  uint32_t superblocks_;
  std::vector<Request> requests_;
  std::vector<size_t> patches_;

 public:
  Allocator allocator;
  std::vector<Owner> owners;
};

Model filled(uint8_t superblock_log, uint32_t superblocks, Level level, size_t patches) {
  Model model(superblock_log, superblocks, patches);
  for (size_t i = 0; i < patches; ++i) model.wish(i, level);
  EXPECT_EQ(model.step(), 0u);
  return model;
}

class AllocatorStrategies : public testing::TestWithParam<Strategy> {};
INSTANTIATE_TEST_SUITE_P(All, AllocatorStrategies,
                         testing::Values(Strategy::reference, Strategy::no_columns, Strategy::no_stacks,
                                         Strategy::no_resets));

TEST_P(AllocatorStrategies, LongRandomRunsNeverOverlapOrLeak) {
  for (uint32_t seed = 0; seed < 6; ++seed) {
    std::mt19937 random(seed);
    const uint8_t log = seed % 2 ? 5 : 6;
    Model model(log, seed % 2 ? 64 : 20, 3000, GetParam());
    const uint32_t churn_percent = 2 + 8 * seed;
    uint64_t failed = 0;
    for (int frame = 0; frame < 250; ++frame) {
      // The load swings, so that memory is now plentiful, now short.
      const uint32_t load_percent = 50 + frame / 25 * 37 % 50;
      for (size_t i = 0; i < model.owners.size(); ++i) {
        if (random() % 100 >= churn_percent) continue;
        const bool stays = random() % 100 < load_percent;
        model.wish(i, stays ? std::optional(random_level(random, log)) : std::nullopt);
      }
      failed += model.step();
      if (frame % 3 == 0) model.allocator.recycle();
      ASSERT_NO_FATAL_FAILURE(model.check()) << "seed " << seed << ", frame " << frame;
    }
    EXPECT_GT(failed, 0u) << "this run should also meet exhausted memory";
    model.leave_all();
    model.allocator.recycle();
    ASSERT_NO_FATAL_FAILURE(model.check());
    EXPECT_EQ(model.allocator.stats().used_texels, 0u);
    EXPECT_EQ(model.allocator.stats().free_superblocks, seed % 2 ? 64u : 20u);
  }
}

TEST(Allocator, WithoutColumnsEachLevelTakesASuperblockOfItsOwn) {
  for (const auto& [strategy, drawn] : {std::pair{Strategy::reference, 1u}, {Strategy::no_columns, 4u}}) {
    Model model(6, 8, 4, strategy);
    for (uint8_t i = 0; i < 4; ++i) model.wish(i, Level{4, static_cast<uint8_t>(i + 1)});
    EXPECT_EQ(model.step(), 0u);
    ASSERT_NO_FATAL_FAILURE(model.check());
    EXPECT_EQ(model.allocator.stats().free_superblocks, 8 - drawn);
  }
}

TEST(Allocator, WithoutStacksAFreedBlockWaitsForItsWholeSuperblock) {
  Model model(4, 1, 64, Strategy::no_stacks);
  for (size_t i = 0; i < 64; ++i) model.wish(i, Level{1, 1});
  EXPECT_EQ(model.step(), 0u);
  model.wish(0, std::nullopt);
  EXPECT_EQ(model.step(), 0u);
  EXPECT_EQ(model.allocator.stats().inaccessible_texels, 4u);
  EXPECT_EQ(model.allocator.stats().stack_texels, 0u);
  EXPECT_EQ(model.allocator.recycle(), 0u);
  model.wish(0, Level{1, 1});
  EXPECT_EQ(model.step(), 1u);
  model.leave_all();
  EXPECT_EQ(model.allocator.stats().inaccessible_texels, 256u);
  EXPECT_EQ(model.allocator.recycle(), 1u);
  EXPECT_EQ(model.allocator.stats().free_texels, 256u);
  model.wish(0, Level{1, 1});
  EXPECT_EQ(model.step(), 0u);
  ASSERT_NO_FATAL_FAILURE(model.check());
}

TEST(Allocator, EqualInputsGiveEqualOutputs) {
  const auto run = [] {
    std::mt19937 random(7);
    Model model(6, 16, 800);
    for (int frame = 0; frame < 40; ++frame) {
      for (size_t i = 0; i < model.owners.size(); ++i) {
        if (random() % 5 == 0) model.wish(i, random_level(random, 6));
      }
      model.step();
    }
    return model.owners;
  };
  const auto a = run(), b = run();
  for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].block, b[i].block);
}

// Every level of every superblock size fills the atlas to its last texel, and the next block finds none.
TEST(Allocator, AllBlocksOfOneLevelFillTheAtlasExactly) {
  for (uint8_t log = 1; log <= 8; ++log) {
    const uint32_t superblocks = log > 6 ? 2 : 5;
    for (uint8_t w = kMinLog; w <= log; ++w) {
      for (uint8_t h = kMinLog; h <= w; ++h) {
        const Level level{w, h};
        const size_t count = (size_t{superblocks} << (2 * log)) >> (w + h);
        Model model = filled(log, superblocks, level, count);
        ASSERT_NO_FATAL_FAILURE(model.check());
        EXPECT_EQ(model.allocator.stats().used_texels, model.allocator.stats().capacity_texels);
        model.owners.emplace_back();
        model.wish(count, level);
        EXPECT_EQ(model.step(), 1u);
        // One leaves: its place, and only its, serves the next.
        const BlockAddress place = model.owners[count / 2].block;
        model.wish(count / 2, std::nullopt);
        model.wish(count, level);
        EXPECT_EQ(model.step(), 0u);
        EXPECT_EQ(model.owners[count].block, place);
      }
    }
  }
}

TEST(Allocator, OneFreeBlockServesItsLevelAlone) {
  Model model = filled(4, 1, {1, 1}, 64);
  model.wish(0, std::nullopt);
  EXPECT_EQ(model.step(), 0u);
  for (const Level level : {Level{2, 1}, Level{2, 2}, Level{4, 4}}) {
    model.wish(0, level);
    EXPECT_EQ(model.step(), 1u);
  }
  model.wish(0, Level{1, 1});
  EXPECT_EQ(model.step(), 0u);
  ASSERT_NO_FATAL_FAILURE(model.check());
}

TEST(Allocator, LargestBlockTakesAWholeSuperblock) {
  for (uint8_t log = 1; log <= 8; ++log) {
    Model model = filled(log, 1, {log, log}, 1);
    EXPECT_EQ(model.owners[0].block, (BlockAddress{0, 0}));
    EXPECT_EQ(model.allocator.stats().used_texels, model.allocator.stats().capacity_texels);
  }
}

// The example of thesis fig. 3.6 in its structure: one superblock is topped up over frames before another is
// drawn.
TEST(Allocator, CarriedSuperblockIsToppedUp) {
  Model model(6, 4, 64);
  for (size_t i = 0; i < 16; ++i) {
    model.wish(i, Level{4, 4});
    EXPECT_EQ(model.step(), 0u);
    EXPECT_EQ(model.allocator.stats().free_superblocks, 3u);
  }
  model.wish(16, Level{4, 4});
  EXPECT_EQ(model.step(), 0u);
  EXPECT_EQ(model.allocator.stats().free_superblocks, 2u);
}

TEST(Allocator, HeightsOfOneWidthShareASuperblock) {
  Model model(6, 4, 64);
  for (size_t i = 0; i < 21; ++i) model.wish(i, Level{4, static_cast<uint8_t>(1 + i % 4)});
  EXPECT_EQ(model.step(), 0u);
  ASSERT_NO_FATAL_FAILURE(model.check());
  EXPECT_EQ(model.allocator.stats().free_superblocks, 3u);
  // 152 lines, 16 wide: the rest of the last 16x16 square is on the stacks.
  const AllocatorStats stats = model.allocator.stats();
  EXPECT_EQ(stats.used_texels, 16u * (6 * 2 + 5 * 4 + 5 * 8 + 5 * 16));
  EXPECT_EQ(stats.used_texels + stats.stack_texels, 16u * 160);
}

TEST(Allocator, OutOfMemoryFailsTheLastRequestsAndHeals) {
  Model model(5, 2, 100);
  for (size_t i = 0; i < 100; ++i) model.wish(i, Level{3, 2});
  EXPECT_EQ(model.step(), 100u - 64u);
  ASSERT_NO_FATAL_FAILURE(model.check());
  for (size_t i = 0; i < 100; ++i) EXPECT_EQ(model.owners[i].block == Allocator::kNoBlock, i >= 64) << i;
  for (size_t i = 0; i < 36; ++i) model.wish(i, std::nullopt);
  for (size_t i = 64; i < 100; ++i) model.wish(i, Level{3, 2});
  EXPECT_EQ(model.step(), 0u);
  ASSERT_NO_FATAL_FAILURE(model.check());
}

TEST(Allocator, WideBlocksAreServedFirst) {
  Model model(5, 1, 3);
  model.wish(0, Level{1, 1});
  model.wish(1, Level{3, 3});
  model.wish(2, Level{5, 5});
  EXPECT_EQ(model.step(), 2u);
  EXPECT_EQ(model.owners[2].block, (BlockAddress{0, 0}));
}

TEST(Allocator, RecycledSuperblocksServeAnyLevel) {
  Model model = filled(4, 2, {1, 1}, 128);
  for (size_t i = 0; i < 128; ++i) {
    if (model.owners[i].block.superblock == 1) model.wish(i, std::nullopt);
  }
  model.step();
  model.wish(0, Level{4, 4});
  EXPECT_EQ(model.step(), 1u) << "still on the stack of 2x2";
  EXPECT_EQ(model.allocator.recycle(), 1u);
  EXPECT_EQ(model.allocator.recycle(), 0u);
  model.wish(0, Level{4, 4});
  EXPECT_EQ(model.step(), 0u);
  EXPECT_EQ(model.owners[0].block, (BlockAddress{1, 0}));
  ASSERT_NO_FATAL_FAILURE(model.check());
}

TEST(Allocator, RecyclingACarriedSuperblockForgetsItsRest) {
  Model model(4, 2, 64);
  model.wish(0, Level{2, 2});
  model.step();
  model.wish(0, std::nullopt);
  model.step();
  EXPECT_EQ(model.allocator.recycle(), 1u);
  EXPECT_EQ(model.allocator.stats().carry_texels, 0u);
  for (size_t i = 0; i < 32; ++i) model.wish(i, Level{2, 2});
  EXPECT_EQ(model.step(), 0u);
  ASSERT_NO_FATAL_FAILURE(model.check());
}

TEST(Allocator, ResetFreesEverything) {
  Model model = filled(5, 3, {2, 1}, 300);
  model.allocator.reset();
  for (Owner& owner : model.owners) owner = {};
  ASSERT_NO_FATAL_FAILURE(model.check());
  EXPECT_EQ(model.allocator.stats().free_superblocks, 3u);
  EXPECT_EQ(model.allocator.stats().stack_texels, 0u);
  for (size_t i = 0; i < 3; ++i) model.wish(i, Level{5, 5});
  EXPECT_EQ(model.step(), 0u);
  ASSERT_NO_FATAL_FAILURE(model.check());
}

TEST(Allocator, WithoutSuperblocksNothingIsPlaced) {
  Model model(3, 0, 1);
  model.wish(0, Level{1, 1});
  EXPECT_EQ(model.step(), 1u);
  EXPECT_EQ(model.allocator.recycle(), 0u);
  ASSERT_NO_FATAL_FAILURE(model.check());
}

}  // namespace
}  // namespace tessera::atlas::blocks
