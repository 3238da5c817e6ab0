#include "client-sdk/scene_state.h"

#include <gtest/gtest.h>

#include <random>

namespace tessera::client {
namespace {

TEST(TriangleRecord, EveryBlockPositionAndSizeSurvivesPacking) {
  for (uint32_t i = 0; i < 8192; i += 2) {
    for (uint8_t log = 1; log <= 8; ++log) {
      TriangleFields f{.x = static_cast<uint16_t>(i), .y = static_cast<uint16_t>(8190 - i)};
      f.log_w = log;
      f.log_h = static_cast<uint8_t>(9 - log);
      ASSERT_EQ(unpack(pack(f)), f) << i << " " << int{log};
    }
  }
}

TEST(TriangleRecord, FieldsDoNotDisturbEachOther) {
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    TriangleFields f;
    for (auto& vertex : f.vertices) vertex = random() >> (random() % 2 ? 10 : 31);
    f.object = random() >> 12;
    f.corner_kind = static_cast<uint8_t>(random() % 6);
    f.transposed = random() & 1;
    f.masked = random() & 1;
    f.reversed = random() & 1;
    f.single_color = random() & 1;
    if (f.single_color) {
      f.rgb = random() >> 8;
    } else {
      f.x = static_cast<uint16_t>(random() % 4096 * 2);
      f.y = static_cast<uint16_t>(random() % 4096 * 2);
      f.log_w = static_cast<uint8_t>(1 + random() % 8);
      f.log_h = static_cast<uint8_t>(1 + random() % 8);
    }
    ASSERT_EQ(unpack(pack(f)), f);
  }
}

// The layout is shared with shaders, so the bits themselves are pinned.
TEST(TriangleRecord, BitsAreWhereTheHeaderSays) {
  const TriangleRecord block = pack({.vertices = {1, 2, 3},
                                     .object = (5u << 10) | 9,
                                     .corner_kind = 4,
                                     .transposed = true,
                                     .masked = true,
                                     .reversed = true,
                                     .x = 10,
                                     .y = 20,
                                     .log_w = 3,
                                     .log_h = 2});
  EXPECT_EQ(block.a, 1u | 4u << 22 | 1u << 25 | 1u << 26 | 1u << 27);
  EXPECT_EQ(block.b, 2u | 9u << 22);
  EXPECT_EQ(block.c, 3u | 5u << 22);
  EXPECT_EQ(block.d, 5u | 10u << 12 | 2u << 24 | 1u << 27);
  EXPECT_EQ(pack({.single_color = true, .rgb = 0x123456}).d, 0x80123456u);
}

}  // namespace
}  // namespace tessera::client
