// Which path shades what: the decision on made-up tables, and that it changes no picture.
#include <gmock/gmock.h>

#include <limits>

#include "scene/procedural.h"
#include "shading/gather_cost.h"
#include "test_world.h"

namespace tessera::shading::test {
namespace {

constexpr size_t kCompute = 0, kRaster = 1;

GatherCosts flat(double compute_ns, double raster_ns) {
  GatherCosts costs;
  for (auto& by_size : costs.ns)
    for (auto& by_path : by_size) {
      by_path.fill(std::numeric_limits<double>::infinity());
      by_path[kCompute] = compute_ns;
      by_path[kRaster] = raster_ns;
    }
  return costs;
}

TEST(GatherChoice, SizeClassesAreLogarithmsOfSamples) {
  EXPECT_EQ(size_class(0), 0u);
  EXPECT_EQ(size_class(1), 0u);
  EXPECT_EQ(size_class(2), 1u);
  EXPECT_EQ(size_class(255), 7u);
  EXPECT_EQ(size_class(256), 8u);
  EXPECT_EQ(size_class(~uint64_t{0}), kSizeClasses - 1);
}

TEST(GatherChoice, TakesTheCheapestOfEachShapeAndSize) {
  GatherCosts costs = flat(100, 200);
  EXPECT_EQ(cheapest(costs), only(GatherPath::compute));
  EXPECT_EQ(cheapest(flat(200, 100)), only(GatherPath::raster));
  costs.ns[static_cast<size_t>(GatherShape::block)][8][kRaster] = 50;
  costs.ns[static_cast<size_t>(GatherShape::half)][3][kRaster] = 50;
  const GatherChoice choice = cheapest(costs);
  EXPECT_EQ(choice.of(GatherShape::block, 255), GatherPath::compute);
  EXPECT_EQ(choice.of(GatherShape::block, 256), GatherPath::raster);
  EXPECT_EQ(choice.of(GatherShape::block, 511), GatherPath::raster);
  EXPECT_EQ(choice.of(GatherShape::block, 512), GatherPath::compute);
  EXPECT_EQ(choice.of(GatherShape::half, 8), GatherPath::raster);
  EXPECT_EQ(choice.of(GatherShape::l, 8), GatherPath::compute);
  EXPECT_TRUE(choice.uses(GatherPath::raster));
  EXPECT_FALSE(only(GatherPath::compute).uses(GatherPath::raster));
}

TEST(GatherChoice, NothingIsShadedByWhatCannot) {
  GatherCosts costs = flat(100, 200);
  for (auto& by_size : costs.ns)
    for (auto& by_path : by_size) by_path.back() = 1;
  const GatherChoice choice = cheapest(costs);
  EXPECT_EQ(choice, only(GatherPath::tessellation));
  EXPECT_EQ(choice.of(GatherShape::block, 4096), GatherPath::compute);
  EXPECT_EQ(choice.of(GatherShape::l, 4096), GatherPath::tessellation);
}

TEST(GatherChoice, NoiseAndWhatIsNoNumberDecideNothing) {
  EXPECT_EQ(cheapest(flat(100, 96)), only(GatherPath::compute));
  EXPECT_EQ(cheapest(flat(100, 94)), only(GatherPath::raster));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(cheapest(flat(100, nan)), only(GatherPath::compute));
  EXPECT_EQ(cheapest(flat(nan, 100)), only(GatherPath::raster));
  EXPECT_EQ(cheapest(flat(nan, nan)), only(GatherPath::compute));
  EXPECT_EQ(cheapest(GatherCosts{}), only(GatherPath::compute));
}

TEST(GatherChoice, ReadsAsWhatChangesWhere) {
  GatherChoice choice = only(GatherPath::compute);
  auto& blocks = choice.paths[static_cast<size_t>(GatherShape::block)];
  std::fill(blocks.begin() + 6, blocks.end(), GatherPath::raster);
  EXPECT_EQ(to_text(choice), "block: compute, raster from 64 samples; L: compute; half: compute");
}

TEST(GatherChoice, PathsHaveNames) {
  for (const GatherPath path : kGatherPaths) EXPECT_EQ(gather_path_named(name_of(path)), path);
  EXPECT_EQ(gather_path_named("auto"), GatherPath::automatic);
  EXPECT_EQ(gather_path_named("fast"), std::nullopt);
}

TEST(GatherCost, ALoadHasItsSamplesAndFitsTheAtlas) {
  const auto scene = scene::make_gallery(0);
  const LoadTriangle triangles[] = {{3, 0}, {1, 0}};
  for (const LoadShape& shape : {LoadShape{GatherShape::block, 8}, LoadShape{GatherShape::l, 5},
                                 LoadShape{GatherShape::half, 4, 12}}) {
    const std::vector<atlas::Placement> load = make_load(shape, triangles, 10'000, 512, 512);
    uint64_t samples = 0;
    for (const atlas::Placement& p : load) samples += p.texels();
    EXPECT_GE(samples, 10'000u);
    EXPECT_LT(samples, 10'200u);
    const std::vector<atlas::Placement> full = make_load(shape, triangles, 1'000'000, 64, 64);
    EXPECT_GT(full.size(), 1u);
    for (const atlas::Placement& p : full)
      visit_samples(p, 64, [](const atlas::TexelRectangle& r) {
        EXPECT_LE(r.x + r.width, 64u);
        EXPECT_LE(r.y + r.height, 64u);
      });
  }
  EXPECT_TRUE(make_load({GatherShape::block, 8}, {}, 100, 64, 64).empty());
}

TEST(GatherCost, EveryShapeSizeAndPathHasATime) {
  const World world = make_world(scene::make_gallery(0));
  const auto costs = measure_gather_costs(device(), *world.gpu_scene, *world.instant, *world.lighting,
                                          {.samples = 1024, .rounds = 1});
  ASSERT_TRUE(costs.ok()) << costs.status();
  for (const auto& by_size : costs->ns)
    for (const auto& by_path : by_size)
      for (const double ns : by_path) EXPECT_GT(ns, 0);
}

// Every table decides how long a picture takes, none what it shows.
TEST(GatherChoice, ChangesNoPicture) {
  const auto scene = scene::make_gallery(0);
  const World world = make_world(scene);
  std::vector<atlas::Placement> placements;
  uint32_t y = 0;
  for (const LoadShape& shape : {LoadShape{GatherShape::block, 4}, LoadShape{GatherShape::block, 16},
                                 LoadShape{GatherShape::l, 7}, LoadShape{GatherShape::half, 5, 20}}) {
    std::vector<LoadTriangle> triangles;
    for (scene::PatchId p = y; p < scene->patch_count && triangles.size() < 40; p += 7)
      if (scene->materials[scene->instances[scene->instance_of(p)].material].alpha_mode !=
          scene::AlphaMode::mask)
        triangles.push_back({p, 0});
    for (atlas::Placement p : make_load(shape, triangles, 4000, 256, 64)) {
      p.y = static_cast<uint16_t>(p.y + y);
      p.l.next_y = static_cast<uint16_t>(p.l.next_y + y);
      for (atlas::HalfPlace& half : p.halves.half) half.y = static_cast<uint16_t>(half.y + y);
      placements.push_back(p);
    }
    y += 64;
  }
  GatherSettings settings{.width = 256, .height = 256, .path = GatherPath::compute};
  const GatherResult compute = gather(world, {0, 1.6, 0}, placements, settings);
  GatherCosts mixed = flat(100, 200);
  for (auto& by_size : mixed.ns)
    for (size_t size = 0; size < kSizeClasses; size += 2) by_size[size][kRaster] = 50;
  for (const GatherChoice& choice :
       {only(GatherPath::raster), only(GatherPath::tessellation), cheapest(mixed), software_choice()}) {
    settings.path = GatherPath::automatic;
    settings.choice = choice;
    const GatherResult other = gather(world, {0, 1.6, 0}, placements, settings);
    EXPECT_EQ(other.stats.samples, compute.stats.samples);
    EXPECT_GT(other.stats.raster_blocks + other.stats.tessellated_blocks, 0u);
    size_t used = 0, differing = 0;
    for (size_t i = 0; i < compute.atlas.rgba.size(); ++i) {
      used += compute.atlas.rgba[i | 3] != 0;
      differing += std::abs(compute.atlas.rgba[i] - other.atlas.rgba[i]) > 1;
      if (i % 4 == 3) {
        ASSERT_EQ(compute.atlas.rgba[i], other.atlas.rgba[i]) << "used by one path alone";
      }
    }
    EXPECT_GT(used, 4u * 10'000);
    EXPECT_LE(differing, used / 1000) << to_text(choice);
  }
}

}  // namespace
}  // namespace tessera::shading::test
