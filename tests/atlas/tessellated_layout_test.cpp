#include "atlas/tessellated/layout.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "atlas/addressing/addressing.h"
#include "atlas/tessellated/packing.h"
#include "atlas/tessellated/triangles.h"
#include "occupancy.h"

namespace tessera::atlas::tessellated {
namespace {

using scene::VisiblePatches;

// Quads and lone triangles of 1 m in a row along -Z, on the ground; the second instance, 1 m to the right, is
// masked.
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
    const auto first = static_cast<uint32_t>(g.indices.size() / 3);
    const uint32_t triangles = i % 3 == 0 ? 1 : 2;
    for (const uint32_t corner : {0, 1, 2, 3, 2, 1})
      if (g.indices.size() < 3 * (first + triangles)) g.indices.push_back(4 * i + corner);
    g.patches.push_back({.first_triangle = first, .triangle_count = triangles});
  }
  scene.materials.resize(2);
  scene.materials[1].alpha_mode = scene::AlphaMode::mask;
  scene.nodes.resize(2);
  scene.nodes[1].translation = {1, 0, 0};
  scene.instances = {{0, 0, 0}, {0, 1, 1}};
  scene.index_instances();
  return scene;
}

// Takes the texels of every sample of a placement.
bool take(Occupancy& occupancy, const Placement& p, uint32_t atlas_width) {
  const auto take_one = [&](const glm::ivec2& at) {
    return occupancy.take(static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y), 1, 1);
  };
  bool free = true;
  if (p.kind == PlacementKind::l) {
    const int level = p.l.level, ls = p.l.splits * p.l.splits;
    const int begin = p.masked ? 0 : p.l.turned, end = begin + (p.masked ? 2 * ls : ls);
    for (int half = begin; half < end; ++half) {
      const glm::ivec2 pair =
          addressing::l_pair_place(half / 2, {p.x, p.y}, p.l.next_y, level, static_cast<int>(atlas_width));
      for (int i = 0; i < addressing::l_samples(level); ++i)
        free &=
            take_one(pair + addressing::l_pair_texel(addressing::l_sample(i, level), half % 2 == 1, level));
    }
  } else if (p.kind == PlacementKind::halves) {
    for (const HalfPlace& half : p.halves.half) {
      const glm::ivec2 size = addressing::half_staircase(p.halves.across, half.along);
      for (int y = 0; y <= size.y; ++y)
        for (int x = 0; x < addressing::staircase_row(y, size); ++x)
          free &= take_one(glm::ivec2(half.x, half.y) + addressing::half_texel({x, y}, size, half.turned));
    }
  }
  return free;
}

class TessellatedLayout : public testing::Test {
 protected:
  void make(uint32_t patches, LayoutSettings settings = {}) {
    scene_ = make_scene(patches);
    settings_ = settings;
    layout_ = *Layout::create(scene_, settings);
    for (const scene::Instance& instance : scene_.instances)
      transforms_.push_back(scene_.node_transforms(0)[instance.node]);
  }

  // One frame; a client that knows only the deltas must hold the same, and nothing overlaps.
  void update(const VisiblePatches& visible, const dvec3& eye = {0.5, 1.7, 1}) {
    const LayoutDelta delta = layout_->update({visible, eye, transforms_});
    for (const scene::PatchId patch : delta.removed)
      EXPECT_GT(std::erase_if(mirror_, [&](const auto& entry) { return entry.first.first == patch; }), 0u);
    for (const Placement& p : delta.changed) {
      const auto [at, is_new] = mirror_.try_emplace({p.patch, p.part}, p);
      EXPECT_TRUE(is_new || at->second != p);
      at->second = p;
    }
    EXPECT_EQ(mirror_.size(), layout_->placements().size());
    Occupancy occupancy(settings_.width, settings_.height);
    auto next = mirror_.begin();
    for (const Placement& p : layout_->placements()) {
      EXPECT_EQ((next++)->second, p) << "sorted by patch and part";
      EXPECT_TRUE(take(occupancy, p, settings_.width)) << p.patch;
      EXPECT_FALSE(p.masked && (p.l.turned || p.kind == PlacementKind::halves));
    }
    EXPECT_EQ(layout_->stats().used_texels, occupancy.texels());
    // The same, as rectangles.
    Occupancy rectangles(settings_.width, settings_.height);
    for (const Placement& p : layout_->placements()) {
      visit_samples(p, settings_.width, [&](const TexelRectangle& r) {
        EXPECT_TRUE(rectangles.take(r.x, r.y, r.width, r.height));
      });
    }
    EXPECT_EQ(rectangles.taken(), occupancy.taken());
  }

  scene::Scene scene_;
  LayoutSettings settings_;
  std::vector<dmat4> transforms_;
  std::unique_ptr<Layout> layout_;
  std::map<std::pair<scene::PatchId, PatchPart>, Placement> mirror_;
};

VisiblePatches rectangles(uint32_t count, float u, float v) {
  VisiblePatches visible;
  for (uint32_t i = 0; i < count; ++i) visible.push_back({i, {u, v, u * v}});
  return visible;
}

TEST_F(TessellatedLayout, RefusesOddAndHugeAtlasesAndNoSlantedness) {
  const scene::Scene scene = make_scene(1);
  for (const auto& [width, height] : {std::pair{0u, 256u}, {255u, 256u}, {256u, 8194u}})
    EXPECT_EQ(Layout::create(scene, {.width = width, .height = height}).status().code(),
              absl::StatusCode::kInvalidArgument);
  EXPECT_FALSE(Layout::create(scene, {.slantedness = 0.5f}).ok());
}

TEST_F(TessellatedLayout, RandomSetsKeepEveryRule) {
  make(300, {.width = 512, .height = 320});
  std::mt19937 random(3);
  uint32_t halves = 0, ls = 0, without_room = 0;
  for (int frame = 0; frame < 60; ++frame) {
    VisiblePatches visible;
    const float zoom = std::exp2(5 * std::sin(0.3f * static_cast<float>(frame)));
    for (scene::PatchId p = 0; p < scene_.patch_count; ++p) {
      if (random() % 10 == 0) continue;
      const float u = zoom * static_cast<float>(1 + p % 13), v = zoom * static_cast<float>(1 + p % 7);
      visible.push_back({p, {u, v, u * v}});
    }
    update(visible, {0.5, 0.2 + 0.1 * (frame % 9), -2.0 * frame});
    halves += layout_->stats().halves;
    ls += layout_->stats().blocks - layout_->stats().halves;
    without_room += layout_->stats().colors_out_of_memory;
  }
  EXPECT_GT(halves, 1000u);
  EXPECT_GT(ls, 1000u);
  EXPECT_LT(without_room, ls / 100) << "the bias is chosen so that all fits";
}

TEST_F(TessellatedLayout, AFullAtlasFallsBackToColors) {
  make(1000, {.width = 256, .height = 256, .levels = {.max_bias = 0}});
  update(rectangles(2000, 40, 40));
  EXPECT_GT(layout_->stats().colors_out_of_memory, 0u);
  EXPECT_GT(layout_->stats().used_texels, 256u * 256 * 7 / 10);
  update(rectangles(10, 40, 40));
  EXPECT_EQ(layout_->stats().colors_out_of_memory, 0u);
}

TEST_F(TessellatedLayout, OneTriangleFillsTheAtlas) {
  make(1);
  update(rectangles(1, 4000, 4000), {0.3, 0.4, -0.3});
  const Placement& p = layout_->placements()[0];
  EXPECT_GT(p.l.splits, 4) << "far beyond the highest level";
  EXPECT_GT(layout_->stats().used_texels, 2048u * 1024 * 8 / 10);
}

TEST_F(TessellatedLayout, SmallAtlasesHoldWhatTheyCan) {
  for (const uint32_t side : {8u, 16u, 64u}) {
    transforms_.clear();
    mirror_.clear();
    make(20, {.width = side, .height = side});
    update(rectangles(40, 300, 100));
    update(rectangles(1, 3000, 30));
  }
}

TEST_F(TessellatedLayout, AnyEyeAndFootprintGiveValidPlacements) {
  constexpr float kInf = std::numeric_limits<float>::infinity(),
                  kNan = std::numeric_limits<float>::quiet_NaN();
  make(4, {.width = 256, .height = 256});
  const double nan = kNan;
  const dvec3 eyes[] = {{0, 0, 0}, {0.5, 0, 0.5}, {0, 1e-300, 0}, {1e300, 0, 0}, {nan, 0, 0}, {0.2, -1, 30}};
  for (const dvec3& eye : eyes)
    for (const float side : {0.0f, 1e-38f, 1.0f, 300.0f, 3e38f, kInf, kNan, -1.0f})
      for (const float area : {0.0f, 1e-38f, 5.0f, 1e5f, 3e38f, kInf, kNan}) {
        VisiblePatches visible;
        for (scene::PatchId p = 0; p < scene_.patch_count; ++p) visible.push_back({p, {side, side, area}});
        update(visible, eye);
      }
}

TriangleNeed need(float base, float height, bool masked = false) {
  return {.area = 0.5f * base * height, .base = base, .foot = 0.4f, .masked = masked};
}

TEST(TessellatedShapes, SamplesMatchTheArea) {
  const ShapeLimits limits = limits_for(2048, 1024);
  for (float side = 12; side < 1500; side *= 1.07f) {
    const Shape shape = select_shape(need(side, 0.866f * side), 0, {}, limits);
    ASSERT_EQ(shape.kind, PlacementKind::l);
    const float intervals = float(shape.level) * shape.splits;
    EXPECT_NEAR(0.75f * intervals * intervals / (0.433f * side * side), 1, 0.13f) << side;
    EXPECT_EQ(shape.splits, int(std::ceil(std::sqrt(0.433f * side * side / 0.75f) / 64)));
  }
  const Shape slanted = select_shape(need(200, 10), 0, {}, limits);
  EXPECT_EQ(slanted.kind, PlacementKind::halves);
  EXPECT_EQ(slanted.across, 10);
  EXPECT_EQ(slanted.along[0] + slanted.along[1], 200);
  EXPECT_EQ(slanted.along[0], 80) << "the foot's part";
  const Shape sparser = select_shape(need(200, 10), 2, {}, limits);
  EXPECT_EQ(sparser.across, 5);
  EXPECT_EQ(sparser.along[0] + sparser.along[1], 100);
}

TEST(TessellatedShapes, SlantedOnesAreHalvesUnlessMaskedOrTooLarge) {
  const ShapeLimits limits = limits_for(2048, 1024);
  const LayoutSettings settings{.slantedness = 4};
  EXPECT_EQ(select_shape(need(100, 26), 0, settings, limits).kind, PlacementKind::l);
  EXPECT_EQ(select_shape(need(100, 24), 0, settings, limits).kind, PlacementKind::halves);
  EXPECT_EQ(select_shape(need(100, 24, true), 0, settings, limits).kind, PlacementKind::l);
  EXPECT_EQ(select_shape(need(3000, 200), 0, settings, limits).kind, PlacementKind::l);
  EXPECT_EQ(select_shape(need(1, 1), 0, settings, limits).kind, PlacementKind::color);
}

TEST(TessellatedShapes, ASmallerTargetNeverGivesASmallerBiasAndIsMet) {
  std::mt19937 random(5);
  std::vector<TriangleNeed> needs;
  for (int i = 0; i < 3000; ++i) {
    const float base = std::exp2(static_cast<float>(random() % 90) / 10);
    needs.push_back(need(base, base / static_cast<float>(1 + random() % 12), i % 7 == 0));
  }
  const ShapeLimits limits = limits_for(2048, 1024);
  float before = -10;
  for (double target = 4e6; target > 1e4; target *= 0.7) {
    const float bias = select_bias(needs, target, {}, limits);
    EXPECT_GE(bias, before);
    before = bias;
    uint64_t texels = 0;
    for (const TriangleNeed& n : needs) texels += texels_of(select_shape(n, bias, {}, limits), n.masked);
    EXPECT_TRUE(static_cast<double>(texels) <= target || bias == LevelSettings{}.max_bias);
  }
}

TEST(TessellatedShapes, TrianglesShareTheFootprintOfTheirPatch) {
  const scene::Scene scene = make_scene(2);
  const scene::Geometry& g = scene.geometries[0];
  std::array<SeenTriangle, 3> seen, denser;
  const scene::Footprint footprint{100, 60, 4800};
  ASSERT_EQ(see(g, g.patches[1], footprint, dmat4(1), {0.2, 1, 3}, seen), 2u);
  EXPECT_NEAR(seen[0].need.area + seen[1].need.area, 4800, 1);
  EXPECT_GT(seen[0].need.area, seen[1].need.area) << "the nearer one is larger";
  // Of what scales the footprint.
  see(g, g.patches[1], {200, 120, 4 * 4800.0f}, dmat4(1), {0.2, 1, 3}, denser);
  EXPECT_NEAR(denser[0].need.area / seen[0].need.area, 4, 1e-3);
  EXPECT_NEAR(denser[0].need.base / seen[0].need.base, 2, 1e-3);
  // Right angles at corner 0, seen from above: the base lies opposite, the foot in its middle.
  see(g, g.patches[1], footprint, dmat4(1), {0.5, 1e4, -1.5}, seen);
  EXPECT_EQ(seen[0].need.apex, 0);
  EXPECT_NEAR(seen[0].need.foot, 0.5, 1e-3);
  EXPECT_EQ(seen[0].spacing, (std::array<SpacingCode, 2>{0, 0}));
}

TEST(LayoutDelta, ComparesByPatchAndPart) {
  const auto at = [](scene::PatchId patch, PatchPart part, uint16_t x) {
    return Placement{.patch = patch, .part = part, .kind = PlacementKind::l, .x = x};
  };
  const std::vector<Placement> before{at(1, 1, 0), at(1, 2, 0), at(3, 1, 0), at(3, 2, 0), at(9, 1, 0)};
  const std::vector<Placement> after{at(1, 1, 0), at(1, 2, 4), at(2, 1, 0), at(9, 1, 0)};
  const LayoutDelta delta = difference(before, after);
  EXPECT_EQ(delta.changed, (std::vector<Placement>{at(1, 2, 4), at(2, 1, 0)}));
  EXPECT_EQ(delta.removed, std::vector<scene::PatchId>{3}) << "once, not once a part";
  EXPECT_EQ(difference(after, {}).removed, (std::vector<scene::PatchId>{1, 2, 9}));
}

// As texels, the second one turned and `offset` to the right.
bool overlap(glm::ivec2 size, glm::ivec2 turned, int offset) {
  for (int y = 0; y <= size.y; ++y)
    for (int x = 0; x < addressing::staircase_row(y, size); ++x) {
      const glm::ivec2 texel = addressing::half_texel({x, y}, size, false) - glm::ivec2(offset, 0);
      if (addressing::staircase_contains(addressing::half_sample(texel, turned, true), turned)) return true;
    }
  return false;
}

TEST(TessellatedPacking, NestedHalvesNeverOverlapAndAreTight) {
  for (int width = 1; width <= 7; ++width)
    for (int a = width; a <= 40; a += 3)
      for (int b = width; b <= 40; ++b) {
        const glm::ivec2 size(width, a), turned(width, b);
        const int offset = nesting_offset(size, turned);
        ASSERT_FALSE(overlap(size, turned, offset)) << width << " " << a << " " << b;
        ASSERT_TRUE(offset == 0 || overlap(size, turned, offset - 1)) << width << " " << a << " " << b;
      }
}

}  // namespace
}  // namespace tessera::atlas::tessellated
