#include "atlas/blocks/layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "occupancy.h"

namespace tessera::atlas::blocks {
namespace {

using scene::VisiblePatches;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Two instances of one geometry; the second one's material is masked.
scene::Scene make_scene(uint32_t patches_per_instance) {
  scene::Scene scene;
  scene.geometries.resize(1);
  for (uint32_t i = 0; i < patches_per_instance; ++i) {
    scene.geometries[0].patches.push_back({.first_triangle = 2 * i, .triangle_count = 2});
  }
  scene.materials.resize(2);
  scene.materials[1].alpha_mode = scene::AlphaMode::mask;
  scene.instances = {{.geometry = 0, .material = 0, .node = 0, .first_patch = 0},
                     {.geometry = 0, .material = 1, .node = 0, .first_patch = patches_per_instance}};
  scene.patch_count = 2 * patches_per_instance;
  return scene;
}

scene::VisiblePatch square(scene::PatchId patch, float side_px) {
  return {patch, {side_px, side_px, side_px * side_px}};
}

VisiblePatches squares(uint32_t count, float side_px) {
  VisiblePatches visible;
  for (uint32_t i = 0; i < count; ++i) visible.push_back(square(i, side_px));
  return visible;
}

// A layout, with a client that knows only its deltas.
class LayoutTest : public testing::Test {
 protected:
  void make(uint32_t patches_per_instance, const LayoutSettings& settings) {
    scene_ = make_scene(patches_per_instance);
    settings_ = settings;
    layout_ = *Layout::create(scene_, settings);
  }

  // One frame; checks all that must hold after every one.
  LayoutDelta update(const VisiblePatches& visible) {
    LayoutDelta delta = layout_->update({visible});
    apply(delta);
    check(visible);
    return delta;
  }

  const Placement& placement(scene::PatchId patch) const { return mirror_.at(patch); }
  uvec2 sides(scene::PatchId patch) const { return {placement(patch).width, placement(patch).height}; }

  std::unique_ptr<Layout> layout_;
  LayoutSettings settings_;

 private:
  void apply(const LayoutDelta& delta) {
    const auto by_patch = [](const Placement& a, const Placement& b) { return a.patch < b.patch; };
    EXPECT_TRUE(std::is_sorted(delta.changed.begin(), delta.changed.end(), by_patch));
    EXPECT_TRUE(std::is_sorted(delta.removed.begin(), delta.removed.end()));
    for (const scene::PatchId patch : delta.removed) EXPECT_EQ(mirror_.erase(patch), 1u);
    for (const Placement& p : delta.changed) {
      const auto known = mirror_.find(p.patch);
      EXPECT_TRUE(known == mirror_.end() || known->second != p) << "listed, but did not change";
      mirror_[p.patch] = p;
    }
  }

  void check(const VisiblePatches& visible) {
    const std::span<const Placement> placements = layout_->placements();
    ASSERT_EQ(placements.size(), visible.size());
    ASSERT_EQ(mirror_.size(), visible.size());
    Occupancy occupancy(settings_.width, settings_.height);
    uint32_t blocks = 0;
    for (size_t i = 0; i < placements.size(); ++i) {
      const Placement& p = placements[i];
      ASSERT_EQ(p.patch, visible[i].patch);
      ASSERT_EQ(mirror_.at(p.patch), p);
      ASSERT_EQ(p.masked, p.patch >= scene_.patch_count / 2);
      if (p.kind == PlacementKind::color) continue;
      ++blocks;
      ASSERT_EQ(p.x % p.width, 0u);
      ASSERT_EQ(p.y % p.height, 0u);
      ASSERT_GE(std::min(p.color_width(), p.color_height()), 2u);
      ASSERT_TRUE(occupancy.take(p.x, p.y, p.width, p.height)) << "patch " << p.patch;
    }
    const LayoutStats& stats = layout_->stats();
    EXPECT_EQ(stats.blocks, blocks);
    EXPECT_EQ(stats.blocks + stats.colors, placements.size());
    EXPECT_EQ(stats.used_texels, occupancy.texels());
  }

  scene::Scene scene_;
  std::map<scene::PatchId, Placement> mirror_;
};

TEST_F(LayoutTest, RejectsSizesThatDoNotFitTheSuperblocks) {
  const scene::Scene scene = make_scene(1);
  for (const LayoutSettings& settings :
       {LayoutSettings{.width = 0}, LayoutSettings{.width = 300}, LayoutSettings{.height = 128},
        LayoutSettings{.width = 16384}, LayoutSettings{.superblock_log = 0},
        LayoutSettings{.superblock_log = 9}, LayoutSettings{.levels = {.max_log = 0}},
        LayoutSettings{.high_water = 0}}) {
    const auto layout = Layout::create(scene, settings);
    EXPECT_EQ(layout.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(layout.status().message(), HasSubstr("atlas layout"));
  }
}

TEST_F(LayoutTest, EmptySceneAndEmptySets) {
  make(0, {});
  EXPECT_THAT(update({}).changed, IsEmpty());
  make(4, {});
  EXPECT_THAT(update({}).changed, IsEmpty());
  EXPECT_EQ(update(squares(4, 20)).changed.size(), 4u);
  EXPECT_THAT(update({}).removed, ElementsAre(0, 1, 2, 3));
  EXPECT_EQ(layout_->stats().used_texels, 0u);
}

TEST_F(LayoutTest, StablePatchesKeepTheirPlace) {
  make(200, {});
  update(squares(400, 20));
  EXPECT_THAT(update(squares(400, 20)).changed, IsEmpty());
  EXPECT_THAT(update(squares(400, 20.5f)).changed, IsEmpty());
  // Others come and go; who stays, stays where it is.
  VisiblePatches half;
  for (uint32_t i = 0; i < 400; i += 2) half.push_back(square(i, 20));
  EXPECT_THAT(update(half).changed, IsEmpty());
  const LayoutDelta delta = update(squares(400, 20));
  EXPECT_EQ(delta.changed.size(), 200u);
  for (const Placement& p : delta.changed) EXPECT_EQ(p.patch % 2, 1u);
}

TEST_F(LayoutTest, MaskedPatchesGetRoomForCoverage) {
  make(1, {.levels = {.min_bias = 0}});
  update({square(0, 32), square(1, 32)});
  EXPECT_EQ(sides(0), uvec2(32, 32));
  EXPECT_EQ(sides(1), uvec2(64, 32));
  EXPECT_EQ(placement(1).color_width(), 32u);
}

TEST_F(LayoutTest, TurningAPatchKeepsItsBlock) {
  make(1, {.levels = {.min_bias = 0}});
  update({{0, {64, 16, 1024}}});
  const Placement before = placement(0);
  update({{0, {16, 64, 1024}}});
  EXPECT_TRUE(placement(0).transposed && !before.transposed);
  EXPECT_EQ(placement(0).x, before.x);
  EXPECT_EQ(placement(0).y, before.y);
}

TEST_F(LayoutTest, NegativeBiasFillsARoomyAtlas) {
  make(10, {});
  update(squares(10, 16));
  EXPECT_EQ(layout_->stats().bias, -2);
  EXPECT_EQ(sides(0), uvec2(32, 32));
}

TEST_F(LayoutTest, BiasMakesACrowdFit) {
  make(5000, {.width = 512, .height = 512, .superblock_log = 6});
  update(squares(5000, 40));
  EXPECT_GT(layout_->stats().bias, 4);
  EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u);
  EXPECT_GT(layout_->stats().used_texels, 512u * 512u / 4);
}

TEST_F(LayoutTest, SwayingFootprintsDoNotMoveTheAtlas) {
  make(2000, {.width = 512, .height = 512, .superblock_log = 6});
  std::mt19937 random(5);
  std::uniform_real_distribution<float> log_side(1, 5), sway(-0.04f, 0.04f);
  std::vector<float> sides(2000);
  for (float& side : sides) side = log_side(random);
  uint64_t changed = 0;
  for (int frame = 0; frame < 60; ++frame) {
    VisiblePatches visible;
    for (uint32_t i = 0; i < sides.size(); ++i)
      visible.push_back(square(i, std::exp2(sides[i] + sway(random))));
    const LayoutDelta delta = update(visible);
    if (frame > 10) changed += delta.changed.size();
  }
  EXPECT_LT(changed, 20u);
}

TEST_F(LayoutTest, ExactlyFullAtlas) {
  // 64 blocks of 16x16 in 128x128, at the level that the smallest bias allows.
  make(65, {.width = 128,
            .height = 128,
            .superblock_log = 4,
            .high_water = 1,
            .levels = {.min_bias = 0, .max_bias = 0}});
  update(squares(64, 16));
  EXPECT_EQ(layout_->stats().used_texels, 128u * 128u);
  EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u);
  // One more finds no place, is a colour, and gets the first place that falls free.
  update(squares(65, 16));
  EXPECT_EQ(layout_->stats().colors_out_of_memory, 1u);
  EXPECT_EQ(placement(64).kind, PlacementKind::color);
  VisiblePatches visible = squares(65, 16);
  visible.erase(visible.begin() + 7);
  update(visible);
  EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u);
  EXPECT_EQ(placement(64).kind, PlacementKind::block);
}

TEST_F(LayoutTest, WhoFindsNoBlockTakesASmallerOneForAWhile) {
  make(65, {.width = 128,
            .height = 128,
            .superblock_log = 4,
            .high_water = 1,
            .levels = {.min_bias = 0, .max_bias = 0}});
  VisiblePatches visible = squares(63, 16);
  visible.push_back(square(63, 8));  // takes a quarter of the last superblock
  update(visible);
  visible.push_back(square(64, 16));
  update(visible);
  EXPECT_EQ(layout_->stats().blocks_halved, 1u);
  EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u);
  EXPECT_EQ(sides(64), uvec2(8, 8));
  visible.erase(visible.begin() + 7);
  for (int frame = 0; frame < 3; ++frame) update(visible);
  EXPECT_EQ(sides(64), uvec2(16, 16));
}

// All superblocks in use is not the same as no memory.
TEST_F(LayoutTest, BlocksGrowInAnAtlasOfOneSuperblock) {
  make(4, {.width = 64, .height = 64, .superblock_log = 6, .levels = {.min_bias = 0}});
  for (int frame = 0; frame < 3; ++frame) update({{0, {8, 4, 32}}});
  update({{0, {8, 8, 64}}});
  EXPECT_EQ(sides(0), uvec2(8, 8));
}

TEST_F(LayoutTest, OneFootprintOfTheLargestBlock) {
  for (const uint8_t log : {1, 4, 8}) {
    const uint32_t side = 1u << log;
    make(1, {.width = side, .height = side, .superblock_log = log});
    update({square(0, 1e6f)});
    EXPECT_EQ(sides(0), uvec2(1u << log));
    EXPECT_EQ(layout_->stats().used_texels, uint64_t{side} * side);
  }
}

TEST_F(LayoutTest, ExtremeFootprintsAreHarmless) {
  make(4, {});
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  for (int frame = 0; frame < 5; ++frame) {
    update({{0, {nan, nan, nan}},
            {1, {inf, inf, inf}},
            {2, {0, 0, 0}},
            {3, {-1, 1e-40f, 1e30f}},
            {5, {inf, 0, nan}}});
    EXPECT_EQ(placement(0).kind, PlacementKind::color);
    EXPECT_EQ(placement(1).kind, PlacementKind::block);
  }
}

// A scene in which memory runs out although the bias fits: every width needs superblocks of its own.
class CrowdedLayoutTest : public LayoutTest {
 protected:
  static constexpr uint32_t kPatches = 1500;
  static constexpr uint32_t kSide = 512;

  CrowdedLayoutTest() {
    make(kPatches, {.width = kSide, .height = kSide, .superblock_log = 7});
    std::uniform_real_distribution<float> log_side(0, 6);
    for (uint32_t i = 0; i < 2 * kPatches; ++i) sides_.push_back(std::exp2(log_side(random_)));
  }

  // Zooms every frame, and exchanges a share of the visible patches.
  VisiblePatches next(float zoom, uint32_t churn_percent) {
    VisiblePatches visible;
    if (present_.empty()) present_.assign(sides_.size(), false);
    for (uint32_t i = 0; i < sides_.size(); ++i) {
      if (random_() % 100 < churn_percent) present_[i] = !present_[i];
      if (present_[i]) visible.push_back(square(i, zoom * sides_[i]));
    }
    return visible;
  }

  std::mt19937 random_{11};
  std::vector<float> sides_;
  std::vector<bool> present_;
};

TEST_F(CrowdedLayoutTest, LongRunsNeverOverlapAndRecover) {
  uint32_t worst = 0, starved_at_the_end = 0;
  for (int frame = 0; frame < 240; ++frame) {
    const float zoom = std::exp2(2 * std::sin(0.05f * static_cast<float>(frame)));
    update(next(zoom, frame == 100 || frame == 101 ? 50 : 4));
    worst = std::max(worst, layout_->stats().colors_out_of_memory);
    if (HasFatalFailure()) return;
  }
  // The storm ends: what was short of memory must find some.
  const VisiblePatches last = next(1, 0);
  for (int frame = 0; frame < 120; ++frame) {
    update(last);
    starved_at_the_end = layout_->stats().colors_out_of_memory;
  }
  EXPECT_EQ(starved_at_the_end, 0u) << "worst before: " << worst;
  EXPECT_FALSE(layout_->stats().reset);
  EXPECT_GT(layout_->stats().used_texels, kSide * kSide * 2 / 5);
}

TEST_F(CrowdedLayoutTest, ResetsMoveABoundedShareAFrame) {
  uint32_t stages = 0;
  for (int frame = 0; frame < 300; ++frame) {
    const VisiblePatches visible = next(1, frame == 0 ? 50 : frame < 150 ? 8 : 0);
    std::map<scene::PatchId, Placement> before;
    for (const Placement& p : layout_->placements()) before[p.patch] = p;
    update(visible);
    if (!layout_->stats().reset) continue;
    ++stages;
    uint64_t moved = 0;
    for (const Placement& p : layout_->placements()) {
      const auto old = before.find(p.patch);
      if (p.kind == PlacementKind::block && old != before.end() && old->second.kind == PlacementKind::block &&
          old->second != p) {
        moved += uint64_t{old->second.width} * old->second.height;
      }
    }
    // Footprints stand still: what moves is the stage, and the few that the bias moves.
    EXPECT_LE(moved, kSide * kSide / 8 + kSide * kSide / 32);
  }
  EXPECT_GT(stages, 0u);
  EXPECT_GT(layout_->stats().resets_total, 0u);
}

// But for want of memory a reset begins only above the mark, and with a lower one more often.
TEST_F(CrowdedLayoutTest, TheHighWaterMarkSaysWhenResetsBegin) {
  const scene::Scene scene = make_scene(kPatches);
  std::vector<VisiblePatches> frames;
  for (int frame = 0; frame < 200; ++frame) frames.push_back(next(1, frame == 0 ? 50 : 4));
  constexpr float kSuperblocks = 64;
  std::vector<uint32_t> resets;
  for (const float mark : {0.4f, 0.7f, 0.9f, 1.0f}) {
    LayoutSettings settings = settings_;
    settings.superblock_log = settings.levels.max_log = 6;
    settings.high_water = mark;
    const auto layout = *Layout::create(scene, settings);
    uint32_t& begun = resets.emplace_back(0);
    for (const VisiblePatches& visible : frames) {
      layout->update({visible});
      const LayoutStats& stats = layout->stats();
      const bool begins = stats.resets_total > begun;
      begun = stats.resets_total;
      if (!begins || stats.colors_out_of_memory > 0 || stats.blocks_halved > 0) continue;
      EXPECT_GT(1 - static_cast<float>(layout->memory().free_superblocks) / kSuperblocks, mark);
    }
  }
  EXPECT_GT(resets[0], resets[2]);
  EXPECT_GE(resets[1], resets[2]);
  EXPECT_EQ(resets[3], 0u);
}

// What thesis fig. 3.9 shows.
TEST_F(CrowdedLayoutTest, EachPartThatAStrategyLacksCostsMemory) {
  const scene::Scene scene = make_scene(kPatches);
  LayoutSettings settings = settings_;
  settings.superblock_log = settings.levels.max_log = 6;
  std::vector<std::unique_ptr<Layout>> layouts;
  for (const Strategy strategy :
       {Strategy::reference, Strategy::no_columns, Strategy::no_stacks, Strategy::no_resets})
    layouts.push_back(*Layout::create(scene, settings, strategy));
  std::array<uint64_t, 4> carried{}, fragmented{};
  std::array<uint32_t, 4> short_of_memory{};
  for (int frame = 0; frame < 200; ++frame) {
    const VisiblePatches visible = next(1, frame == 0 ? 50 : 4);
    for (size_t s = 0; s < layouts.size(); ++s) {
      layouts[s]->update({visible});
      const AllocatorStats m = layouts[s]->memory();
      ASSERT_EQ(m.used_texels + m.stack_texels + m.carry_texels + m.inaccessible_texels + m.free_texels,
                kSide * kSide);
      EXPECT_TRUE(s < 2 ? m.inaccessible_texels == 0 : m.stack_texels == 0);
      carried[s] += m.carry_texels;
      fragmented[s] += m.carry_texels + m.stack_texels + m.inaccessible_texels;
      short_of_memory[s] += layouts[s]->stats().colors_out_of_memory + layouts[s]->stats().blocks_halved;
    }
  }
  EXPECT_LT(carried[0], carried[1]);
  EXPECT_LT(fragmented[0], fragmented[1]);
  EXPECT_LT(fragmented[1], fragmented[3]);
  EXPECT_LT(fragmented[2], fragmented[3]);
  EXPECT_EQ(short_of_memory[0], 0u);
  EXPECT_GT(short_of_memory[3], 0u);
  EXPECT_GT(layouts[2]->stats().resets_total, 0u);
  EXPECT_EQ(layouts[3]->stats().resets_total, 0u);
}

TEST_F(CrowdedLayoutTest, EqualInputsGiveEqualLayouts) {
  const scene::Scene scene = make_scene(kPatches);
  const auto twin = *Layout::create(scene, settings_);
  for (int frame = 0; frame < 40; ++frame) {
    const VisiblePatches visible = next(1 + 0.05f * static_cast<float>(frame), 10);
    layout_->update({visible});
    twin->update({visible});
    ASSERT_TRUE(std::ranges::equal(layout_->placements(), twin->placements()));
  }
}

// One superblock cannot serve several widths: patches fall back to colours, the atlas does not churn for
// ever.
TEST_F(LayoutTest, HopelessAtlasSettles) {
  make(60, {.width = 64, .height = 64, .superblock_log = 6});
  VisiblePatches visible;
  for (uint32_t i = 0; i < 60; ++i) visible.push_back(square(i, std::exp2(static_cast<float>(i % 6))));
  uint64_t changed = 0;
  for (int frame = 0; frame < 1000; ++frame) {
    update(visible);
    if (frame >= 500) changed += layout_->stats().changed;
  }
  EXPECT_GT(layout_->stats().blocks, 0u);
  EXPECT_LT(changed, 500u);
}

TEST(SettingsFor, KeepsAtLeast128SuperblocksThatTileTheAtlas) {
  for (const auto& [width, height, log] : {std::tuple{512u, 256u, 5},
                                           {1024u, 1024u, 6},
                                           {2048u, 1024u, 7},
                                           {2048u, 2048u, 7},
                                           {4096u, 2048u, 8},
                                           {8192u, 8192u, 8},
                                           {64u, 64u, 2}}) {
    const LayoutSettings settings = settings_for(width, height);
    EXPECT_EQ(settings.superblock_log, log) << width << "x" << height;
    EXPECT_EQ(settings.levels.max_log, log);
    EXPECT_GE((width >> log) * (height >> log), 128u);
  }
}

}  // namespace
}  // namespace tessera::atlas::blocks
