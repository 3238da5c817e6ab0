// All paths of the gather fill the same texels with the same colours.
#include <gmock/gmock.h>

#include <algorithm>

#include "atlas/addressing/addressing.h"
#include "scene_builder.h"
#include "shading/tessellator.h"
#include "test_world.h"

namespace tessera::shading::test {
namespace {

using atlas::Placement;
using atlas::PlacementKind;

// Three materials, all patch kinds, lights, shadows.
std::shared_ptr<scene::Scene> mixed_scene() {
  SceneBuilder b;
  // Textures of several sizes and encodings: several arrays on the device.
  scene::Material bumpy = wavy(b, false);
  bumpy.normal_texture.texture = b.texture(bumpy_texture(32));
  bumpy.metallic_roughness_texture.texture = b.texture(bumpy_texture(16));
  const uint32_t masked = b.material(wavy(b, true)), solid = b.material(bumpy);
  scene::Material plain{.base_color = vec4(0.4f, 0.7f, 0.2f, 1), .metallic = 0, .roughness = 0.5f};
  const uint32_t green = b.material(plain);
  b.instance(b.rectangle({-2, -0.5f, 2}, {4, 0, 0}, {0, 0, -4}, 4), solid);
  for (uint32_t t = 1; t <= 3; ++t)
    for (const uint32_t m : {masked, green, solid}) {
      scene::Node node;
      node.translation = {0.7 * t - 1.5, 0, 0.5 * m};
      b.instance(b.patch(t), m, node);
    }
  b.light({.type = scene::LightType::directional, .intensity = 3}, {}, {0.3, -1, -0.5});
  b.light({.type = scene::LightType::point, .color = vec3(1, 0.5f, 0.2f), .intensity = 4, .range = 5},
          {0, 1, 2}, {0, 0, -1});
  return b.build();
}

std::vector<Placement> block_placements(const scene::Scene& scene) {
  std::vector<Placement> placements;
  uint32_t x = 0, y = 0;
  for (scene::PatchId p = 0; p < scene.patch_count; ++p) {
    const bool masked =
        scene.materials[scene.instances[scene.instance_of(p)].material].alpha_mode == scene::AlphaMode::mask;
    if (p % 5 == 4) {
      placements.push_back({.patch = p, .kind = PlacementKind::color, .masked = masked});
      continue;
    }
    const auto log_h = static_cast<uint8_t>(1 + p % 5), log_w = static_cast<uint8_t>(log_h + p % 2);
    placements.push_back(block(p, x, y, log_w, log_h, p % 3 == 0, masked));
    // Sides of layout coherent are any even numbers.
    if (p % 4 == 3) placements.back().width = static_cast<uint16_t>(placements.back().width - 2);
    x += 64;
    if (x == 512) x = 0, y += 32;
  }
  return placements;
}

// Texels of one that differ from the other's by more than 1/255 in a channel.
size_t differing(const Image8& a, const Image8& b) {
  size_t count = 0;
  for (size_t i = 0; i < a.rgba.size(); i += 4) {
    int most = 0;
    for (size_t c = i; c < i + 4; ++c) most = std::max(most, std::abs(a.rgba[c] - b.rgba[c]));
    count += most > 1;
  }
  return count;
}

std::vector<bool> filled(const Image8& atlas) {
  std::vector<bool> texels;
  for (size_t i = 3; i < atlas.rgba.size(); i += 4) texels.push_back(atlas.rgba[i] != 0);
  return texels;
}

// Of more than `least` texels.
void expect_same(const GatherResult& a, const GatherResult& b, size_t least) {
  const std::vector<bool> texels = filled(a.atlas);
  const auto used = static_cast<size_t>(std::count(texels.begin(), texels.end(), true));
  EXPECT_GT(used, least);
  EXPECT_EQ(texels, filled(b.atlas));
  EXPECT_LE(differing(a.atlas, b.atlas), used / 1000) << "of " << used;
  EXPECT_EQ(a.stats.samples, b.stats.samples);
  EXPECT_EQ(a.colors, b.colors);
}

GatherResult gathered(const World& world, std::span<const Placement> placements, uint32_t side,
                      GatherPath path) {
  return gather(world, {0.5, 1.5, 4}, placements, {.width = side, .height = side, .path = path});
}

TEST(GatherPaths, FillBlocksAlike) {
  const auto scene = mixed_scene();
  const World world = make_world(scene);
  const std::vector<Placement> placements = block_placements(*scene);
  const GatherResult compute = gathered(world, placements, 512, GatherPath::compute);
  const GatherResult raster = gathered(world, placements, 512, GatherPath::raster);
  const GatherResult both = gathered(world, placements, 512, GatherPath::automatic);
  expect_same(compute, raster, 2'500);
  expect_same(compute, both, 2'500);
  EXPECT_EQ(compute.stats.raster_blocks, 0u);
  EXPECT_EQ(raster.stats.compute_blocks, 0u);
  EXPECT_GT(both.stats.raster_blocks, 0u);
  EXPECT_GT(both.stats.compute_blocks, 0u);
  EXPECT_EQ(compute.colors.size(), compute.stats.color_samples);
}

// Of layout tessellated: each triangle in a square of kCell texels of its own.
constexpr uint32_t kCell = 128, kAtlasSide = 1024;

Placement l_placement(uint32_t number, bool masked) {
  constexpr uint8_t kLevels[] = {1, 2, 3, 4, 7, 12, 21, 40, 63, 64};
  Placement p{.kind = PlacementKind::l, .masked = masked};
  p.l.level = kLevels[number % std::size(kLevels)];
  p.l.splits = p.l.level <= 21 && number % 4 == 1 ? 2 : 1;  // up to four pairs beside each other
  p.l.turned = !masked && number % 2 == 1;
  return p;
}

Placement halves_placement(uint32_t number, uint16_t x, uint16_t y) {
  struct Size {
    uint8_t across;
    uint16_t along[2];
  };
  // Those of 100 x 100 and 2 x 120 are of more samples than a triangle can have, and of few.
  constexpr Size kSizes[] = {{1, {1, 3}}, {20, {30, 9}}, {100, {100, 5}}, {2, {120, 1}}, {50, {120, 61}}};
  const Size& size = kSizes[number % std::size(kSizes)];
  Placement p{.kind = PlacementKind::halves};
  p.halves = {.apex = static_cast<uint8_t>(number % 3),
              .foot = static_cast<uint8_t>(7 * number % 64),
              .across = size.across};
  const atlas::addressing::ivec2 first = atlas::addressing::half_staircase(size.across, size.along[0]);
  const auto below = static_cast<uint16_t>(y + (first.x + 2) / 2 * 2);
  p.halves.half = {{{x, y, size.along[0], number % 2 == 0}, {x, below, size.along[1], number % 2 == 1}}};
  return p;
}

std::vector<Placement> triangle_placements(const scene::Scene& scene) {
  std::vector<Placement> placements;
  uint32_t cell = 0;
  for (scene::PatchId patch = 0; patch < scene.patch_count; ++patch) {
    const scene::Instance& instance = scene.instances[scene.instance_of(patch)];
    const bool masked = scene.materials[instance.material].alpha_mode == scene::AlphaMode::mask;
    const uint32_t triangles =
        scene.geometries[instance.geometry].patches[patch - instance.first_patch].triangle_count;
    for (uint32_t triangle = 0; triangle < triangles; ++triangle, ++cell) {
      const auto x = static_cast<uint16_t>(cell % 8 * kCell), y = static_cast<uint16_t>(cell / 8 * kCell);
      Placement p = !masked && cell % 3 == 0 ? halves_placement(cell / 3, x, y) : l_placement(cell, masked);
      p.patch = patch;
      p.part = atlas::part_of(triangle);
      p.x = x;
      p.y = y;
      p.spacing = {static_cast<atlas::SpacingCode>(cell % 40), -9};
      placements.push_back(p);
    }
  }
  EXPECT_LE(cell, 64u);
  return placements;
}

TEST(GatherPaths, FillTrianglesAlike) {
  const auto scene = mixed_scene();
  const World world = make_world(scene);
  const std::vector<Placement> placements = triangle_placements(*scene);
  const GatherResult compute = gathered(world, placements, kAtlasSide, GatherPath::compute);
  const GatherResult raster = gathered(world, placements, kAtlasSide, GatherPath::raster);
  const GatherResult tessellation = gathered(world, placements, kAtlasSide, GatherPath::tessellation);
  expect_same(compute, raster, 50'000);
  expect_same(compute, tessellation, 50'000);
  EXPECT_EQ(tessellation.stats.compute_blocks, 0u);
  EXPECT_EQ(tessellation.stats.raster_blocks, 0u);
  EXPECT_GT(tessellation.stats.tessellated_blocks, placements.size());
  EXPECT_EQ(tessellation.stats.half_samples, compute.stats.half_samples);
  EXPECT_EQ(compute.stats.tessellated_blocks, 0u);
}

TEST(GatherPaths, TessellationLeavesBlocksAndColoursToCompute) {
  const auto scene = mixed_scene();
  const World world = make_world(scene);
  const std::vector<Placement> placements = block_placements(*scene);
  const GatherResult compute = gathered(world, placements, 512, GatherPath::compute);
  const GatherResult tessellation = gathered(world, placements, 512, GatherPath::tessellation);
  EXPECT_EQ(compute.atlas.rgba, tessellation.atlas.rgba);
  EXPECT_EQ(compute.colors, tessellation.colors);
  EXPECT_EQ(tessellation.stats.tessellated_blocks, 0u);
}

// Many small triangles of one material, over the limits of a draw.
TEST(GatherPaths, TessellationGoesOnFromDrawToDraw) {
  SceneBuilder b;
  b.instance(b.rectangle({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 64), b.material({.unlit = true}));
  const auto scene = b.build();
  const World world = make_world(scene);
  std::vector<Placement> placements;
  for (uint32_t i = 0; i < 2 * scene->patch_count; ++i) {
    Placement p{.patch = i / 2, .part = atlas::part_of(i % 2), .kind = PlacementKind::l};
    p.x = static_cast<uint16_t>(i / 2 % 64 * 10);
    p.y = static_cast<uint16_t>(i / 128 * 6);
    p.l = {.level = 4, .turned = i % 2 == 1};
    placements.push_back(p);
  }
  uint64_t draws = device().draws_recorded();
  gathered(world, std::span(placements).first(1), 640, GatherPath::tessellation);
  const uint64_t draws_of_one = device().draws_recorded() - draws;  // with those of the device's check
  draws = device().draws_recorded();
  const GatherResult tessellation = gathered(world, placements, 640, GatherPath::tessellation);
  EXPECT_EQ(device().draws_recorded() - draws - draws_of_one, 8192u * 19 / kMaxPointsADraw);
  expect_same(gathered(world, placements, 640, GatherPath::compute), tessellation, 100'000);
}

}  // namespace
}  // namespace tessera::shading::test
