// The gather: known answers by position, on every path, and the truth's colours.
#include <gmock/gmock.h>

#include "atlas/addressing/addressing.h"
#include "scene_builder.h"
#include "shader_functions.h"
#include "test_world.h"

namespace tessera::shading::test {
namespace {

using atlas::Placement;
using atlas::PlacementKind;

float linear(uint8_t byte) {
  return srgb_decode(static_cast<float>(byte) / 255);
}

// Vertex colours carry the block coordinates; unlit shows them as they are.
scene::Material coordinates() {
  return {.unlit = true};
}

class EveryPath : public testing::TestWithParam<GatherPath> {
 protected:
  GatherSettings settings() const { return {.width = 128, .height = 64, .path = GetParam()}; }
};
class BlockPath : public EveryPath {};
class TrianglePath : public EveryPath {};  // of Ls and halves

TEST_P(BlockPath, CornersLieAtTexelCentres) {
  for (uint32_t triangles = 1; triangles <= 3; ++triangles) {
    SceneBuilder b;
    b.instance(b.patch(triangles), b.material(coordinates()));
    const World world = make_world(b.build());
    const std::vector<Placement> placements{block(0, 0, 0, 4, 4), block(0, 16, 0, 5, 3),
                                            block(0, 48, 0, 3, 2), block(0, 64, 0, 1, 1),
                                            block(0, 0, 32, 4, 3, true)};
    const GatherResult r = gather(world, {0.5, 0.5, 2}, placements, settings());
    for (const Placement& p : placements)
      for (uint32_t t = 0; t < triangles; ++t)
        for (uint32_t c = 0; c < 3; ++c) {
          const vec2 corner = scene::patch_corner(triangles, t, c);
          const vec2 along = p.transposed ? vec2(corner.y, corner.x) : corner;
          const uint32_t x =
              p.x + static_cast<uint32_t>(std::lround(along.x * static_cast<float>(p.width - 1)));
          const uint32_t y =
              p.y + static_cast<uint32_t>(std::lround(along.y * static_cast<float>(p.height - 1)));
          if (triangles == 3 && p.width == 2) continue;  // the tip shares a corner's texel
          EXPECT_NEAR(linear(r.atlas.at(x, y)[0]), corner.x, 0.01f) << triangles << " at " << x << "," << y;
          EXPECT_NEAR(linear(r.atlas.at(x, y)[1]), corner.y, 0.01f) << triangles << " at " << x << "," << y;
          EXPECT_EQ(r.atlas.at(x, y)[3], 255);
        }
  }
}

TEST_P(BlockPath, EveryTexelOfATwoTrianglePatchIsLinear) {
  SceneBuilder b;
  b.instance(b.patch(2), b.material(coordinates()));
  const World world = make_world(b.build());
  for (const bool transposed : {false, true}) {
    const Placement p = block(0, 8, 16, 5, 4, transposed);
    const GatherResult r = gather(world, {0.5, 0.5, 2}, {&p, 1}, settings());
    for (uint32_t j = 0; j < 16; ++j)
      for (uint32_t i = 0; i < 32; ++i) {
        const float u = static_cast<float>(i) / 31, v = static_cast<float>(j) / 15;
        const uint8_t* texel = r.atlas.at(8 + i, 16 + j);
        EXPECT_NEAR(linear(texel[0]), transposed ? v : u, 0.01f);
        EXPECT_NEAR(linear(texel[1]), transposed ? u : v, 0.01f);
      }
  }
}

// TSS eq. 5: even on the screen of the eye that the codes stand for, so on the surface weights go by 1 /
// distance.
TEST_P(BlockPath, SpacedSamplesAreEvenOnTheirEyesScreen) {
  for (uint32_t triangles = 1; triangles <= 3; ++triangles) {
    SceneBuilder b;
    b.instance(b.patch(triangles), b.material(coordinates()));
    const World world = make_world(b.build());
    Placement p = block(0, 0, 0, 5, 5);
    p.width = 30;  // sides need not be powers of two
    p.spacing = {21, -10, 30, 5};
    const GatherResult r = gather(world, {0.5, 0.5, 2}, {&p, 1}, settings());
    // Distances by patch corner, and the patch's corners of each triangle (scene::Patch).
    const double distance[] = {1, 2, std::exp2(-10 / 21.0), std::exp2(30 / 21.0), std::exp2(5 / 21.0)};
    const int corners[3][3][3] = {{{0, 1, 2}}, {{0, 1, 2}, {3, 2, 1}}, {{0, 1, 2}, {3, 0, 2}, {1, 4, 2}}};
    size_t checked = 0;
    for (uint32_t t = 0; t < triangles; ++t) {
      dvec2 at[3], shown[3];
      for (uint32_t c = 0; c < 3; ++c) {
        shown[c] = scene::patch_corner(triangles, t, c);
        at[c] = glm::floor(shown[c] * dvec2(29, 31) + 0.5);
      }
      const dvec2 e1 = at[1] - at[0], e2 = at[2] - at[0];
      const double det = e1.x * e2.y - e1.y * e2.x;
      for (uint32_t y = 0; y < 32; ++y)
        for (uint32_t x = 0; x < 30; ++x) {
          const dvec2 d = dvec2(x, y) - at[0];
          const double s1 = (d.x * e2.y - d.y * e2.x) / det, s2 = (e1.x * d.y - e1.y * d.x) / det;
          const double s[] = {1 - s1 - s2, s1, s2};
          if (std::min({s[0], s[1], s[2]}) < 0.01) continue;
          dvec2 expected(0);
          double sum = 0;
          for (int c = 0; c < 3; ++c) {
            const double weight = s[c] / distance[corners[triangles - 1][t][c]];
            expected += weight * shown[c];
            sum += weight;
          }
          expected /= sum;
          ++checked;
          EXPECT_NEAR(linear(r.atlas.at(x, y)[0]), expected.x, 0.01) << triangles << " at " << x << "," << y;
          EXPECT_NEAR(linear(r.atlas.at(x, y)[1]), expected.y, 0.01) << triangles << " at " << x << "," << y;
        }
    }
    EXPECT_GT(checked, 300u);
  }
}

// What a sample of a triangle with these spaced corners shows: the coordinates of its patch of two.
dvec2 shown_at(const vec3& s, uint32_t triangle, const std::array<atlas::SpacingCode, 4>& spacing) {
  const double distance[] = {1, std::exp2(spacing[0] / 21.0), std::exp2(spacing[1] / 21.0)};
  dvec2 shown(0);
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    shown += s[c] / distance[c] * dvec2(scene::patch_corner(2, triangle, static_cast<uint32_t>(c)));
    sum += s[c] / distance[c];
  }
  return shown / sum;
}

void expect_shown(const GatherResult& r, const atlas::addressing::ivec2& at, const dvec2& expected) {
  const uint8_t* texel = r.atlas.at(static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y));
  EXPECT_NEAR(linear(texel[0]), expected.x, 0.01) << at.x << "," << at.y;
  EXPECT_NEAR(linear(texel[1]), expected.y, 0.01) << at.x << "," << at.y;
  EXPECT_EQ(texel[3], 255);
}

size_t used_texels(const GatherResult& r) {
  size_t used = 0;
  for (size_t i = 3; i < r.atlas.rgba.size(); i += 4) used += r.atlas.rgba[i] != 0;
  return used;
}

TEST_P(TrianglePath, LsShowTheirTriangles) {
  namespace addressing = atlas::addressing;
  SceneBuilder b;
  b.instance(b.patch(2), b.material(coordinates()));
  const World world = make_world(b.build());
  for (const int level : {1, 2, 5, 12}) {
    for (const int splits : {1, 3}) {
      Placement p{.patch = 0, .part = atlas::part_of(1), .kind = PlacementKind::l, .x = 90, .y = 2};
      p.spacing = {21, -10};
      p.l = {static_cast<uint8_t>(level), static_cast<uint8_t>(splits), level == 5,
             static_cast<uint16_t>(2 + addressing::l_pair_pitch(level).y)};
      const GatherResult r = gather(world, {0.5, 0.5, 2}, {&p, 1}, settings());
      EXPECT_EQ(r.stats.samples, p.texels());
      EXPECT_EQ(used_texels(r), p.texels());
      for (int i = 0; i < splits * splits; ++i) {
        const int half = i + p.l.turned;
        const addressing::ivec2 pair = addressing::l_pair_place(half / 2, {p.x, p.y}, p.l.next_y, level, 128);
        const addressing::SplitPlace place = addressing::split_place(i, splits);
        for (int k = 0; k < addressing::l_samples(level); ++k) {
          const addressing::ivec2 texel = addressing::l_sample(k, level);
          const vec3 local = addressing::l_barycentric(texel, level);
          const vec2 s = place.corner + place.scale * vec2(local.y, local.z);
          expect_shown(r, pair + addressing::l_pair_texel(texel, half % 2 == 1, level),
                       shown_at({1 - s.x - s.y, s.x, s.y}, 1, p.spacing));
        }
      }
    }
  }
}

TEST_P(TrianglePath, HalvesShowTheirTriangles) {
  namespace addressing = atlas::addressing;
  SceneBuilder b;
  b.instance(b.patch(2), b.material(coordinates()));
  const World world = make_world(b.build());
  for (const uint8_t apex : {0, 1, 2}) {
    Placement p{.patch = 0, .part = atlas::part_of(0), .kind = PlacementKind::halves};
    p.spacing = {21, -10};
    p.halves = {apex, 20, 6, {{{2, 4, 4, true}, {20, 30, 40, false}}}};
    const GatherResult r = gather(world, {0.5, 0.5, 2}, {&p, 1}, settings());
    EXPECT_EQ(r.stats.samples, p.texels());
    EXPECT_EQ(r.stats.half_samples, p.texels());
    EXPECT_EQ(used_texels(r), p.texels());
    uint64_t outside = 0;
    for (int h = 0; h < 2; ++h) {
      const atlas::HalfPlace& half = p.halves.half[h];
      const addressing::ivec2 size = addressing::half_staircase(p.halves.across, half.along);
      for (int k = 0; k < addressing::staircase_samples(size); ++k) {
        const addressing::ivec2 at = addressing::staircase_position(k, size);
        if (at.x * size.y + at.y * size.x > size.x * size.y) {
          ++outside;
          continue;
        }
        const addressing::HalfSample sample = addressing::half_weights(
            at, p.halves.across, half.along, h, addressing::foot_from_code(p.halves.foot));
        vec3 s;
        s[apex] = sample.weights.y;
        s[(apex + 2) % 3] = sample.weights.x;
        s[(apex + 1) % 3] = 1 - sample.weights.x - sample.weights.y;
        expect_shown(r, addressing::ivec2(half.x, half.y) + addressing::half_texel(at, size, half.turned),
                     shown_at(s, 0, p.spacing));
      }
    }
    EXPECT_EQ(r.stats.half_samples_outside, outside);
  }
}

// Grey about the cut-off's 0.5: black and white would take more bits than the colours beside them.
constexpr int kUncovered = 96, kCovered = 159;

TEST_P(TrianglePath, MaskedLsCarryCoverageInTheTurnedOne) {
  namespace addressing = atlas::addressing;
  SceneBuilder b;
  b.instance(b.patch(2), b.material(wavy(b, true)));
  const World world = make_world(b.build());
  Placement p{
      .patch = 0, .part = atlas::part_of(0), .kind = PlacementKind::l, .x = 4, .y = 4, .masked = true};
  p.l.level = 20;
  const GatherResult r = gather(world, {0.5, 0.5, 2}, {&p, 1}, settings());
  EXPECT_EQ(used_texels(r), p.texels());
  for (int k = 0; k < addressing::l_samples(20); ++k) {
    const addressing::ivec2 texel = addressing::l_sample(k, 20);
    const addressing::ivec2 at = addressing::ivec2(4) + addressing::l_pair_texel(texel, true, 20);
    const uint8_t* grey = r.atlas.at(static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y));
    EXPECT_TRUE(grey[0] == grey[1] && grey[0] == grey[2]);
    const float u = addressing::l_barycentric(texel, 20).y;  // alpha is 0 in the left half
    if (u < 0.42f) {
      EXPECT_NEAR(grey[0], kUncovered, 4) << u;
    }
    if (u > 0.58f) {
      EXPECT_NEAR(grey[0], kCovered, 4) << u;
    }
  }
}

TEST_P(BlockPath, ALoneTriangleRepeatsItsEdge) {
  SceneBuilder b;
  b.instance(b.patch(1), b.material(coordinates()));
  const Placement p = block(0, 0, 0, 4, 4);
  const GatherResult r = gather(make_world(b.build()), {0.5, 0.5, 2}, {&p, 1}, settings());
  EXPECT_NEAR(linear(r.atlas.at(15, 15)[0]), 0.5f, 0.01f);
  EXPECT_NEAR(linear(r.atlas.at(15, 15)[1]), 0.5f, 0.01f);
  for (uint32_t j = 0; j < 16; ++j)
    for (uint32_t i = 16 - j; i < 16; ++i)
      EXPECT_NEAR(linear(r.atlas.at(i, j)[0]) + linear(r.atlas.at(i, j)[1]), 1, 0.02f);
}

TEST_P(BlockPath, MaskedBlocksCarryCoverageInTheirSecondHalf) {
  SceneBuilder b;
  b.instance(b.patch(2), b.material(wavy(b, true)));
  const World world = make_world(b.build());
  const std::vector<Placement> placements{block(0, 0, 0, 5, 4, false, true),
                                          block(0, 32, 0, 4, 4, false, true)};
  const GatherResult r = gather(world, {0.5, 0.5, 2}, placements, settings());
  for (uint32_t j = 0; j < 16; ++j)
    for (uint32_t i = 0; i < 16; ++i) {
      const uint8_t* grey = r.atlas.at(16 + i, j);
      EXPECT_EQ(grey[0], grey[1]);
      EXPECT_EQ(grey[0], grey[2]);
      if (i < 7) {
        EXPECT_NEAR(grey[0], kUncovered, 4);
      }
      if (i > 8) {
        EXPECT_NEAR(grey[0], kCovered, 4);
      }
    }
  for (uint32_t j = 0; j < 8; ++j)
    for (uint32_t i = 0; i < 16; ++i) {
      if (i < 7) {
        EXPECT_NEAR(r.atlas.at(32 + i, 8 + j)[0], kUncovered, 4);
      }
      if (i > 8) {
        EXPECT_NEAR(r.atlas.at(32 + i, 8 + j)[0], kCovered, 4);
      }
    }
}

TEST_P(BlockPath, UnusedTexelsKeepMidGrey) {
  SceneBuilder b;
  b.instance(b.patch(2), b.material(coordinates()));
  const Placement p = block(0, 4, 4, 2, 2);
  const GatherResult r = gather(make_world(b.build()), {0.5, 0.5, 2}, {&p, 1}, settings());
  for (uint32_t y = 0; y < 64; ++y)
    for (uint32_t x = 0; x < 128; ++x) {
      const bool used = x >= 4 && x < 8 && y >= 4 && y < 8;
      EXPECT_EQ(r.atlas.at(x, y)[3], used ? 255 : 0);
      if (!used) {
        EXPECT_NEAR(r.atlas.at(x, y)[1], 128, 1);
      }
    }
}

std::string path_name(const testing::TestParamInfo<GatherPath>& info) {
  switch (info.param) {
    case GatherPath::automatic:
      return "automatic";
    case GatherPath::compute:
      return "compute";
    case GatherPath::raster:
      return "raster";
    case GatherPath::tessellation:
      break;
  }
  return "tessellation";
}

INSTANTIATE_TEST_SUITE_P(Gather, BlockPath, testing::Values(GatherPath::compute, GatherPath::raster),
                         path_name);
INSTANTIATE_TEST_SUITE_P(Gather, TrianglePath,
                         testing::Values(GatherPath::compute, GatherPath::raster, GatherPath::tessellation),
                         path_name);

TEST(Gather, MatchesTheReferencePicture) {
  SceneBuilder b;
  scene::Material m{.metallic = 0, .roughness = 0.6f};
  m.base_color_texture.texture = b.texture(wavy_texture(64, false));
  b.instance(b.rectangle({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), b.material(m));
  b.light({.type = scene::LightType::point, .intensity = 6}, {0.3, 0.4, 1}, {0, 0, -1});
  const World world = make_world(b.build());
  const dvec3 eye(0, 0, 2);
  const Placement p = block(0, 0, 0, 6, 6);
  const GatherResult r = gather(world, eye, {&p, 1}, {.width = 64, .height = 64});
  // A view in which texel centres are pixel centres: 64 texels span 63/64 of the picture's 2 m at 2 m
  // distance.
  const float t = 0.5f * 64 / 63;
  View view = look(eye, {}, 64);
  view.fov = {-t, t, -t, t};
  const ReferenceImage truth = render(world, view, {.samples = 1});
  double error = 0;
  // But for the border, where the pixel's centre lies on the very edge of the square.
  for (uint32_t y = 1; y < 63; ++y)
    for (uint32_t x = 1; x < 63; ++x)
      for (int c = 0; c < 3; ++c) error += std::abs(r.atlas.at(x, 63 - y)[c] - truth.color.at(x, y)[c]);
  EXPECT_LT(error / (3 * 62 * 62), 0.7);
}

TEST(Gather, SingleColorsComeInTheOrderOfPlacements) {
  SceneBuilder b;
  const vec4 colors[] = {{1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, 1, 1}};
  const uint32_t geometry = b.patch(2);
  for (auto& v : b.scene().geometries[0].vertices) v.color = ~0u;
  for (const vec4& color : colors) b.instance(geometry, b.material({.base_color = color, .unlit = true}));
  const World world = make_world(b.build());
  const Placement placements[] = {{.patch = 2}, block(1, 0, 0, 2, 2), {.patch = 0}, {.patch = 1}};
  const GatherResult r = gather(world, {0, 0, 2}, placements, {.width = 16, .height = 16});
  EXPECT_THAT(r.colors, testing::ElementsAre(0xff0000u, 0x0000ffu, 0x00ff00u));
  EXPECT_EQ(r.stats.color_samples, 3u);
  EXPECT_EQ(r.stats.samples, 3u + 16u);
}

TEST(Gather, AnEmptyLayoutDispatchesNothing) {
  SceneBuilder b;
  b.instance(b.patch(2), b.material({}));
  const World world = make_world(b.build());
  const auto gather =
      Gather::create(device(), *world.gpu_scene, *world.lighting, {.width = 16, .height = 16});
  ASSERT_TRUE(gather.ok());
  const uint64_t draws = device().draws_recorded(), dispatches = device().dispatches_recorded();
  gpu::Commands commands = device().begin();
  ASSERT_TRUE((*gather)->record(commands, *world.instant, look({}, {0, 0, -1}), {}).ok());
  ASSERT_TRUE(device().run(std::move(commands)).ok());
  EXPECT_EQ((*gather)->stats().samples, 0u);
  EXPECT_EQ(device().draws_recorded(), draws);
  EXPECT_EQ(device().dispatches_recorded(), dispatches);
}

TEST(Gather, RefusesPlacementsThatLeaveTheAtlasOrTheScene) {
  SceneBuilder b;
  b.instance(b.patch(2), b.material({}));
  const World world = make_world(b.build());
  const auto gather =
      Gather::create(device(), *world.gpu_scene, *world.lighting, {.width = 16, .height = 16});
  ASSERT_TRUE(gather.ok());
  for (const Placement& p : {block(1, 0, 0, 2, 2), block(0, 14, 0, 2, 2), block(0, 0, 14, 2, 2),
                             block(0, 0, 0, 15, 2), Placement{.patch = scene::kNone}}) {
    gpu::Commands commands = device().begin();
    EXPECT_EQ((*gather)->record(commands, *world.instant, look({}, {0, 0, -1}), {&p, 1}).code(),
              absl::StatusCode::kInvalidArgument);
  }
}

TEST(Gather, BothSidesOfADoubleSidedPatchAreLitFromTheEye) {
  SceneBuilder b;
  b.instance(b.patch(2), b.material({.metallic = 0, .double_sided = true}));
  b.light({.type = scene::LightType::point, .intensity = 20}, {0.5, 0.5, 2}, {0, 0, -1});
  LightingSettings dark;
  dark.ambient_sky = dark.ambient_ground = vec3(0);
  const World world = make_world(b.build(), dark);
  const Placement p = block(0, 0, 0, 2, 2);
  const GatherSettings settings{.width = 16, .height = 16};
  EXPECT_GT(gather(world, {0.5, 0.5, 3}, {&p, 1}, settings).atlas.at(3, 3)[0], 100);
  EXPECT_LT(gather(world, {0.5, 0.5, -3}, {&p, 1}, settings).atlas.at(3, 3)[0], 5);
}

}  // namespace
}  // namespace tessera::shading::test
