#include "atlas/coherent/layout.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <ranges>

#include "atlas/coherent/rectangles.h"
#include "atlas/coherent/spacing.h"
#include "occupancy.h"

namespace tessera::atlas::coherent {
namespace {

using scene::VisiblePatches;

// Quads of 1 m in a row along -Z, on the ground; the second instance, 1 m to the right, is masked.
scene::Scene make_scene(uint32_t patches) {
  scene::Scene scene;
  scene::Geometry& g = scene.geometries.emplace_back();
  for (uint32_t i = 0; i < patches; ++i) {
    const auto near = -static_cast<float>(i);
    for (const vec3 p : {vec3(0, 0, near), vec3(1, 0, near), vec3(0, 0, near - 1), vec3(1, 0, near - 1)}) {
      scene::Vertex v{};
      v.position = p;
      g.vertices.push_back(v);
    }
    for (const uint32_t corner : {0, 1, 2, 3, 2, 1}) g.indices.push_back(4 * i + corner);
    g.patches.push_back({.first_triangle = 2 * i, .triangle_count = 2});
  }
  scene.materials.resize(2);
  scene.materials[1].alpha_mode = scene::AlphaMode::mask;
  scene.nodes.resize(2);
  scene.nodes[1].translation = {1, 0, 0};
  scene.instances = {{0, 0, 0}, {0, 1, 1}};
  scene.index_instances();
  return scene;
}

class CoherentLayout : public testing::Test {
 protected:
  void make(uint32_t patches, LayoutSettings settings = {}) {
    scene_ = make_scene(patches);
    settings_ = settings;
    layout_ = *Layout::create(scene_, settings);
    for (const scene::Instance& instance : scene_.instances)
      transforms_.push_back(scene_.node_transforms(0)[instance.node]);
  }

  // One frame; a client that knows only the deltas must hold the same, and nothing overlaps.
  LayoutDelta update(const VisiblePatches& visible, const dvec3& eye = {0.5, 1.7, 1}) {
    LayoutDelta delta = layout_->update({visible, eye, transforms_});
    for (const scene::PatchId patch : delta.removed) EXPECT_EQ(mirror_.erase(patch), 1u);
    for (const Placement& p : delta.changed) {
      EXPECT_TRUE(!mirror_.contains(p.patch) || mirror_[p.patch] != p);
      mirror_[p.patch] = p;
    }
    EXPECT_EQ(mirror_.size(), visible.size());
    Occupancy occupancy(settings_.width, settings_.height);
    size_t i = 0;
    for (const Placement& p : layout_->placements()) {
      EXPECT_EQ(p.patch, visible[i++].patch);
      EXPECT_EQ(mirror_.at(p.patch), p);
      if (p.kind == PlacementKind::color) continue;
      EXPECT_TRUE(p.x % 2 == 0 && p.y % 2 == 0 && p.width % 2 == 0 && p.height % 2 == 0);
      EXPECT_TRUE(p.color_width() % 2 == 0 && p.color_height() % 2 == 0) << "a half owns its chroma samples";
      EXPECT_TRUE(occupancy.take(p.x, p.y, p.width, p.height)) << p.patch;
    }
    EXPECT_EQ(layout_->stats().used_texels, occupancy.texels());
    return delta;
  }

  scene::Scene scene_;
  LayoutSettings settings_;
  std::vector<dmat4> transforms_;
  std::unique_ptr<Layout> layout_;
  std::map<scene::PatchId, Placement> mirror_;
};

VisiblePatches rectangles(uint32_t count, float u, float v) {
  VisiblePatches visible;
  for (uint32_t i = 0; i < count; ++i) visible.push_back({i, {u, v, u * v}});
  return visible;
}

TEST_F(CoherentLayout, RefusesOddAndHugeAtlasesAndMarksOutOfRange) {
  const scene::Scene scene = make_scene(1);
  for (const auto& [width, height] : {std::pair{0u, 256u}, {255u, 256u}, {256u, 8194u}})
    EXPECT_EQ(Layout::create(scene, {.width = width, .height = height}).status().code(),
              absl::StatusCode::kInvalidArgument);
  for (const float mark : {0.0f, -1.0f, 1.01f, std::nanf("")})
    EXPECT_EQ(Layout::create(scene, {.width = 256, .height = 256, .high_water = mark}).status().code(),
              absl::StatusCode::kInvalidArgument);
}

TEST_F(CoherentLayout, RandomSetsKeepEveryRule) {
  make(600, {.width = 512, .height = 320});
  std::mt19937 random(3);
  uint32_t starved = 0;
  for (int frame = 0; frame < 150; ++frame) {
    VisiblePatches visible;
    const float zoom = std::exp2(4 * std::sin(0.1f * static_cast<float>(frame)));
    for (scene::PatchId p = 0; p < scene_.patch_count; ++p) {
      if (random() % 10 == 0) continue;
      const float u = zoom * static_cast<float>(1 + p % 13), v = zoom * static_cast<float>(1 + p % 7);
      visible.push_back({p, {u, v, u * v}});
    }
    update(visible, {0.5, 1.7, -0.5 * frame});
    starved += layout_->stats().colors_out_of_memory;
  }
  EXPECT_LT(starved, 150u * 1200 / 10) << "memory runs out now and then, not always";
}

TEST_F(CoherentLayout, WhatStaysVisibleStaysInPlace) {
  make(100);
  update(rectangles(200, 20, 12));
  EXPECT_TRUE(update(rectangles(200, 20, 12)).changed.empty());
  EXPECT_TRUE(update(rectangles(200, 21, 12.5f)).changed.empty()) << "within the hysteresis";
  VisiblePatches fewer = rectangles(200, 20, 12);
  std::erase_if(fewer, [](const auto& v) { return v.patch % 3 == 0; });
  EXPECT_TRUE(update(fewer).changed.empty());
}

TEST_F(CoherentLayout, WhatCannotGrowKeepsSamplesAndThenItsPlace) {
  LayoutSettings settings{.width = 640, .height = 256};
  settings.levels.min_bias = settings.levels.max_bias = 0;
  make(3, settings);
  VisiblePatches visible = rectangles(3, 159, 159);
  update(visible);
  ASSERT_EQ(layout_->stats().blocks, 3u);
  visible[1].footprint = {255, 255, 255 * 255};
  uint32_t moved = 0;
  for (int frame = 0; frame < 60; ++frame) {
    moved += !update(visible).changed.empty();
    EXPECT_EQ(layout_->stats().blocks, 3u) << frame;
    EXPECT_GE(mirror_.at(1).texels(), 128u * 128) << frame;
  }
  EXPECT_LE(moved, 6u) << "it tries again now and then";
}

TEST_F(CoherentLayout, SmallAtlasesHoldWhatTheyCan) {
  for (const auto& [width, height] :
       {std::pair{2048u, 128u}, {128u, 2048u}, {64u, 64u}, {2u, 256u}, {256u, 2u}, {320u, 320u}}) {
    mirror_.clear();
    make(2, {.width = width, .height = height});
    for (const VisiblePatches& visible : {VisiblePatches{{0, {40, 200, 8000}}, {1, {300, 300, 90000}}},
                                          VisiblePatches{{0, {900, 3, 2700}}, {2, {500, 500, 250000}}}}) {
      update(visible);
      EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u) << width << "x" << height;
      EXPECT_GT(layout_->stats().blocks, 0u) << width << "x" << height;
    }
  }
}

// Every third patch stays, so that all slabs are a third full; then wide ones come that only emptied slabs
// have room for.
TEST_F(CoherentLayout, StagesMakeRoomAndMoveLittleAFrame) {
  LayoutSettings settings{.width = 1024, .height = 512};
  settings.levels.min_bias = settings.levels.max_bias = 0;
  make(600, settings);
  update(rectangles(600, 23, 31));
  VisiblePatches visible = rectangles(600, 23, 31);
  std::erase_if(visible, [](const auto& v) { return v.patch % 3 != 0; });
  update(visible);
  for (uint32_t i = 0; i < 7; ++i) visible.push_back({600 + i, {120, 120, 14400}});
  const auto all_large = [&] {
    return std::ranges::all_of(std::views::iota(600u, 607u), [&](scene::PatchId patch) {
      return mirror_.at(patch).texels() >= 2 * 128u * 112;  // what 120x120 rounds to
    });
  };
  uint32_t frames = 0;
  do {
    const auto before = mirror_;
    uint64_t moved = 0;
    for (const Placement& p : update(visible).changed)
      if (before.contains(p.patch) && p.patch < 600) moved += p.texels();
    EXPECT_LE(moved, 1024u * 512 / 16) << frames;
    EXPECT_GE(layout_->stats().blocks, 200u) << "what has a place keeps one";
  } while (!all_large() && ++frames < 150);
  EXPECT_GT(frames, 0u) << "else this tests nothing";
  EXPECT_LT(frames, 150u);
}

// Holes everywhere that serve nothing: of the widths that are there, too low for what is there.
TEST_F(CoherentLayout, AFullAtlasWithUselessGapsComesToRest) {
  LayoutSettings settings{.width = 1024, .height = 512};
  settings.levels.min_bias = settings.levels.max_bias = 0;
  make(800, settings);
  std::mt19937 random(3);
  VisiblePatches visible;
  for (uint32_t i = 0; i < 800; ++i) {
    const float side = 10.0f + static_cast<float>(random() % 60);
    visible.push_back({i, {side, 0.8f * side, 0.8f * side * side}});
  }
  update(visible);
  for (const uint32_t keep : {3u, 2u}) {
    std::erase_if(visible, [&](const auto&) { return random() % keep == 0; });
    update(visible);
  }
  uint64_t moved = 0;
  for (int frame = 0; frame < 1000; ++frame) {
    const auto changed = update(visible).changed.size();
    if (frame >= 500) moved += changed;
  }
  EXPECT_LE(moved, visible.size() / 4) << "in 500 frames that all look the same";
}

// Whatever crowd left the memory as it is: who looks on gets the samples that all have, after a while.
TEST_F(CoherentLayout, WhatFoundTooLittleRoomRecovers) {
  for (uint32_t seed = 0; seed < 8; ++seed) {
    mirror_.clear();
    make(1200, {.width = 512, .height = 512});
    std::mt19937 random(seed);
    const auto crowd = [&](uint32_t from, uint32_t to) {
      VisiblePatches visible;
      for (uint32_t i = from; i < to; ++i) {
        const float side = 6.0f + static_cast<float>(random() % 50);
        visible.push_back({i, {side, 0.7f * side, 0.7f * side * side}});
      }
      return visible;
    };
    update(crowd(0, 400));
    const VisiblePatches visible = crowd(200, 1100);
    for (int frame = 0; frame < 1500; ++frame) update(visible);
    EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u) << seed;
    const float scale = std::exp2(-0.5f * layout_->stats().bias);
    uint32_t sparse = 0;
    for (const scene::VisiblePatch& v : visible) {
      const Placement& p = mirror_.at(v.patch);
      if (p.kind != PlacementKind::block) continue;
      const float wished = scale * scale * v.footprint.u_px * v.footprint.v_px;
      sparse += static_cast<float>(p.texels()) < 0.45f * wished;
    }
    EXPECT_EQ(sparse, 0u) << seed;
  }
}

TEST_F(CoherentLayout, SpacingIsFrozenWhileItIsGood) {
  make(50);
  const VisiblePatches visible = rectangles(50, 20, 20);
  update(visible, {0.5, 0.3, 3});
  const Placement before = mirror_.at(0);
  EXPECT_GT(before.spacing[1], 0) << "the far edge is farther";
  EXPECT_TRUE(update(visible, {0.5, 0.3, 3.1}).changed.empty());
  EXPECT_TRUE(update(visible, {0.5, 0.3, 0.2}).changed.empty());
  const LayoutDelta delta = update(visible, {0.05, 0.05, 0.05});
  EXPECT_FALSE(delta.changed.empty());
  const Placement after = mirror_.at(0);
  EXPECT_NE(after.spacing, before.spacing);
  EXPECT_TRUE(after.x == before.x && after.y == before.y && after.width == before.width);
}

// A viewer who walks makes everything ahead grow: a part of it a frame, and a little beyond what it needs,
// for it will need more.
TEST_F(CoherentLayout, GrowthIsSpreadOverFramesAndAhead) {
  LayoutSettings settings{.width = 1024, .height = 1024};
  settings.levels.min_bias = settings.levels.max_bias = 0;
  make(300, settings);
  update(rectangles(300, 23, 23));
  const VisiblePatches closer = rectangles(300, 39, 39);
  size_t grown = 0;
  for (int frame = 0; frame < 40 && grown < 300; ++frame) {
    uint64_t texels = 0;
    for (const Placement& p : update(closer).changed) {
      texels += p.texels();
      grown += 1;
      EXPECT_GE(p.texels(), 39u * 39u) << p.patch;
    }
    EXPECT_LE(texels, 1024u * 1024 / 32 + 64 * 64) << frame;
  }
  EXPECT_EQ(grown, 300u) << "each once";
  EXPECT_TRUE(update(rectangles(300, 47, 47)).changed.empty()) << "ahead";
}

// Of few large rectangles a slab holds one, and what is left of it serves none of the others.
TEST_F(CoherentLayout, TheFirstFrameFindsAPlaceForAll) {
  for (const float side : {90.0f, 140.0f, 190.0f}) {
    mirror_.clear();
    make(60, {.width = 1024, .height = 512});
    update(rectangles(60, side, 1.2f * side));
    EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u) << side;
    EXPECT_GT(layout_->stats().used_texels, 1024u * 512 / 2) << side;
  }
}

// Of many shapes, so that no width has many rectangles.
TEST_F(CoherentLayout, ASmallAtlasIsUsedAsWellAsALargeOne) {
  for (const auto& [width, height, patches] :
       {std::tuple{256u, 256u, 50u}, {512u, 256u, 100u}, {2048u, 1024u, 600u}}) {
    make(patches, {.width = width, .height = height});
    std::mt19937 random(5);
    std::exponential_distribution<float> side(0.05f);
    VisiblePatches visible;
    for (scene::PatchId p = 0; p < scene_.patch_count; ++p) {
      const float u = 2 + side(random), v = 2 + side(random);
      visible.push_back({p, {u, v, u * v}});
    }
    mirror_.clear();
    update(visible);
    const LayoutStats& stats = layout_->stats();
    EXPECT_EQ(stats.colors_out_of_memory + stats.blocks_halved, 0u);
    EXPECT_GT(static_cast<double>(stats.used_texels), 0.6 * width * height) << width << "x" << height;
  }
}

TEST_F(CoherentLayout, AFullAtlasFallsBackToColorsAndRecovers) {
  make(2000, {.width = 256, .height = 256, .levels = {.max_bias = 0}});
  update(rectangles(2000, 20, 20));
  EXPECT_GT(layout_->stats().colors_out_of_memory, 0u);
  EXPECT_GT(layout_->stats().used_texels, 256u * 256 * 85 / 100);
  for (int i = 0; i < 5; ++i) update(rectangles(100, 20, 20));
  EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u);
}

// The smaller, the coarser are steps of two texels, of half a square and of whole ones.
TEST(Rectangles, SamplesAreEquallyDenseWhateverTheShape) {
  for (float u = 3; u <= 200; u *= 1.03f) {
    for (float v = 3; v <= 200; v *= 1.07f) {
      const RectangleNeed need = rectangle_need({u, v, u * v}, 2);
      const RectangleSize size = select_size(need, false, 0, nullptr, {});
      // Intervals a pixel, both ways together.
      const float density = float(size.u - 1) * float(size.v - 1) / (u * v);
      const float least = std::min(u, v);
      const auto what = [&] { return absl::StrCat(u, "x", v, ": ", size.u, "x", size.v); };
      EXPECT_NEAR(std::log2(density), 0, least < 8 ? 0.49f : 0.42f) << what();
      const float side_bound = least < 8 ? 0.73f : least < 24 ? 0.66f : 0.42f;
      for (const auto& [has, wish] : {std::pair(size.u, u), std::pair(size.v, v)})
        EXPECT_NEAR(std::log2(float(has - 1) / wish), 0, side_bound) << what();
    }
  }
}

// Else it would have no slack: the least movement would place it anew.
TEST(Rectangles, WhatIsChosenFitsWhatItWasChosenForAndALittleMore) {
  for (const MostSides most : {MostSides{}, MostSides{20, 256}, MostSides{64, 12}}) {
    for (float u = 1; u <= 300; u *= 1.03f) {
      for (float v = 1; v <= 300; v *= 1.07f) {
        const RectangleNeed need = rectangle_need({u, v, u * v}, 2);
        const RectangleSize size = select_size(need, false, 0, nullptr, {}, most);
        if (size.single_color()) continue;
        EXPECT_EQ(select_size(need, false, 0, &size, {}, most), size) << u << "x" << v;
      }
    }
  }
}

// A square of 8 texels that two rectangles share is transformed for both.
TEST(Rectangles, SidesAreWholeSquaresUnlessTheyAreSmall) {
  for (const bool masked : {false, true}) {
    for (float u = 1; u <= 300; u *= 1.1f) {
      for (float v = 1; v <= 300; v *= 1.1f) {
        const RectangleSize size = select_size(rectangle_need({u, v, u * v}, 2), masked, 0, nullptr, {});
        const uvec2 sides = sides_of(size, masked);
        for (const uint32_t side : {sides.x, sides.y}) {
          const uint32_t step = side < 8 ? 2 : side < 16 ? 4 : 8;
          EXPECT_EQ(side % step, 0u) << u << "x" << v << " " << masked << ": " << side;
        }
      }
    }
  }
}

TEST(Rectangles, ABlockSplitsIntoTheColorAndTheCoverageThatWereChosen) {
  for (float u = 1; u <= 300; u *= 1.1f) {
    for (float v = 1; v <= 300; v *= 1.1f) {
      const RectangleSize size = select_size(rectangle_need({u, v, u * v}, 2), true, 0, nullptr, {});
      if (size.single_color()) continue;
      const uvec2 sides = sides_of(size, true);
      Placement p{.kind = PlacementKind::block, .masked = true};
      p.width = static_cast<uint16_t>(sides.x);
      p.height = static_cast<uint16_t>(sides.y);
      EXPECT_EQ(p.color_width(), std::max(size.u, size.v)) << size.u << "x" << size.v;
      EXPECT_EQ(p.color_height(), std::min(size.u, size.v)) << size.u << "x" << size.v;
    }
  }
}

// Of a patch that comes closer or turns a little.
TEST(Rectangles, WhatIsHeldStaysUntilASideIsTooSparseOrTheAreaTooDense) {
  const auto next = [](float u, float v, const RectangleSize& held) {
    return select_size(rectangle_need({u, v, u * v}, 2), false, 0, &held, {});
  };
  const RectangleSize held = select_size(rectangle_need({63, 39, 63 * 39}, 2), false, 0, nullptr, {});
  EXPECT_EQ(held, (RectangleSize{64, 40}));
  for (const auto& [u, v] : {std::pair{85.0f, 52.0f}, {85.0f, 20.0f}, {40.0f, 26.0f}})
    EXPECT_EQ(next(u, v, held), held) << u << "x" << v;
  for (const auto& [u, v] : {std::pair{95.0f, 39.0f}, {63.0f, 60.0f}, {36.0f, 24.0f}})
    EXPECT_NE(next(u, v, held), held) << u << "x" << v;
}

// A quarter of a pixel high, they once held ten times the texels of what they show.
TEST(Rectangles, SliversPayForTheirWidthWithTheirLength) {
  for (float height = 0.02f; height < 2; height *= 1.3f) {
    for (float length = 8; length <= 250; length *= 1.3f) {
      for (const bool upright : {false, true}) {
        const scene::Footprint sliver{upright ? height : length, upright ? length : height, length * height};
        const RectangleNeed need = rectangle_need(sliver, 2);
        const RectangleSize size = select_size(need, false, 0, nullptr, {});
        if (size.single_color()) continue;
        // Two rows for one interval, and a width that is off by a fifth.
        EXPECT_LE(size.u * size.v, 2.4f * (need.area + 2)) << length << "x" << height;
      }
    }
  }
}

TEST(Rectangles, ASmallerTargetNeverGivesASmallerBiasAndIsMet) {
  std::mt19937 random(5);
  std::vector<Wanted> wanted;
  for (int i = 0; i < 3000; ++i) {
    const float u = std::exp2(static_cast<float>(random() % 90) / 10),
                v = u * static_cast<float>(1 + random() % 9) / 5;
    wanted.push_back({rectangle_need({u, v, u * v}, static_cast<uint8_t>(1 + i % 3)), i % 7 == 0});
  }
  float before = -10;
  for (double target = 4e6; target > 1e4; target *= 0.8) {
    const float bias = select_bias(wanted, target, {});
    EXPECT_GE(bias, before);
    before = bias;
    uint64_t texels = 0;
    for (const Wanted& w : wanted) {
      const RectangleSize size = select_size(w.need, w.masked, bias, nullptr, {});
      texels += uint64_t{size.u} * size.v * (w.masked ? 2 : 1);
    }
    EXPECT_TRUE(static_cast<double>(texels) <= target || bias == LevelSettings{}.max_bias);
  }
}

TEST(Rectangles, AnyFootprintGivesAValidSize) {
  constexpr float kInf = std::numeric_limits<float>::infinity(),
                  kNan = std::numeric_limits<float>::quiet_NaN();
  const float values[] = {0, 1e-38f, 1e-3f, 1, 300, 1e7f, 3e38f, kInf, kNan, -1};
  for (const float u : values)
    for (const float v : values)
      for (const float area : values)
        for (const bool masked : {false, true}) {
          const RectangleSize size = select_size(rectangle_need({u, v, area}, 2), masked, 0, nullptr, {});
          if (size.single_color()) continue;
          const uvec2 sides = sides_of(size, masked);
          EXPECT_TRUE(std::min(sides.x, sides.y) >= 2 && std::max(sides.x, sides.y) <= 256 &&
                      sides.x % 2 == 0 && sides.y % 2 == 0);
        }
}

TEST(Spacing, DistancesAreOnAScaleOfOctaves) {
  scene::Scene scene = make_scene(1);
  const scene::Geometry& g = scene.geometries[0];
  // From the first corner's side: the far corners are 1 m farther.
  const Spacing spacing = spacing_for(g, g.patches[0], dmat4(1), {0, 0, 1});
  EXPECT_EQ(spacing[1], 21) << "twice as far: an octave";
  EXPECT_EQ(spacing[0], std::lround(21 * std::log2(std::sqrt(2.0))));
  // At a corner, and at the first.
  EXPECT_EQ(spacing_for(g, g.patches[0], dmat4(1), {1, 0, 0})[0], -126);
  EXPECT_EQ(spacing_for(g, g.patches[0], dmat4(1), {0, 0, 0}), Spacing{});
  const dmat4 nan(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(spacing_for(g, g.patches[0], nan, {0, 0, 1}), Spacing{});
}

TEST(Spacing, IsGoodWithinAnOctave) {
  const Spacing held{0, 10, -10, 126};
  for (size_t corner = 0; corner < held.size(); ++corner) {
    for (const int off : {-22, -21, 21, 22}) {
      Spacing wanted = held;
      const int code = held[corner] + off;
      if (code > 126) continue;
      wanted[corner] = static_cast<SpacingCode>(code);
      EXPECT_EQ(still_good(held, wanted), std::abs(off) <= 21) << corner << " off by " << off;
    }
  }
}

}  // namespace
}  // namespace tessera::atlas::coherent
