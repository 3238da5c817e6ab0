#include "geometry-compression/meta_codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "synthetic.h"

namespace tessera::geometry_compression {
namespace {

void expect_round_trip(const MetaFrame& frame) {
  MetaBits bits;
  const auto bytes = encode(frame, &bits);
  const uint64_t sum =
      bits.header + bits.meshes + bits.vertices + bits.objects + bits.moved + bits.patches + bits.placements;
  EXPECT_EQ(bytes.size(), (sum + 7) / 8);
  MetaFrame decoded;
  ASSERT_EQ(decode(bytes, decoded), "");
  ASSERT_TRUE(decoded == frame);
}

TEST(MetaCodec, EmptyFrame) {
  expect_round_trip({});
}

TEST(MetaCodec, RandomFramesOverTheWholeRangeOfEveryField) {
  std::mt19937 random(20260101);
  for (int i = 0; i < 400; ++i) {
    SCOPED_TRACE(i);
    expect_round_trip(random_frame(random, i < 300 ? 12 : 300));
    if (HasFatalFailure()) return;
  }
}

TEST(MetaCodec, ExtremesOfEveryField) {
  MetaFrame f;
  f.frame = f.rtp_timestamp = UINT32_MAX;
  f.atlas_width = f.atlas_height = 8192;
  f.full_state = true;
  const double huge = std::numeric_limits<double>::max(), tiny = std::numeric_limits<double>::denorm_min();
  f.meshes = {{{huge, -huge, tiny}, tiny}, {{-0.0, 0.0, 1}, huge}};
  constexpr int32_t kMax = (1 << 30) - 1;
  for (int32_t a : {kMax, -kMax})
    for (int32_t b : {kMax, -kMax})
      for (int32_t c : {kMax, -kMax, 0}) f.vertices.push_back({UINT32_MAX, {a, b, c}});
  f.vertices.push_back({0, {}});
  Transform t;
  t.linear.fill(std::numeric_limits<float>::max());
  t.translation.fill(-huge);
  f.objects = {{t, true, true, true}, {{}, false, false, false}};
  f.moved = {{0, t}, {UINT32_MAX, {}}};
  for (uint8_t triangles : {3, 1, 2, 3}) {
    NewPatch p{UINT32_MAX, triangles, {}};
    for (int i = 0; i < triangles + 2; ++i) p.vertices[i] = i % 2 ? UINT32_MAX : 0;
    f.patches.push_back(p);
  }
  f.placements = {{0, 0, PlacementKind::block, 8190, 8190, 256, 2, true, {126, -126, 126, -126}},
                  {1, 0, PlacementKind::block, 0, 0, 2, 254, false, {-126, -126, 126, 126}},
                  {.patch = UINT32_MAX - 1, .kind = PlacementKind::color, .rgb = 0xffffff},
                  {.patch = UINT32_MAX, .kind = PlacementKind::none}};
  expect_round_trip(f);
  constexpr uint32_t kLast = (1u << 30) - 1;
  PatchPlacement l{.patch = 0, .part = 1, .kind = PlacementKind::l, .x = 8190, .y = 8190};
  l.spacing = {126, -126};
  l.l = {64, 31, true, 8190};
  PatchPlacement halves{.patch = kLast, .part = 2, .kind = PlacementKind::halves};
  halves.halves = {2, 63, 128, {{{8191, 8190, 1024, true}, {0, 0, 1, false}}}};
  f.placements = {l, halves, {.patch = kLast, .part = 3, .kind = PlacementKind::color, .rgb = 0xffffff}};
  expect_round_trip(f);
}

// A parallelogram of extreme corners predicts far outside 32 bits.
TEST(MetaCodec, PredictionsWrapWithoutLoss) {
  constexpr int32_t kMax = (1 << 30) - 1;
  MetaFrame f;
  for (uint32_t i = 0; i < 64; ++i) {
    const auto sign = [&](int bit) { return (i >> bit) & 1 ? kMax : -kMax; };
    const auto first = static_cast<uint32_t>(f.vertices.size());
    for (int v = 0; v < 5; ++v) f.vertices.push_back({0, {sign(v), sign((v + 1) % 6), sign((v + 2) % 6)}});
    f.patches.push_back({0, 3, {first, first + 1, first + 2, first + 3, first + 4}});
    f.patches.push_back({0, 2, {first + 3, first + 1, first + 2, first}});
  }
  expect_round_trip(f);
}

TEST(MetaCodec, TorusWithAllSections) {
  std::mt19937 random(5);
  expect_round_trip(torus_frame(random, 32));
}

TEST(MetaCodec, PacketsThatContinueALargeScene) {
  std::mt19937 random(6);
  MetaFrame f = torus_frame(random, 16);
  f.full_state = false;
  for (NewPatch& p : f.patches)
    for (int i = 0; i < p.triangles + 2; ++i) p.vertices[i] += 3'000'000;
  for (PatchPlacement& p : f.placements) p.patch += 2'000'000;
  MetaBits moved, at_zero;
  encode(f, &moved);
  expect_round_trip(f);
  MetaFrame first = torus_frame(random, 16);
  encode(first, &at_zero);
  // Where ids start must not matter for what a patch or vertex costs.
  EXPECT_LT(static_cast<double>(moved.vertices), 1.1 * static_cast<double>(at_zero.vertices));
  EXPECT_LT(static_cast<double>(moved.patches), 1.1 * static_cast<double>(at_zero.patches) + 100);
}

// docs/meta-format.md, "Test vector": another implementation must produce these bytes.
TEST(MetaCodec, TestVectorOfTheSpecification) {
  MetaFrame f;
  f.frame = 7;
  f.rtp_timestamp = 21000;
  f.atlas_width = 2048;
  f.atlas_height = 1024;
  f.meshes = {{{1, 2, 3}, 0.5}};
  f.vertices = {{0, {0, 0, 0}}, {0, {100, 0, -4}}, {0, {0, 50, 0}}, {0, {101, 50, -4}}};
  NewObject object;
  object.double_sided = true;
  object.transform.translation = {0, 4, 0};
  f.objects = {object};
  // The last one: spelled out, rules 8 and 11, spelled out by the parallelogram.
  f.patches = {{0, 2, {60, 61, 62, 63}}, {0, 1, {62, 63, 60}}, {0, 2, {40, 41, 39, 50}}};
  f.placements = {{.patch = 0, .kind = PlacementKind::block, .x = 32, .y = 16, .width = 16, .height = 8},
                  {.patch = 1, .kind = PlacementKind::color, .rgb = 0x0a141e},
                  {.patch = 2, .kind = PlacementKind::color, .rgb = 0x0c1a28}};
  const auto bytes = encode(f);
  std::string hex;
  for (uint8_t b : bytes) {
    hex += "0123456789abcdef"[b >> 4];
    hex += "0123456789abcdef"[b & 15];
  }
  EXPECT_EQ(
      hex,
      "54534d46030000000700005208080004004183021c48703c1ff80000000000001000000000000000080100000000000003fe00"
      "000000000005ff90040000000000003a1a3abe194e0cc506cd046cbd5a8280cc0cf818197b1e08ebfbfa2b6f67ffead4471ced"
      "11f0");
  expect_round_trip(f);
}

}  // namespace
}  // namespace tessera::geometry_compression
