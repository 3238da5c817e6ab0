#include "bench/texel_shading.h"

#include <gtest/gtest.h>

#include "bench/texel_shader.h"
#include "scene/procedural.h"
#include "server/shared_scene.h"
#include "shading/gather.h"

namespace tessera::bench {
namespace {

// A square of 2 m in the plane z = 0, of one patch.
scene::Scene square() {
  scene::Scene s;
  scene::Geometry g;
  for (const vec2 at : {vec2(-1, 1), vec2(1, 1), vec2(-1, -1), vec2(1, -1)})
    g.vertices.push_back({.position = vec3(at, 0), .normal = {0, 0, 1}, .color = ~0u});
  g.indices = {0, 2, 1, 3, 1, 2};
  g.patches = {{0, 2}};
  g.meshlets = {{0, 2, 0, 1, {}, 2}};
  s.geometries = {g};
  s.materials.resize(1);
  s.nodes.resize(1);
  s.instances = {{.geometry = 0, .material = 0, .node = 0}};
  s.index_instances();
  return s;
}

// Looks along -Z from so far away; a pixel is as wide as 1 m / side at 1 m.
View view_from(double distance, uint32_t side) {
  View view{.fov = {-0.5f, 0.5f, -0.5f, 0.5f}, .width = side, .height = side};
  view.pose.position = {0, 0, distance};
  return view;
}

std::vector<dmat4> transforms_of(const scene::Scene& s) {
  return std::vector<dmat4>(s.instances.size(), dmat4(1));
}

TEST(UniqueTexture, TakesItsBudgetAndNoMore) {
  const auto s = scene::make_gallery(0);
  const auto nodes = s->node_transforms(0);
  std::vector<dmat4> transforms;
  for (const scene::Instance& instance : s->instances) transforms.push_back(nodes[instance.node]);
  for (const uint64_t budget : {uint64_t{1} << 20, uint64_t{1} << 22}) {
    const auto texture = UniqueTexture::create(*s, transforms, budget);
    ASSERT_TRUE(texture.ok()) << texture.status();
    EXPECT_LE(texture->texels(), budget);
    EXPECT_GT(texture->texels(), budget * 9 / 10);
    // Patches do not overlap: of each, its own corners show it.
    for (uint32_t i = 0; i < s->instances.size(); ++i)
      for (uint32_t p = 0; p < texture->patches(i).size(); ++p) {
        const TexelRectangle& r = texture->patches(i)[p];
        for (const uvec2 corner : {uvec2(r.x, r.y), uvec2(r.x + r.width - 1, r.y + r.height - 1)}) {
          ASSERT_LT(corner.x, texture->size(i, 0).x);
          ASSERT_LT(corner.y, texture->size(i, 0).y);
          EXPECT_EQ(texture->texel(i, 0, corner).patch, p);
        }
      }
  }
  EXPECT_EQ(UniqueTexture::create(*s, transforms, 64).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(UniqueTexture, ALookupShowsThePointThatThePixelSees) {
  const scene::Scene s = square();
  const auto transforms = transforms_of(s);
  const auto texture = UniqueTexture::create(s, transforms, 1 << 16);
  ASSERT_TRUE(texture.ok()) << texture.status();
  const TexelRectangle r = texture->patches(0)[0];
  const View view = view_from(1, 256);  // sees from -0.5 to 0.5
  for (const uvec2 pixel : {uvec2(0, 0), uvec2(255, 0), uvec2(10, 200), uvec2(200, 10)}) {
    const vec2 world((static_cast<float>(pixel.x) + 0.5f) / 256 - 0.5f,
                     0.5f - (static_cast<float>(pixel.y) + 0.5f) / 256);
    const uint32_t triangle = world.x <= world.y ? 0 : 1;
    const TexelLookup at = texture->lookup(triangle, view, pixel, transforms);
    EXPECT_EQ(at.level, 0u);
    // The patch's u runs along the first edge, from (-1, 1) down to (-1, -1).
    const vec2 uv(0.5f * (1 - world.y), 0.5f * (world.x + 1));
    EXPECT_NEAR(at.position.x, static_cast<float>(r.x) + uv.x * static_cast<float>(r.width - 1), 0.01f);
    EXPECT_NEAR(at.position.y, static_cast<float>(r.y) + uv.y * static_cast<float>(r.height - 1), 0.01f);
  }
}

TEST(UniqueTexture, ALevelUpForTwiceTheDistance) {
  const scene::Scene s = square();
  const auto transforms = transforms_of(s);
  const auto texture = UniqueTexture::create(s, transforms, 1 << 20);
  ASSERT_TRUE(texture.ok()) << texture.status();
  const auto level = [&](double distance) {
    return texture->lookup(0, view_from(distance, 64), {30, 30}, transforms).level;
  };
  // About 500 texels a metre; a pixel is distance / 64 m.
  EXPECT_EQ(level(2), level(1) + 1);
  EXPECT_EQ(level(4), level(1) + 2);
  EXPECT_EQ(level(1e9), texture->levels(0) - 1);
  EXPECT_EQ(texture->size(0, texture->levels(0) - 1), uvec2(1, 1));
}

TEST(UniqueTexture, TilesOfAPictureAreThoseThatItReads) {
  const scene::Scene s = square();
  const auto transforms = transforms_of(s);
  const auto texture = UniqueTexture::create(s, transforms, 1 << 18);
  ASSERT_TRUE(texture.ok()) << texture.status();
  const View view = view_from(1, 64);
  std::vector<uint32_t> ids(64 * 64, 0);
  EXPECT_TRUE(texture->visible_tiles(ids, view, transforms).empty());
  for (uint32_t y = 0; y < 64; ++y)
    for (uint32_t x = 0; x < 64; ++x) ids[64 * y + x] = x + y < 64 ? 1 : 2;
  const std::vector<TexelTile> tiles = texture->visible_tiles(ids, view, transforms);
  ASSERT_FALSE(tiles.empty());
  EXPECT_TRUE(std::ranges::is_sorted(tiles));
  uint64_t samples = 0;
  for (const TexelTile& tile : tiles) {
    EXPECT_EQ(tile.level, tiles[0].level);
    const uvec2 size = texture->size(0, tile.level);
    EXPECT_LT(tile.x * kTexelTile, size.x);
    EXPECT_LT(tile.y * kTexelTile, size.y);
    samples += texture->samples(tile);
  }
  // A pixel has 0.5 to 2 texels along each side, and tiles reach beyond the picture.
  EXPECT_GT(samples, 64u * 64 / 4);
  EXPECT_LT(samples, 64u * 64 * 4 + 4 * 160 * kTexelTile);
  // A quarter of the square is seen, so at most about a quarter of the tiles and the border.
  const uvec2 all = (texture->size(0, tiles[0].level) + 7u) / 8u;
  EXPECT_LT(tiles.size(), all.x * all.y / 2);
}

// A texel of the finest level shows what a block of that size shows there.
TEST(TexelShader, AgreesWithTheGather) {
  auto device = gpu::Device::create({.select = "cpu"});
  ASSERT_TRUE(device.ok()) << device.status();
  auto lit = std::make_shared<scene::Scene>(square());
  lit->lights = {{.type = scene::LightType::point, .intensity = 5, .node = 1}};
  lit->nodes.push_back({.translation = {0.3, 0.4, 1}});
  lit->index_instances();
  const auto shared = server::SharedScene::create(*device, lit);
  ASSERT_TRUE(shared.ok()) << shared.status();
  const auto instant = scene::SceneInstant::create(**device, (*shared)->gpu_scene());
  ASSERT_TRUE(instant.ok()) << instant.status();
  (*instant)->set(0, {});
  ASSERT_TRUE((*shared)->lighting().update(**instant).ok());
  const View view = view_from(2, 1 << 16);

  const auto texture = UniqueTexture::create(*lit, transforms_of(*lit), 64 * 64);
  ASSERT_TRUE(texture.ok()) << texture.status();
  const TexelRectangle r = texture->patches(0)[0];
  const auto shader = TexelShader::create(**device, (*shared)->gpu_scene(), (*shared)->lighting(), *texture);
  ASSERT_TRUE(shader.ok()) << shader.status();
  std::vector<TexelTile> tiles;
  for (uint32_t y = 0; y < texture->size(0, 0).y / kTexelTile; ++y)
    for (uint32_t x = 0; x < texture->size(0, 0).x / kTexelTile; ++x) tiles.push_back({0, 0, x, y});
  const auto shaded = (*shader)->shade(**instant, view, tiles);
  ASSERT_TRUE(shaded.ok()) << shaded.status();
  EXPECT_EQ(shaded->samples, r.width * r.height);
  EXPECT_GT(shaded->gpu_ms, 0);

  const auto gather = shading::Gather::create(**device, (*shared)->gpu_scene(), (*shared)->lighting(),
                                              {.width = 128, .height = 128});
  ASSERT_TRUE(gather.ok()) << gather.status();
  const atlas::Placement block{.patch = 0,
                               .kind = atlas::PlacementKind::block,
                               .width = static_cast<uint16_t>(r.width),
                               .height = static_cast<uint16_t>(r.height)};
  auto readback = gpu::Buffer::create(**device, 4 * 128 * 128, gpu::Memory::readback, "test atlas");
  ASSERT_TRUE(readback.ok()) << readback.status();
  gpu::Commands commands = (*device)->begin();
  ASSERT_TRUE((*gather)->record(commands, **instant, view, {&block, 1}).ok());
  commands.copy_to_buffer((*gather)->image(), *readback);
  commands.barrier();
  ASSERT_TRUE((*device)->run(std::move(commands)).ok());
  const auto atlas = readback->as<const uint8_t>();
  int brightest = 0;
  for (size_t t = 0; t < tiles.size(); ++t)
    for (uint32_t i = 0; i < kTexelTileTexels; ++i) {
      const uint32_t x = tiles[t].x * kTexelTile + i % kTexelTile,
                     y = tiles[t].y * kTexelTile + i / kTexelTile;
      const uint32_t color = shaded->colors[t * kTexelTileTexels + i];
      const bool inside = x < r.width && y < r.height;
      EXPECT_EQ(color >> 24, inside ? 255u : 0u) << x << "," << y;
      for (int c = 0; c < 3 && inside; ++c) {
        const int texel = static_cast<int>(color >> (8 * c) & 0xff);
        EXPECT_NEAR(texel, atlas[4 * (128 * y + x) + static_cast<size_t>(c)], 1) << x << "," << y;
        brightest = std::max(brightest, texel);
      }
    }
  EXPECT_GT(brightest, 100);
}

}  // namespace
}  // namespace tessera::bench
